"""What other processes hold, where the system shows it: evidence of what never crosses the wire.

Only Linux shows it, and only of processes of one's own; elsewhere nothing is known.
"""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from splatbus_conformance.wire.json_reading import shorten

PROC = Path("/proc")


def holders(name: str) -> list[int]:
    """Other processes that have the shared memory `name` mapped or open, as far as is shown."""
    path = f"/dev/shm/{name}"
    return [pid for pid in _others() if _maps(pid, path) or path in _open_files(pid)]


def writers(name: str) -> list[int]:
    """Those of the holders that have it open for writing, or have mapped what they so opened; a
    mapping of their own (`p`) shows nobody what is written there.
    """
    path = f"/dev/shm/{name}"
    return [pid for pid in holders(name) if _may_write(pid, path) or _writes(pid, path)]


def owner(port: int, peer_port: int) -> int | None:
    """The process whose TCP connection goes from `port` to `peer_port`, 0 of one that listens, if
    that is shown.
    """
    if (fields := _connection(port, peer_port)) is None:
        return None
    pids, socket = (*_others(), os.getpid()), f"socket:[{fields[9]}]"
    return next((pid for pid in pids if socket in _open_files(pid)), None)


def group(pid: int) -> int | None:
    """The group of processes that a process is in, where there are groups and it is there."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            return os.getpgid(pid)
    return None


def members(group_: int) -> list[int]:
    """The processes of a group, as far as is shown."""
    return [pid for pid in _others() if group(pid) == group_]


def delays(pid: int | None) -> dict[int, float]:
    """How long each thread of a process, and of those that it has started, was ready to run while
    the processors were others', in seconds, by its id; nothing where that is not shown.
    """
    return {thread: waited for thread, _, waited in _scheduled(pid)}


def wanted_seconds(pid: int) -> float:
    """For how long a processor was wanted by the threads of a process, and of those that it has
    started: they had one, or waited for it; 0 where that is not shown.
    """
    return sum(ran + waited for _, ran, waited in _scheduled(pid))


def _scheduled(pid: int | None) -> Iterator[tuple[int, float, float]]:
    """Each thread: its id, and for how many seconds it has run, and has waited to run."""
    left = [] if pid is None else [str(pid)]
    while left:
        with contextlib.suppress(OSError):
            for task in (PROC / left.pop() / "task").iterdir():
                if len(told := _words(task / "schedstat")) > 1:
                    yield int(task.name), int(told[0]) / 1e9, int(told[1]) / 1e9
                left += _words(task / "children")


def _words(path: Path) -> list[str]:
    """Of a file of the system's; without a buffer, for it is asked for several times a second."""
    with contextlib.suppress(OSError), path.open("rb", buffering=0) as file:
        return file.readall().decode("ascii").split()
    return []


def listener(port: int) -> str:
    """Which process listens on a TCP port, if that is shown; else nothing."""
    pid = owner(port, 0)
    return f"process {pid} ({_command(pid)})" if pid else ""


def _command(pid: int) -> str:
    with contextlib.suppress(OSError):
        words = (PROC / str(pid) / "cmdline").read_bytes().decode("utf-8", "replace").split("\0")
        return shorten(" ".join(words).strip())
    return "?"


def _others() -> Iterator[int]:
    """The newest first: who is looked for was most often started last."""
    if PROC.is_dir():
        pids = [int(entry.name) for entry in PROC.iterdir() if entry.name.isdecimal()]
        yield from (pid for pid in sorted(pids, reverse=True) if pid != os.getpid())


def _maps(pid: int, path: str) -> bool:
    with contextlib.suppress(OSError):
        lines = (PROC / str(pid) / "maps").read_text("utf-8", "replace").splitlines()
        return any(line.removesuffix(" (deleted)").endswith(f" {path}") for line in lines)
    return False


def _may_write(pid: int, path: str) -> bool:
    """Whether a mapping is writable, or could be made so: `mw`, of a file opened for writing."""
    here = False
    with contextlib.suppress(OSError):
        for line in (PROC / str(pid) / "smaps").read_text("utf-8", "replace").splitlines():
            if not line.split(" ", 1)[0].endswith(":"):  # where the next mapping begins
                here = line.removesuffix(" (deleted)").endswith(f" {path}")
                here = here and line.split()[1].endswith("s")
                if here and "w" in line.split()[1]:
                    return True
            elif here and line.startswith("VmFlags:") and "mw" in line.split():
                return True
    return False


def _writes(pid: int, path: str) -> bool:
    for number, opened in _opened(pid):
        with contextlib.suppress(OSError):
            if opened == path:
                told = (PROC / str(pid) / "fdinfo" / number).read_text()
                flags = next(it for it in told.splitlines() if it.startswith("flags:"))
                if int(flags.split()[1], 8) & (os.O_WRONLY | os.O_RDWR):
                    return True
    return False


def _open_files(pid: int) -> set[str]:
    return {path for _, path in _opened(pid)}


def _opened(pid: int) -> Iterator[tuple[str, str]]:
    """The number of each open file, and its path."""
    with contextlib.suppress(OSError):
        for entry in (PROC / str(pid) / "fd").iterdir():
            with contextlib.suppress(OSError):
                yield entry.name, str(entry.readlink()).removesuffix(" (deleted)")


class Queues(NamedTuple):
    """Bytes that the system holds for one end of a connection."""

    unsent: int
    """Of what was sent: those that have not been acknowledged."""
    unread: int


def queues(port: int, peer_port: int) -> Queues | None:
    """What waits at the end of a TCP connection that has this port, if that is shown."""
    if (fields := _connection(port, peer_port)) is None:
        return None
    return Queues(*(int(each, 16) for each in fields[4].split(":")))


def _connection(port: int, peer_port: int) -> list[str] | None:
    """What the system says of it."""
    local, remote = f":{port:04X}", f":{peer_port:04X}"
    for table in ("tcp", "tcp6"):
        with contextlib.suppress(OSError):
            for line in (PROC / "net" / table).read_text().splitlines()[1:]:
                fields = line.split()
                if fields[1].endswith(local) and fields[2].endswith(remote):
                    return fields
    return None
