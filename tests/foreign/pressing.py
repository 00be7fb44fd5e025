"""The person in front of an engine, who presses Play when the harness asks for it."""

import os
import re
import shlex
import subprocess
import threading
from pathlib import Path

from splatbus_conformance.wire.ports import free_port

ASKS = re.compile(r"\bpress Play\b")
"""What a line of the harness says when it wants the client started, or started again."""


def pressed(words: list[str], start: str, scratch: Path, seconds: float) -> tuple[str, int]:
    """What a run of the harness with `--wait` prints, and how often Play was pressed in it.

    Only one client runs at a time: to press Play again is to stop it first.
    """
    ipc, message = free_port(), free_port()
    environment = {
        **os.environ,
        "SPLATBUS_IPC_PORT": str(ipc),
        "SPLATBUS_MSG_PORT": str(message),
        "SPLATBUS_HOST": "127.0.0.1",
    }
    harness = subprocess.Popen(
        [*words, "--ports", f"{ipc},{message}"],
        cwd=scratch,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    printed: list[str] = []
    presses = 0
    engine: subprocess.Popen[bytes] | None = None
    timer = threading.Timer(seconds, harness.kill)
    timer.start()
    try:
        assert harness.stdout
        for line in harness.stdout:
            printed.append(line)
            if ASKS.search(line):
                _stop(engine)
                presses += 1
                engine = subprocess.Popen(shlex.split(start), cwd=scratch, env=environment)
    finally:
        timer.cancel()
        harness.kill()
        harness.wait()
        if harness.stdout:
            harness.stdout.close()
        _stop(engine)
    return "".join(printed), presses


def _stop(engine: subprocess.Popen[bytes] | None) -> None:
    if engine is not None:
        engine.terminate()
        engine.wait()
