"""The command as a person meets it: what it says, what it asks for, and how it ends."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from splatbus_splats import cli
from splatbus_splats.cli import _Progress, main, parser
from splatbus_splats.drawing.skips import EXACT, NOTHING, Skip
from splatbus_splats.files import ply
from splatbus_splats.files.read import read
from splatbus_splats.loading import scene_of
from splatbus_splats.made import made

from tests.splats.served import COMMAND, ENVIRONMENT, FREE, SECONDS, serving, two_files

pytestmark = pytest.mark.usefixtures("loops")

WITHOUT_EXTRA = [
    sys.executable,
    "-c",
    "import sys; sys.modules['numba'] = None; sys.modules['llvmlite'] = None\n"
    "from splatbus_splats.cli import main; sys.exit(main())",
]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return two_files(tmp_path_factory.mktemp("scene"))


@pytest.fixture(autouse=True)
def _signals_stay() -> Iterator[None]:
    """What `main` does with them is for a process of its own."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_says_what_it_read_and_ends_when_it_is_told(number: int, files: list[Path]) -> None:
    with serving(files[0], "--size", "64x48", files[1]) as server:
        server.process.send_signal(number)
        _, log = server.process.communicate(timeout=SECONDS)
    assert server.process.returncode == 0
    assert "Traceback" not in log
    assert "stopped: Statistics(" in log
    first, second, room, statue, view = log.splitlines()[:5]
    assert first == f"reading {files[0]}, file 1 of 2: 50% read"
    assert second == f"reading {files[1]}, file 2 of 2: 100% read"
    box = read(files[0]).gaussians.bounds
    assert box is not None
    low, high = (", ".join(f"{each:.4g}" for each in corner) for corner in box)
    assert room == (
        f"default (room.ply): 1,500 Gaussians of degree 2, from ({low}) to ({high})"
        "; 1 left out: quaternion zero"
    )
    assert statue.startswith("statue (statue.ply): 700 Gaussians of degree 0, from (")
    assert re.fullmatch(
        r"the view begins at \(.*\) and looks along \+z, with the middle of the scene in view:"
        r" no cameras.json is given or near the file",
        view,
    )


def test_cameras_nearby_that_are_others_are_said_and_left(tmp_path: Path) -> None:
    ply.write(tmp_path / "a.ply", made(50, 0))
    (tmp_path / "cameras.json").write_text("{}")
    with serving(tmp_path / "a.ply") as server:
        assert server.size == (640, 480)
        server.process.send_signal(signal.SIGTERM)
        _, log = server.process.communicate(timeout=SECONDS)
    assert f"the one near the file is not used ({tmp_path / 'cameras.json'}: no list" in log


def test_the_spheres_need_no_extra_and_files_say_which(files: list[Path]) -> None:
    with serving("--size", "32x24", command=WITHOUT_EXTRA) as server:
        assert server.size == (32, 24)
    done = subprocess.run(
        [*WITHOUT_EXTRA, files[0]], capture_output=True, text=True, env=ENVIRONMENT
    )
    assert done.returncode == 1
    assert done.stderr.startswith("splatbus-server: ")
    assert done.stderr.endswith("pip install 'splatbus-protocol[splats]'\n")
    assert "%" not in done.stderr  # said before anything is read


def test_where_there_is_no_terminal_each_tenth_is_said_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    progress = _Progress(is_terminal=False)
    for done in range(1, 101):
        progress(Path("a.ply"), 1 + (done > 50), 2, done / 100)
    progress.end()
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(": ")[1] for line in lines] == [f"{i}0% read" for i in range(1, 11)]
    assert lines[5] == "reading a.ply, file 2 of 2: 60% read"


def test_on_a_terminal_one_line_says_how_far_it_is(files: list[Path]) -> None:
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [*COMMAND, *files, *FREE, "--size", "64x48"],
        stdout=subprocess.PIPE,
        stderr=theirs,
        env=ENVIRONMENT,
    )
    os.close(theirs)
    assert process.stdout is not None
    assert process.stdout.readline().startswith(b"splatbus-server ready on ")
    said = ""
    while "drawn on" not in said:
        said += os.read(ours, 1 << 16).decode()
    process.kill()
    process.communicate()
    os.close(ours)
    rewritten, _, rest = said.rpartition("\r\x1b[K")
    assert rewritten.count("\n") == 0
    assert f"\rreading {files[1]}, file 2 of 2: 100%\x1b[K" in rewritten
    assert rest.startswith("default (room.ply): 1,500 Gaussians")


def test_it_can_be_stopped_while_it_reads(tmp_path: Path) -> None:
    for i in range(4):
        ply.write(tmp_path / f"{i}.ply", made(60_000, 3))
    with subprocess.Popen(
        [*COMMAND, tmp_path, *FREE], stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    ) as process:
        assert process.stderr is not None
        assert "10% read" in process.stderr.readline()
        process.terminate()
        log = process.stderr.read()
    assert process.returncode == 0
    assert "Traceback" not in log


def test_help_teaches(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    text = capsys.readouterr().out
    assert text.startswith("usage: splatbus-server ")
    for word in (
        "examples:", "what next:", "exit codes:", "--cameras", "--token-file", "--turntable",
        "--rate", "--seconds", "SPLATBUS_TOKEN", "statue.splat", "numbered files", "320x240",
    ):  # fmt: skip
        assert word in text


def mesh(path: Path) -> None:
    path.write_bytes(
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        b"property float z\nend_header\n0 0 0\n"
    )


def compressed(path: Path) -> None:
    path.write_bytes(
        b"ply\nformat binary_little_endian 1.0\nelement chunk 1\nproperty float min_x\n"
        b"element vertex 1\nproperty uint packed_position\nend_header\n" + bytes(8)
    )


def cut(path: Path) -> None:
    ply.write(path, made(10, 0))
    path.write_bytes(path.read_bytes()[:-5])


@pytest.mark.parametrize(
    ("name", "make", "message"),
    [
        ("none.ply", None, "No such file or directory"),
        ("mesh.ply", mesh, "no property f_dc_0, .*: it is a mesh or a cloud of points"),
        ("packed.ply", compressed, "a compressed one, to be exported as a plain .ply first"),
        ("empty.ply", Path.touch, "the file is empty"),
        ("notes.ply", lambda path: path.write_text("Dear diary"), "no PLY file: its first line"),
        ("notes.txt", lambda path: path.write_text("Dear"), "ends in neither .ply nor .splat"),
        ("a.spz", Path.touch, "spz is not read: export the scene as a plain .ply first"),
        ("a.ksplat", Path.touch, "ksplat is not read: export"),
        ("a.sog", Path.touch, "sog is not read: export"),
        ("folder", Path.mkdir, "no files .* has numbered files .*, or a trained model"),
        ("cut.ply", cut, r"the file ends at byte \d+, before the last of 10 rows of vertex"),
        ("cut.splat", lambda path: path.write_bytes(bytes(33)), "at byte 32 is cut short"),
    ],
)
def test_what_is_no_splat_file_is_said(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    make: Callable[[Path], object] | None,
    message: str,
) -> None:
    path = tmp_path / name
    if make is not None:
        make(path)
    assert main([str(path), *FREE]) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"splatbus-server: {path}: ")
    assert error.count("\n") == 1
    assert re.search(message, error)


def test_cameras_that_are_none_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ply.write(tmp_path / "a.ply", made(5, 0))
    cameras = tmp_path / "other.json"
    cameras.write_text(json.dumps([{}]))
    assert main([str(tmp_path / "a.ply"), "--cameras", str(cameras), "--quiet"]) == 1
    assert capsys.readouterr().err == f"splatbus-server: {cameras}: camera 0 has no width\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.ply", "--size", "big"], "'big' is not a size"),
        (["a.ply", "--turntable", "20"], "--turntable is for the spheres"),
        (["a.ply", "--rate", "0"], "'0' is not a positive number"),
        (["a.ply", "--seconds", "-1"], "'-1' is not a positive number"),
        (["--rate", "25"], "--rate is for files of Gaussians, and none is given"),
        (["--seconds", "2"], "--seconds is for files of Gaussians, and none is given"),
        (["--cameras", "c.json"], "--cameras is for files of Gaussians, and none is given"),
        (["--cpu"], "--cpu is for files of Gaussians, and none is given"),
        (["a.ply", "--size", "640x0"], "'640x0' is not from 1 to 32768 pixels"),
        ([""], "'' names no file"),
        (["a.ply"] * 257, "257 files, where there are 256"),
    ],
)
def test_wrong_usage_is_refused(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert message in capsys.readouterr().err


def test_an_address_for_all_needs_a_token(files: list[Path]) -> None:
    command = [*COMMAND, files[1], "--host", "0.0.0.0", "--quiet", *FREE]
    done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT)
    assert done.returncode == 2
    assert "require a token" in done.stderr


def test_skips_are_read_by_their_names(capsys: pytest.CaptureFixture[str]) -> None:
    assert parser().parse_args(["a.ply", "--skips", "none"]).skips == NOTHING
    assert parser().parse_args(["a.ply", "--skips", "exact,small"]).skips == EXACT | Skip.SMALL
    with pytest.raises(SystemExit, match="2"):
        main(["a.ply", "--skips", "dim"])
    assert "argument --skips: 'dim' is none of none, exact, usual" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        main(["--skips", "none"])
    assert "--skips is for files of Gaussians" in capsys.readouterr().err


def test_what_can_be_wrong_without_it_is_said_before_anything_is_read(tmp_path: Path) -> None:
    ply.write(tmp_path / "a.ply", made(50, 0))
    statuses = {("--cameras", "no.txt"): 1, ("--token-file", "no.txt"): 2, (tmp_path / "no",): 1}
    for wrong, status in statuses.items():
        command = [*COMMAND, tmp_path / "a.ply", *wrong, *FREE]
        done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT)
        assert done.returncode == status
        assert re.fullmatch(r"splatbus-server: .*no\b.*: No such file or directory\n", done.stderr)


def test_a_scene_of_nothing_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = made(50, 0)
    scene.means[:] = np.nan
    ply.write(tmp_path / "a.ply", scene)
    assert main([str(tmp_path / "a.ply"), "--quiet", *FREE]) == 1
    assert capsys.readouterr().err == (
        "splatbus-server: there is nothing to show: default (a.ply): 0 Gaussians of degree 0;"
        " 50 left out: position not finite\n"
    )


def test_an_address_that_is_taken_is_no_matter_of_the_gpu(
    files: list[Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli.gpu, "why_not", lambda: None)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = f"{taken.getsockname()[1]}"
        assert main([str(files[1]), "--quiet", "--ipc-port", port, "--msg-port", "0"]) == 1
    assert "already in use" in capsys.readouterr().err
    monkeypatch.setattr(cli, "serve", Mock(side_effect=[OSError("no such memory"), "a bus"]))
    options = parser().parse_args([str(files[1]), "--skips", "usual"])
    assert cli._served(options, None, scene_of({}), 32, 24)[0] == "a bus"
    assert "drawn on the processor (no such memory)" in capsys.readouterr().err


def test_a_full_gpu_is_said(
    files: list[Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    full = type("OutOfMemoryError", (RuntimeError,), {})
    monkeypatch.setattr(cli, "_serve", Mock(side_effect=full("CUDA out of memory")))
    assert main([str(files[1])]) == 1
    assert "memory of the GPU is full: --cpu" in capsys.readouterr().err
