"""Specimens as processes, started quickly: each is forked from one that was altered before.

The zoo starts some two thousand, and to import what they are made of takes longer than most of
them run. The first of a harness imports and alters; it is forked before the harness has sockets,
memory or threads, so that those that are forked from it have nothing but what is theirs.
"""

import contextlib
import gc
import json
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO, Any, NoReturn, cast
from unittest import mock

from tests.zoo import mutants
from tests.zoo.processes.program import Program, altered
from tests.zoo.registry import specimen_named

POSSIBLE = sys.platform == "linux"
"""Elsewhere there is no fork, or libraries of the system do not stand it."""
COMMAND = [sys.executable, "-m", mutants.__name__]
LONGEST_REQUEST = 1 << 20
LOST = -signal.SIGKILL if POSSIBLE else 1
FORK: Any = multiprocessing.get_context("fork") if POSSIBLE else None


@dataclass(frozen=True)
class Request:
    """What the harness asks of the first: another one."""

    words: list[str]
    """Its name and its arguments."""
    environment: dict[str, str]
    group: bool
    """It leads a group of processes of its own."""


class Started:
    """A specimen that runs, with what the harness uses of `subprocess.Popen`."""

    def __init__(self, keeper: Connection, stdin: int | None, stdout: int | None) -> None:
        self._keeper = keeper
        self.pid: int = keeper.recv()
        self.returncode: int | None = None
        self.stdin: IO[bytes] | None = None if stdin is None else os.fdopen(stdin, "wb")
        self.stdout: IO[bytes] | None = None if stdout is None else os.fdopen(stdout, "rb")

    def poll(self) -> int | None:
        """Its exit status, negative after a signal, or None while it runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.wait(0.0)
        return None

    def wait(self, timeout: float | None = None) -> int:
        """Its exit status, once it has ended. Raises subprocess.TimeoutExpired."""
        if self.returncode is None:
            if not self._keeper.poll(timeout):
                raise subprocess.TimeoutExpired(COMMAND, timeout or 0.0)
            try:
                self.returncode = self._keeper.recv()
            except EOFError:
                self.returncode = LOST
            self._keeper.close()
        return self.returncode

    def terminate(self) -> None:
        """Ask it to end."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self._signal(signal.SIGKILL)

    def _signal(self, number: int) -> None:
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)


@contextlib.contextmanager
def forking_specimens() -> Iterator[None]:
    """While this lasts, what this process starts is forked where it is a specimen."""
    if not POSSIBLE:
        yield
        return
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    if os.fork() == 0:
        here.close()
        _first(there)
    there.close()
    original: Any = subprocess.Popen

    def popen(line: Any, *arguments: Any, **named: Any) -> Any:
        if list(line[: len(COMMAND)]) == COMMAND and not _linked_otherwise(named["env"]):
            return _started(here, line[len(COMMAND) :], **named)
        return original(line, *arguments, **named)

    with here, mock.patch.object(subprocess, "Popen", popen):
        yield


def _linked_otherwise(environment: dict[str, str]) -> bool:
    """Other libraries are asked for than this process has; only a new program looks for them."""
    return any(
        name.startswith("LD_") and os.environ.get(name) != value
        for name, value in environment.items()
    )


def _started(
    first: socket.socket,
    words: list[str],
    *,
    env: dict[str, str],
    stdin: int,
    stdout: int | IO[bytes],
    stderr: IO[bytes],
    process_group: int | None = None,
) -> Started:
    ours: list[int | None] = []
    theirs: list[int] = []
    for given, end in ((stdin, 0), (stdout, 1), (stderr, 1)):
        if given == subprocess.PIPE:
            pipe = os.pipe()
            ours.append(pipe[1 - end])
            theirs.append(pipe[end])
        else:
            ours.append(None)
            null = given == subprocess.DEVNULL
            file = cast(IO[bytes], given)
            theirs.append(os.open(os.devnull, os.O_RDWR) if null else os.dup(file.fileno()))
    keeper, told = multiprocessing.Pipe(duplex=False)
    request = Request(words, env, group=process_group == 0)
    socket.send_fds(first, [json.dumps(asdict(request)).encode()], [*theirs, told.fileno()])
    told.close()
    for each in theirs:
        os.close(each)
    return Started(keeper, ours[0], ours[1])


def _first(harness: socket.socket) -> None:
    """Be the process that the others are forked from, until the harness ends."""
    _close_all_but(0, 1, 2, harness.fileno())
    tracker: Any = resource_tracker._resource_tracker
    tracker._fd = tracker._pid = None  # the harness's, whose pipe is closed here
    gc.freeze()  # what refers to files that were closed must not close their numbers again
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for keepers
    first: First | None = None
    while True:
        text, files, *_ = socket.recv_fds(harness, LONGEST_REQUEST, 4)
        if not text:
            os._exit(0)
        request = Request(**json.loads(text))
        first = first or First(request)
        if os.fork() == 0:
            _keep(first, request, files)
        for each in files:
            os.close(each)


class First:
    """A specimen that is altered, and has not begun yet."""

    def __init__(self, request: Request) -> None:
        _change_environment(request.environment)
        self.program: Program | None = None
        with contextlib.suppress(Exception):  # it will be seen where a specimen is run
            self.program = _altered(request)
        given = request.environment
        self.changed = {name: it for name, it in os.environ.items() if given.get(name) != it}


def _keep(first: First, request: Request, files: list[int]) -> NoReturn:
    """Run a specimen as a child, and tell its process and its status."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    told = Connection(files.pop(), readable=False)
    process = FORK.Process(target=_run, args=(first, request, files))
    process.start()
    if request.group:
        os.setpgid(process.ident, process.ident)
    told.send(process.ident)
    process.join()
    told.send(process.exitcode)
    os._exit(0)


def _run(first: First, request: Request, files: list[int]) -> int:
    for number, file in enumerate(files):
        os.dup2(file, number)
    _close_all_but(0, 1, 2)
    sys.stdin, sys.stdout = os.fdopen(0, closefd=False), os.fdopen(1, "w", closefd=False)
    sys.stderr = os.fdopen(2, "w", errors="backslashreplace", buffering=1, closefd=False)
    sys.argv = [__name__, *request.words]
    _change_environment(request.environment | first.changed)
    sys.exit((first.program or _altered(request))(request.words[1:]))


def _altered(request: Request) -> Program:
    specimen = specimen_named(request.words[0])
    assert specimen is not None, f"there is no specimen {request.words[0]}"
    return altered(specimen)


def _change_environment(wanted: dict[str, str]) -> None:
    os.environ.clear()
    os.environ.update(wanted)


def _close_all_but(*kept: int) -> None:
    for file in [int(entry.name) for entry in Path("/proc/self/fd").iterdir()]:
        if file not in kept:
            with contextlib.suppress(OSError):  # the listing itself was one
                os.close(file)
