"""The C++ client's programs for Windows, compiled by MinGW and run by Wine: `tests long` does so.

Wine is not Windows: where the two differ, this shows what Wine does.
"""

import os
import secrets
import shlex
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from threading import Timer
from typing import IO

import pytest
from splatbus_conformance.data import cache_folder
from splatbus_server import shared_memory

from tests.conformance.harness import run
from tests.engines.built import CPP, PROGRAMS, Command, compiled_cpp
from tests.engines.judging import WHOLE_SECONDS, check_conforms
from tests.engines.stage import asked, planes, serving
from tests.engines.test_core import VECTORS
from tests.waiting import eventually

COMPILER = "x86_64-w64-mingw32-g++-posix"
LIMIT_SECONDS = 60


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Command]:
    """In a folder that no code page of Windows can spell."""
    if not shutil.which("wineserver"):
        pytest.skip("Wine is not installed")
    built = compiled_cpp(PROGRAMS, COMPILER, ("-O1", "-static"), ["-lws2_32"])
    program = tmp_path_factory.mktemp("é 図") / "programs.exe"
    shutil.copy(built, program)
    (prefix := cache_folder().with_name("splatbus-wine")).mkdir(exist_ok=True)
    with pytest.MonkeyPatch.context() as variables:
        variables.setenv("WINEPREFIX", str(prefix))
        variables.setenv("WINEDEBUG", "-all")
        # Begun here, or it would end with whoever needs it first.
        for line in (["wineserver", "--persistent"], ["wine", "wineboot"]):
            subprocess.run(line, check=True, stdout=subprocess.DEVNULL, timeout=600)
        yield ["wine", str(program)]
        subprocess.run(["wineserver", "--kill"], check=True, timeout=LIMIT_SECONDS)
        subprocess.run(["wineserver", "--wait"], check=True, timeout=LIMIT_SECONDS)


def test_vectors(programs: Command) -> None:
    for file in VECTORS.glob("[!v]*.json"):
        subprocess.run([*programs, "Tests", str(file)], check=True, timeout=LIMIT_SECONDS)


def test_a_thread_that_waits_hears_what_is_said_while_it_wakes(programs: Command) -> None:
    subprocess.run([*programs, "Tests", "--wakes", "500"], check=True, timeout=LIMIT_SECONDS)


@pytest.mark.parametrize("axes", ["unreal", "opengl"])
def test_it_conforms(axes: str, programs: Command) -> None:
    command = shlex.join([*programs, "Adapter", axes])
    words = ("--profile", "quick", "--shrink", "0")
    status, told = run("client", "--adapter", command, *words, limit=WHOLE_SECONDS)
    assert status == 0, told
    assert "\nconforming at L2: " in told


def test_the_viewer_conforms_in_what_an_adapter_does_not_show(programs: Command) -> None:
    check_conforms(shlex.join([*programs, "Viewer"]))


def test_a_file_has_a_name_beyond_the_code_page(programs: Command) -> None:
    program = Path(programs[-1])
    manifest = program.with_suffix(".exe.manifest")
    shutil.copy(CPP / "programs" / "utf-8.manifest", manifest)
    picture = program.with_name("é 図.png")
    with serving(lambda view: planes(view.poses.camera)) as where:
        line = [*programs, "Viewer", str(picture)]
        subprocess.run(line, env=where, check=True, timeout=LIMIT_SECONDS)
    assert picture.is_file()
    manifest.unlink()


def test_memory_goes_with_the_program_of_windows_that_has_it(
    programs: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """[OPN-9]: with its name; who has opened it keeps it. A viewer that nobody hears ends."""

    def create(size: int) -> shared_memory.Segment:
        name = f"splatbus-wine-{secrets.token_hex(6)}"
        _, lines = started(holders, [*programs, "Hold", name, str(size)], os.environ)
        assert lines.readline() == "held\n"
        return shared_memory.Segment(name, memoryview(bytearray(size)), ExitStack())

    monkeypatch.setattr(shared_memory, "create", create)
    monkeypatch.setenv("SPLATBUS_TOKEN", "é図: no code page has both")
    viewer = [*programs, "Viewer"]
    with (
        ExitStack() as holders,
        serving(lambda view: planes(view.poses.camera), on_and_on=True) as where,
        asked([*programs, "Adapter"], where) as ask,
        ExitStack() as viewers,
    ):
        ask(
            '{"id":1,"command":"start"}'
        )  # it speaks first, so each answer is to what was asked before
        pixels = partial(ask, '{"id":2,"command":"pixels","at":[[0,0]]}')
        assert eventually(lambda: pixels().get("seq"))
        process, lines = started(viewers, viewer, where)
        assert any("0.5 0.5 0.5 in the middle" in line for line in lines)
        lines.close()
        assert process.wait(LIMIT_SECONDS) == 1
        holders.close()
        before = pixels()["seq"]
        assert eventually(lambda: pixels()["seq"] > before + 1)
        assert pixels().items() >= {"color": [[0.5] * 4], "depth": [0.5]}.items()
        _, lines = started(viewers, viewer, where)
        assert any("no images: there is no shared memory" in line for line in lines)


def started(
    stack: ExitStack, line: Command, where: Mapping[str, str]
) -> tuple[subprocess.Popen[str], IO[str]]:
    """A program and what it prints; it is killed with the stack, or when its time is over."""
    pipe = subprocess.PIPE
    process = stack.enter_context(
        subprocess.Popen(line, env=where, stdin=pipe, stdout=pipe, text=True)
    )
    timer = Timer(LIMIT_SECONDS, process.kill)
    stack.callback(timer.cancel)
    stack.callback(process.kill)
    timer.start()
    assert process.stdout
    return process, process.stdout
