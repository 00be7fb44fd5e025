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
from collections.abc import Callable
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from pathlib import Path

from splatbus_conformance.run import workers

STOP_SECONDS = 15.0
PRELOADED = [*workers.PRELOADED, "splatbus_conformance.selftest.processes.fork_server"]

_running: set[BaseProcess] = set()
_starting = threading.Lock()
_context = multiprocessing.get_context(
    "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
)


def judge(line: list[str]) -> int:
    """Run `splatbus-conformance` with this command line; its exit status."""
    from splatbus_conformance.cli.main import main
    from splatbus_conformance.selftest.processes.fork_server import forking_specimens

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

    The status is None if it had to be ended after so many seconds; then the text says so.
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
            process.join(seconds)
            if process.is_alive():
                _end(process)
                return None, f"it did not come to an end within {seconds:g} s"
            return process.exitcode, output.read_text("utf-8", "replace")
        finally:
            _running.discard(process)


def stop_all() -> None:
    """End every harness that runs now; whoever waits for one comes to an end too."""
    for process in list(_running):
        _end(process)


def _apart(
    line: list[str], output: str, environment: dict[str, str], main: Callable[[list[str]], int]
) -> None:
    """Runs in the process of its own, in a group of its own, so that it ends with its children.

    What it is forked from may have begun with other variables (`run.workers.prepare`).
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
