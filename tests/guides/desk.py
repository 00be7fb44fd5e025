"""A folder in which the commands of the pages find what they name, and what is run there.

Wherever a page has a program of its reader, the folder has one of ours under that name: for clients
the example of the guide, for servers and adapters the reference ones.
"""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from splatbus_conformance.cases.script import Case, Script, save
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.wire.ports import free_port

from tests.guides.pages import ROOT

GUIDES = ROOT / "conformance" / "guides"
EXAMPLE = ROOT / "conformance" / "splatbus_conformance" / "minimal_client.py"
CLIENT = f'"{sys.executable}" "{EXAMPLE}"'
SERVER = f'"{sys.executable}" -u -m splatbus_renderer'
PROGRAMS = {
    "my-viewer": CLIENT,
    "my-client": CLIENT,
    "my-server": SERVER,
    "Build/MyViewer.x86_64": CLIENT,
    "Linux/MyProject.sh": CLIENT,
    "bin/UnrealEditor-Cmd": CLIENT,
    "bin/blender": CLIENT,
}
"""What stands under the names of the readers' programs. Their arguments go nowhere."""
PYTHON_PROGRAMS = {
    "my_renderer.py": "from splatbus_renderer.cli import main\nraise SystemExit(main([]))\n",
    "my_adapter.py": "from splatbus_viewer.adapter import main\nmain([])\n",
}
ENGINE = """\
import os, socket, sys
print("an engine logs where it likes", flush=True)
port = int(os.environ["SPLATBUS_ADAPTER_PORT"])
sys.stdin = sys.stdout = socket.create_connection(("127.0.0.1", port)).makefile(
    "rw", encoding="utf-8", buffering=1
)
from splatbus_viewer.adapter import main
main([])
"""
"""What an engine does that has an adapter in it: the reference adapter, by way of a socket."""
LIMIT_SECONDS = 240
ENVIRONMENT = dict(os.environ)
"""Taken once: commands run at the same time, and pytest changes the real one between tests."""


class Outcome(NamedTuple):
    status: int
    output: str
    files: set[str]
    """What is in the folder afterwards."""


def prepared(folder: Path, line: str) -> Path:
    """The folder, for one line of a page."""
    for name, command in PROGRAMS.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        engine = "engine_adapter.py" in line
        does = f'"{sys.executable}" "{folder / "engine.py"}"' if engine else command
        path.write_text(f"#!/bin/sh\nexec {does}\n")
        path.chmod(0o755)
    for name, source in {**PYTHON_PROGRAMS, "engine.py": ENGINE}.items():
        (folder / name).write_text(source, "utf-8")
    shutil.copy(GUIDES / "engine_adapter.py", folder)
    shutil.copytree(GUIDES, folder / "conformance" / "guides", dirs_exist_ok=True)
    (folder / "known.toml").write_text("", "utf-8")
    data = ROOT / "tests" / "data"
    recording = data / "recordings" / "unity-csharp.jsonl"
    shutil.copy(recording, folder / "session.jsonl")
    shutil.copy(data / "captures" / "pair.pcap", folder / "session.pcap")
    (folder / "sessions").mkdir()
    shutil.copy(recording, folder / "sessions")
    for name in re.findall(r"[\w/-]+/[A-Z]{3}-\d+-\w+\.json", line):
        write_script(folder / name)
    return folder


def write_script(path: Path) -> None:
    """The script of a failure, with the first case of the check that its name tells."""
    path.parent.mkdir(parents=True, exist_ok=True)
    requirement, check = re.fullmatch(r"([A-Z]{3}-\d+)-(\w+)", path.stem).groups()  # type: ignore[union-attr]
    sides = [
        side
        for side in ("client", "server")
        for it in checks_of(side)
        if (it.requirement, it.name) == (requirement, f"check_{check}")
    ]
    assert sides, f"{path.name} names no check"
    save(Script(sides[0], requirement, f"check_{check}", False, ((Case(False, 0),),)), path)


def run(folder: Path, line: str, beside: str = "", until: str = "") -> Outcome:
    """Run a line in the folder as a shell does, word for word but for the ports.

    Args:
        beside: "client" or "server", to have one that belongs to the line run at the same time.
        until: for what does not end by itself: a text of its output, or a file, after which it is
            interrupted.
    """
    ports = {name: free_port() for name in ("6001", "6000", "7001", "7000")}
    line = re.sub(r"\b(6001|6000|7001|7000)\b", lambda found: str(ports[found[0]]), line)
    through = "700" if " proxy " in line else "600"
    to_it = {
        "SPLATBUS_IPC_PORT": str(ports[f"{through}1"]),
        "SPLATBUS_MSG_PORT": str(ports[f"{through}0"]),
    }
    found = [str(folder / "bin"), str(Path(sys.executable).parent), ENVIRONMENT["PATH"]]
    programs = {"PATH": os.pathsep.join(found)}
    usual = programs | {
        "SPLATBUS_IPC_PORT": str(ports["6001"]),
        "SPLATBUS_MSG_PORT": str(ports["6000"]),
    }
    with contextlib.ExitStack() as stack:
        if beside == "server":
            stack.enter_context(started(SERVER, folder, usual, "ready"))
        if beside == "client" or " proxy " in line:
            stack.enter_context(started(CLIENT, folder, to_it))
        return finished(line, folder, programs if "--connect" in line else usual, until)


@contextlib.contextmanager
def started(command: str, folder: Path, added: dict[str, str], sign: str = "") -> Iterator[None]:
    """A program that runs meanwhile, from when it has printed `sign`."""
    log = folder / "beside.txt"
    with log.open("wb") as output:
        process = subprocess.Popen(
            f"exec {command}",
            shell=True,
            cwd=folder,
            env=ENVIRONMENT | added,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
    try:
        ends = time.monotonic() + LIMIT_SECONDS
        while sign not in log.read_text("utf-8") and time.monotonic() < ends:
            time.sleep(0.05)
        yield
    finally:
        process.terminate()
        process.wait(LIMIT_SECONDS)


def finished(line: str, folder: Path, added: dict[str, str], until: str) -> Outcome:
    log = folder / "output.txt"
    with log.open("wb") as output:
        process = subprocess.Popen(
            ["bash", "-c", line],
            cwd=folder,
            env=ENVIRONMENT | added | {"PYTHONUNBUFFERED": "1"},
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        ends = time.monotonic() + LIMIT_SECONDS
        while process.poll() is None and time.monotonic() < ends:
            if until and (until in log.read_text("utf-8") or (folder / until).exists()):
                os.killpg(process.pid, signal.SIGINT)
                with contextlib.suppress(subprocess.TimeoutExpired):  # busy, or still starting
                    process.wait(10)
            time.sleep(0.05)
        with contextlib.suppress(ProcessLookupError):  # what it left in the background
            os.killpg(process.pid, signal.SIGTERM if process.poll() is not None else signal.SIGKILL)
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*")}
    return Outcome(process.wait(), log.read_text("utf-8"), files)
