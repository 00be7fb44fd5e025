"""A folder in which the commands of the pages find what they name, and what is run there.

Wherever a page has a program of its reader, the folder has one of ours under that name: for clients
the example of the guide, for servers and adapters the reference ones.
"""

import contextlib
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from splatbus_conformance.cases.script import Case, Script, save
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.wire.ports import free_port

from tests.guides.pages import ROOT
from tests.waiting import eventually

GUIDES = ROOT / "conformance" / "guides"
EXAMPLE = ROOT / "conformance" / "splatbus_conformance" / "minimal_client.py"
CLIENT = f'"{sys.executable}" "{EXAMPLE}"'
SERVER = f'"{sys.executable}" -u -m splatbus_renderer'
PROGRAMS = {
    **dict.fromkeys(("my-viewer", "my-client", "Build/MyViewer.x86_64"), CLIENT),
    **dict.fromkeys(("Linux/MyProject.sh", "bin/UnrealEditor-Cmd", "bin/blender"), CLIENT),
    "my-server": SERVER,
}
"""What stands under the names of the readers' programs. Their arguments go nowhere."""
PYTHON_PROGRAMS = {
    "my_renderer.py": "from splatbus_renderer.cli import main\nraise SystemExit(main([]))\n",
    "my_adapter.py": "from splatbus_viewer.adapter import main\nmain([])\n",
    "engine.py": """\
import os, socket, sys
print("an engine logs where it likes", flush=True)
port = int(os.environ["SPLATBUS_ADAPTER_PORT"])
sys.stdin = sys.stdout = socket.create_connection(("127.0.0.1", port)).makefile(
    "rw", encoding="utf-8", buffering=1
)
from splatbus_viewer.adapter import main
main([])
""",
}
"""An engine that has an adapter in it: the reference adapter, by way of a socket."""
DATA = ROOT / "tests" / "data"
RECORDING = DATA / "recordings" / "unity-csharp.jsonl"
LIMIT_SECONDS = 240
ENVIRONMENT = dict(os.environ)
"""Taken once: commands run at the same time, and pytest changes the real one between tests."""


class Outcome(NamedTuple):
    status: int
    output: str
    files: set[str]
    """What is in the folder afterwards."""


def prepare(folder: Path, line: str) -> None:
    """Fill a folder for one line of a page."""
    for name, command in PROGRAMS.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        engine = "engine_adapter.py" in line
        does = f'"{sys.executable}" "{folder / "engine.py"}"' if engine else command
        path.write_text(f"#!/bin/sh\nexec {does}\n")
        path.chmod(0o755)
    for name, source in (PYTHON_PROGRAMS | {"known.toml": ""}).items():
        (folder / name).write_text(source, "utf-8")
    (folder / "sessions").mkdir()
    for source, name in (
        (GUIDES / "engine_adapter.py", "engine_adapter.py"),
        (RECORDING, "session.jsonl"),
        (RECORDING, "sessions/session.jsonl"),
        (DATA / "captures" / "pair.pcap", "session.pcap"),
    ):
        shutil.copy(source, folder / name)
    shutil.copytree(GUIDES, folder / "conformance" / "guides")
    for name in re.findall(r"[\w/-]+/[A-Z]{3}-\d+-\w+\.json", line):
        write_script(folder / name)


def write_script(path: Path) -> None:
    """The script of a failure, with the first case of the check that its name tells."""
    path.parent.mkdir(parents=True, exist_ok=True)
    requirement, _, check = path.stem.rpartition("-")
    named = requirement, f"check_{check}"
    sides: list[Any] = ["client", "server"]
    side = next(
        side for side in sides if named in [(it.requirement, it.name) for it in checks_of(side)]
    )
    save(Script(side, *named, False, ((Case(False, 0),),)), path)


def run(folder: Path, line: str, beside: str = "", until: str = "") -> Outcome:
    """Run a line in the folder as a shell does, word for word but for the ports.

    Args:
        beside: "client" or "server", to have one that belongs to the line run at the same time.
        until: for what does not end by itself: a text of its output, or a file, after which it is
            interrupted.
    """
    ports = {name: str(free_port()) for name in ("6001", "6000", "7001", "7000")}
    line = re.sub(r"\b(6001|6000|7001|7000)\b", lambda found: ports[found[0]], line)
    found = [str(folder / "bin"), str(Path(sys.executable).parent), ENVIRONMENT["PATH"]]
    programs = {"PATH": os.pathsep.join(found), "PYTHONUNBUFFERED": "1"}

    def at(number: str) -> dict[str, str]:
        return programs | {
            "SPLATBUS_IPC_PORT": ports[f"{number}001"],
            "SPLATBUS_MSG_PORT": ports[f"{number}000"],
        }

    with contextlib.ExitStack() as stack:
        if beside == "server":
            stack.enter_context(started(SERVER, folder, at("6"), "server.txt"))
            eventually(lambda: "ready" in (folder / "server.txt").read_text("utf-8"), LIMIT_SECONDS)
        if beside == "client" or " proxy " in line:
            through = at("7" if " proxy " in line else "6")
            stack.enter_context(started(CLIENT, folder, through, "client.txt"))
        alone = programs if "--connect" in line else at("6")
        process = stack.enter_context(started(line, folder, alone, "output.txt"))

        def over() -> bool:
            said = (folder / "output.txt").read_text("utf-8")
            done = until and (until in said or (folder / until).exists())
            if done and process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
                with contextlib.suppress(subprocess.TimeoutExpired):  # busy, or still starting
                    process.wait(10)
            return process.poll() is not None

        assert eventually(over, LIMIT_SECONDS), (folder / "output.txt").read_text("utf-8")
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*")}
    return Outcome(process.returncode, (folder / "output.txt").read_text("utf-8"), files)


@contextlib.contextmanager
def started(
    line: str, folder: Path, added: dict[str, str], log: str
) -> Iterator["subprocess.Popen[bytes]"]:
    """A line that bash runs, and what it leaves in the background; what it says goes to a file."""
    with (folder / log).open("wb") as output:
        process = subprocess.Popen(
            ["bash", "-c", line],
            cwd=folder,
            env=ENVIRONMENT | added,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.wait(LIMIT_SECONDS)


def answers_of(
    engine: list[str], folder: Path, *commands: dict[str, Any]
) -> tuple[dict[str, Any], list[dict[str, Any]], str]:
    """How an engine with an adapter in it greets, what it answers to commands, and what it prints
    until it has ended well.
    """
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(60)
        port = str(listener.getsockname()[1])
        environment = {**os.environ, "SPLATBUS_ADAPTER_PORT": port}
        process = subprocess.Popen(
            engine, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True
        )
        harness = listener.accept()[0]
    harness.settimeout(60)
    with harness, harness.makefile("rw", encoding="utf-8") as lines:
        greeting, answers = json.loads(lines.readline()), []
        for number, command in enumerate(commands, 1):
            print(json.dumps({"id": number, **command}), file=lines, flush=True)
            answers.append(json.loads(lines.readline()))
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    return greeting, answers, output
