"""Nothing is left behind, in whichever way the harness ends: by itself, interrupted, or killed.

What would outlive it is told to a process beside it, which does nothing but wait for its end, and
then ends and removes what was not given back. It runs this file, and imports nothing that takes
time. Where there are no groups of processes, there is none.
"""

import contextlib
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path

ENDING = [getattr(signal, it) for it in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, it)]
"""What asks a process to end."""
KINDLY_SECONDS = 5.0
"""For which a testee may clear up once it was asked to end."""


class Kind(StrEnum):
    """What is watched."""

    GROUP = "group"
    """A group of processes."""
    PROCESS = "process"
    PATH = "path"
    """A file, or a folder with all that is in it."""


_told: tuple[int, int] = (0, 0)
"""The process that has a guard, and the pipe to it; what was forked has none yet."""


def watch(kind: Kind, what: object) -> None:
    """Have this end with this process."""
    _tell(f"+{kind} {what}")


def forget(kind: Kind, what: object) -> None:
    """It has ended, or was removed."""
    _tell(f"-{kind} {what}")


def folder(prefix: str, parent: Path | None = None) -> Path:
    """A new folder, in that for temporary files if in no other."""
    with uninterrupted():
        made = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
        watch(Kind.PATH, made)
    return made


def remove(folder: Path) -> None:
    """One that is needed no more, with all that is in it."""
    shutil.rmtree(folder, ignore_errors=True)
    forget(Kind.PATH, folder)


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Finish what is begun here before an interrupt is heeded, which then is."""
    late: list[int] = []
    former = {}
    with contextlib.suppress(ValueError):  # a thread, which nothing interrupts
        for number in ENDING:
            former[number] = signal.signal(number, lambda it, frame: late.append(it))
    try:
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
        for number in late:
            signal.raise_signal(number)


def _tell(line: str) -> None:
    global _told
    if sys.platform == "win32":
        return
    if _told[0] != os.getpid():
        _told = os.getpid(), _start()
    with contextlib.suppress(BrokenPipeError):  # somebody has ended it
        os.write(_told[1], f"{line}\n".encode())


def _start() -> int:
    if sys.platform == "win32":
        raise OSError("there are no groups of processes")
    read, write = os.pipe()
    null = (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)
    silent = [(os.POSIX_SPAWN_DUP2, read, 0), null, (os.POSIX_SPAWN_DUP2, 1, 2)]
    line = [sys.executable, "-I", "-S", __file__]
    os.posix_spawn(sys.executable, line, os.environ, file_actions=silent, setpgroup=0)
    os.close(read)
    return write


def _wait() -> None:
    """Be the guard."""
    if sys.platform == "win32":
        return
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    kept = dict[str, None]()
    for line in map(str.strip, sys.stdin):
        if line[0] == "+":
            kept[line[1:]] = None
        else:
            kept.pop(line[1:], None)
    left = [(kind, what) for kind, _, what in (it.partition(" ") for it in kept)]
    running = [(kind, int(what)) for kind, what in left if kind != Kind.PATH]
    deadline = time.monotonic() + KINDLY_SECONDS
    running = [it for it in running if _is_there(*it, signal.SIGTERM)]
    while running and time.monotonic() < deadline:
        time.sleep(0.02)
        running = [it for it in running if _is_there(*it, 0)]
    for it in running:
        _is_there(*it, signal.SIGKILL)
    for path in (Path(what) for kind, what in left if kind == Kind.PATH):
        shutil.rmtree(path, ignore_errors=True)
        with contextlib.suppress(OSError):
            path.unlink()


def _is_there(kind: str, pid: int, number: int) -> bool:
    """Send a signal, or none by 0; whether somebody was there to take it."""
    if sys.platform == "win32":
        return False
    send = os.killpg if kind == Kind.GROUP else os.kill
    with contextlib.suppress(ProcessLookupError, PermissionError):
        send(pid, number)
        return True
    return False


if __name__ == "__main__":
    _wait()
