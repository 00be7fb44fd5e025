"""Harnesses as processes, started quickly: each is forked from one that has imported everything.

So may be whatever else needs much of that.
"""

import contextlib
import multiprocessing
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from pathlib import Path

STOP_SECONDS = 15.0
LOOK_SECONDS = 5.0
PRELOADED = [
    "splatbus_conformance.preload",
    "tests.zoo.processes.fork_server",
]
"""What each harness is forked with; whoever wants more adds it before the first."""

_running: set[BaseProcess] = set()
_starting = threading.Lock()
_context = multiprocessing.get_context(
    "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
)


def judge(line: list[str]) -> int:
    """Run `splatbus-conformance` with this command line; its exit status."""
    from splatbus_conformance.cli.main import main

    from tests.zoo.processes.fork_server import forking_specimens

    with forking_specimens():
        return main(line)


def run(
    line: list[str],
    seconds: float,
    environment: dict[str, str],
    main: Callable[[list[str]], int] = judge,
) -> tuple[int | None, str]:
    """Run a harness, or another program, with this command line, and these variables besides those
    of this process as they are now; its exit status, and what it printed.

    The status is None if it had to be ended, for it had printed nothing for so many seconds; then
    the text says so.
    """
    with tempfile.TemporaryDirectory(prefix="splatbus-harness-") as folder:
        output = Path(folder, "output.txt")
        with _starting:
            # NumPy starts twice as fast without threads that no specimen needs.
            os.environ["OPENBLAS_NUM_THREADS"] = "1"
            given = (line, str(output), {**os.environ, **environment}, main)
            process = _context.Process(target=_apart, args=given)  # type: ignore[attr-defined]
            if isinstance(_context, ForkServerContext):
                _context.set_forkserver_preload(PRELOADED)
            process.start()
        _running.add(process)
        try:
            if _comes_to_an_end(process, output, seconds):
                return process.exitcode, output.read_text("utf-8", "replace")
            _end(process)
            return None, f"it said nothing for {seconds:g} s, and had not come to an end"
        finally:
            _running.discard(process)


def _comes_to_an_end(process: BaseProcess, output: Path, seconds: float) -> bool:
    """Whether it does: False once it has printed nothing for so long. What prints goes on, however
    slowly a busy machine lets it.
    """
    printed, since = 0, time.monotonic()
    while process.is_alive():
        process.join(min(seconds, LOOK_SECONDS))
        size = output.stat().st_size if output.exists() else 0
        if size > printed:
            printed, since = size, time.monotonic()
        elif time.monotonic() > since + seconds and process.is_alive():
            return False
    return True


def stop_all() -> None:
    """End every harness that runs now; whoever waits for one comes to an end too."""
    for process in list(_running):
        _end(process)


def _apart(
    line: list[str], output: str, environment: dict[str, str], main: Callable[[list[str]], int]
) -> None:
    """Runs in the process of its own, in a group of its own, so that it ends with its children.

    What it is forked from may have begun with other variables.
    """
    os.environ.clear()
    os.environ.update(environment)
    if os.name == "posix":
        os.setsid()
    sys.stdout.flush()
    file = os.open(output, os.O_WRONLY | os.O_CREAT, 0o600)
    for stream in (1, 2):
        os.dup2(file, stream)
    sys.exit(main(line))


def _end(process: BaseProcess) -> None:
    """Ask a harness to end, so that it ends its testee and removes its memory; then make it."""
    process.terminate()
    process.join(STOP_SECONDS)
    if os.name == "posix" and process.pid is not None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.join(STOP_SECONDS)
