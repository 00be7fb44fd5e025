"""A process that ends together with all that it has started.

Between it and whoever wants it stands a keeper, to which orphans come (`PR_SET_CHILD_SUBREAPER`):
what is still there a while after the process has ended was left behind, is told, and killed. So is
all of it when whoever wanted it ends, in whichever way.
"""

import contextlib
import ctypes
import os
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import NoReturn

PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36
LEAVING_SECONDS = 15.0
"""What ends because its parent has may take so long to see that, on a machine with much to do."""
LOOK_SECONDS = 0.02
CLEARS_UP = "splatbus_conformance/guard.py"
"""In the command line of what ends once a harness has."""


@dataclass(frozen=True)
class Fate:
    """How a process has ended."""

    status: int
    """As `os.waitstatus_to_exitcode` has it."""
    cpu_seconds: float
    """Of itself and all that it has started."""
    left: tuple[str, ...]
    """The command lines of what it left behind."""


class Kept:
    """A process with its keeper, from the side of whoever wants it."""

    def __init__(self, work: Callable[[Connection], None]) -> None:
        """Start it: `work` runs there, and may send messages that are read from `said`."""
        self.said, theirs = Pipe(duplex=False)
        self.fate, told = Pipe(duplex=False)
        self.pid = os.fork()
        """Of the keeper."""
        if not self.pid:
            self.said.close()
            self.fate.close()
            _keep(work, theirs, told)
        theirs.close()
        told.close()


def end(*kept: Kept) -> None:
    """Reap the keepers; end those that have not ended, and all that they keep."""
    for each in kept:
        with contextlib.suppress(ProcessLookupError):
            os.kill(each.pid, signal.SIGTERM)
    for each in kept:
        os.waitpid(each.pid, 0)
        each.said.close()
        each.fate.close()


def segments() -> set[Path]:
    """The shared memory of programs that speak SplatBus; a folder is a stand-in's, which its run
    removes.
    """
    return {path for path in Path("/dev/shm").glob("splatbus*") if path.is_file()}


def abandoned(before: set[Path]) -> dict[Path, float]:
    """What came since and no process holds, for what a program beside this run has is its own; and
    when it was made.
    """
    from splatbus_conformance.trials.testee.os_evidence import holders  # may not be installed

    found: dict[Path, float] = {}
    for path in sorted(segments() - before):
        with contextlib.suppress(FileNotFoundError):  # whoever has just ended has taken it away
            if not holders(path.name):
                found[path] = path.stat().st_mtime
    return found


def _keep(work: Callable[[Connection], None], said: Connection, told: Connection) -> NoReturn:
    libc = ctypes.CDLL(None)
    libc.prctl(PR_SET_CHILD_SUBREAPER, 1)
    libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it comes to whoever wanted this, who ends it
    signal.signal(signal.SIGTERM, _end_all)
    os.setsid()
    worker = os.fork()
    if not worker:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.default_int_handler)
        told.close()
        try:
            work(said)
        except KeyboardInterrupt:
            os._exit(130)
        except BaseException:  # it must not go on as whoever wanted it
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    said.close()
    _, status, used = os.wait4(worker, 0)
    seconds = used.ru_utime + used.ru_stime
    deadline = time.monotonic() + LEAVING_SECONDS
    with contextlib.suppress(ChildProcessError):  # nothing is left
        while time.monotonic() < deadline:
            pid, _, used = os.wait4(-1, os.WNOHANG)
            seconds += used.ru_utime + used.ru_stime
            if not pid:
                time.sleep(LOOK_SECONDS)
    left = tuple(_command(pid) for pid in _descendants())
    told.send(Fate(os.waitstatus_to_exitcode(status), seconds, left))
    _end_all()


def _end_all(*_: object) -> NoReturn:
    """Ask them, then make them; those that clear up behind others come last."""
    began = time.monotonic()
    _send(signal.SIGTERM)
    with contextlib.suppress(ChildProcessError):
        while True:
            late = time.monotonic() - began
            if late > 2 * LEAVING_SECONDS:
                _send(signal.SIGKILL)
            elif late > LEAVING_SECONDS:
                _send(signal.SIGKILL, spared=CLEARS_UP)
            if os.waitpid(-1, os.WNOHANG) == (0, 0):
                time.sleep(LOOK_SECONDS)
    os._exit(0)


def _send(number: int, spared: str = "") -> None:
    for pid in _descendants():
        if not (spared and spared in _command(pid)):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)


def _descendants() -> list[int]:
    """All processes that come of this one, and have not ended."""
    parents = dict(_parents())
    found = {os.getpid()}
    while further := {pid for pid, parent in parents.items() if parent in found} - found:
        found |= further
    return sorted(found - {os.getpid()})


def _parents() -> Iterator[tuple[int, int]]:
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                state, parent, *_ = (entry / "stat").read_text().rpartition(")")[2].split()
                if state != "Z":
                    yield int(entry.name), int(parent)


def _command(pid: int) -> str:
    with contextlib.suppress(OSError):
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        return f"{pid} {b' '.join(words).decode('utf-8', 'replace').strip()}"
    return str(pid)
