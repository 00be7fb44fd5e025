"""The program under test: launched by the harness, or started by hand while the harness waits."""

import contextlib
import math
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

from splatbus_conformance import guard
from splatbus_conformance.guard import Kind, uninterrupted
from splatbus_conformance.plan import NoVerdict, Usage
from splatbus_conformance.trials.testee import diagnostics
from splatbus_conformance.wire.recording import WORDS, Channel
from splatbus_conformance.wire.secrets import NAMED, TOKEN_VARIABLE, hidden, own_token

Say = Callable[[str], None]

STOP_SECONDS = 5.0
MOST_STARTS = 4
"""How often somebody is asked to start a client by hand that never comes back by itself."""
LEAVING_SECONDS = 1.0
MOST_PRINTED = 8000
"""Bytes that are read of what a testee printed: of one that prints all the time, its last."""
WINDOWS_CRASH = 0xC0000000


class Ended(NamedTuple):
    """How a process ended."""

    status: int
    crashed: bool
    """By a signal, an abort, or an unhandled exception of the system."""

    def __str__(self) -> str:
        if self.status < 0:
            with contextlib.suppress(ValueError):
                return f"was ended by {signal.Signals(-self.status).name}"
        return f"ended with status {self.status}"


class Testee(Protocol):
    """What the harness can do with a program under test."""

    name: str
    expendable: bool
    """It may be crashed: the harness can start another."""

    @property
    def started(self) -> float:
        """When the harness started it last, by the monotonic clock; 0 where it did not."""

    @property
    def argv(self) -> Sequence[str]:
        """The command that starts it; none where somebody else does."""

    @property
    def lives(self) -> Sequence[tuple[float, float]]:
        """When each process that the harness started for it began, and when at the latest it had
        ended, by the monotonic clock; infinity for one that runs.
        """

    @property
    def group(self) -> int | None:
        """The group of processes that the harness started for it, where there are such groups."""

    def ensure_running(self) -> bool:
        """Start it if it does not run; True if it was started now.

        Raises NoVerdict if it cannot be started.
        """

    def ended(self) -> Ended | None:
        """How it ended, or None while it runs or where that cannot be known."""

    def stop(self) -> Ended | None:
        """End it in an orderly way, by force after a time; how it ended."""

    def output(self) -> str:
        """The last lines that it printed."""

    def missed(self, channel: Channel) -> None:
        """A check has waited for a connection on this channel for a while."""

    def asked_to_start(self, what_for: str) -> bool:
        """Ask whoever starts it to do so again, and say for what; False once that was often."""

    def close(self) -> None:
        """End it, and give back what it took."""


class Command:
    """The command that starts a testee, and what the testee prints.

    Raises Usage if the command line cannot be taken apart.
    """

    def __init__(self, line: str, environment: Mapping[str, str]) -> None:
        try:
            self.argv = shlex.split(line, posix=os.name == "posix")
        except ValueError as error:
            raise Usage(diagnostics.bad_quotes(line, error)) from None
        self._environment = {**os.environ, **environment}
        token = own_token()
        if NAMED in line and not token:
            raise Usage(f"{line!r} names a token that is to come from {TOKEN_VARIABLE}: set that")
        # Windows splits command lines itself, and by rules of its own.
        words = self.argv if os.name == "posix" else [line]
        told = [word.replace(NAMED, token) for word in words]
        self._line = told if os.name == "posix" else told[0]
        with uninterrupted():
            file, name = tempfile.mkstemp(prefix="splatbus-testee-", suffix=".log")
            guard.watch(Kind.PATH, name)
        os.close(file)
        self._log = Path(name)

    def start(
        self, added: Mapping[str, str], stdin: int, stdout: int | None = None
    ) -> subprocess.Popen[bytes]:
        """Start it with these variables added; what it prints is kept, but for a stdout of its own.

        It ends with the harness, where `end` has not ended it. Raises NoVerdict if it cannot be
        started.
        """
        with self._log.open("ab") as log, uninterrupted():
            try:
                process = subprocess.Popen(
                    self._line,
                    env={**self._environment, **added},
                    stdin=stdin,
                    stdout=log if stdout is None else stdout,
                    stderr=log,
                    **GROUPED,
                )
                guard.watch(Kind.GROUP, process.pid)
                return process
            except OSError as error:
                program = self.argv[0] if self.argv else ""
                raise NoVerdict(
                    diagnostics.not_started(self.argv, error, _file(program), Path.cwd())
                ) from error

    def printed(self) -> str:
        """The end of what it printed."""
        with self._log.open("rb") as log:
            log.seek(max(0, self._log.stat().st_size - MOST_PRINTED))
            return log.read(MOST_PRINTED).decode("utf-8", "replace")[-2000:]

    def forget(self) -> None:
        """Remove what it printed."""
        self._log.unlink(missing_ok=True)
        guard.forget(Kind.PATH, self._log)


def end(process: subprocess.Popen[bytes], kindly: float = STOP_SECONDS) -> None:
    """Ask a process to end, make it end where it does not, and with it all that it has started.

    A shell, `npm start` or a launcher would else leave behind the client that it started, which
    would go on connecting, in this run and in the next.
    """
    if process.poll() is None:
        _signal(process, process.terminate, signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(kindly)
            _let_others_leave(process)
    _signal(process, process.kill, FORCE)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(STOP_SECONDS)
        guard.forget(Kind.GROUP, process.pid)


def _forget_if_gone(process: subprocess.Popen[bytes]) -> None:
    """Of one that has ended, and nothing of its group is left: another may come to its number."""
    if sys.platform != "win32":
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            guard.forget(Kind.GROUP, process.pid)


def _let_others_leave(process: subprocess.Popen[bytes]) -> None:
    """What it had started may be clearing up behind it, and a check looks at what was cleared."""
    deadline = time.monotonic() + LEAVING_SECONDS
    if sys.platform == "win32":
        return
    with contextlib.suppress(ProcessLookupError, PermissionError):
        while time.monotonic() < deadline:
            os.killpg(process.pid, 0)  # raises once none is left
            time.sleep(0.01)


GROUPED: dict[str, Any] = {"process_group": 0} if os.name == "posix" else {}
"""A testee and what it starts are a group of processes of its own."""
if sys.platform == "win32":
    FORCE = signal.SIGTERM
else:
    FORCE = signal.SIGKILL


def _signal(
    process: subprocess.Popen[bytes], alone: Callable[[], None], number: signal.Signals
) -> None:
    if sys.platform == "win32":
        alone()
        return
    with contextlib.suppress(ProcessLookupError, PermissionError):  # none is left of the group
        os.killpg(process.pid, number)


def _file(program: str) -> diagnostics.File:
    """What is where a command says that its program is."""
    path = Path(program)
    if not program or os.sep not in program:
        return diagnostics.File(bool(shutil.which(program)), here=bool(program) and path.is_file())
    first = b""
    with contextlib.suppress(OSError), path.open("rb") as file:
        first = file.readline(200)
    return diagnostics.File(path.exists(), path.is_dir(), first.decode("utf-8", "replace").rstrip())


class Started:
    """A testee that the harness starts, again for each scenario that left none alive.

    Attributes:
        crashed_from: the least status that tells of a crash, besides signals.
    """

    expendable = True
    crashed_from: float = WINDOWS_CRASH if os.name == "nt" else math.inf

    def __init__(self, command: str, environment: Mapping[str, str]) -> None:
        self.name = hidden(command)
        self._command = Command(command, environment)
        self.argv = self._command.argv
        self._starts: list[float] = []
        self._process: subprocess.Popen[bytes] | None = None

    def ensure_running(self) -> bool:
        """Start it if it does not run. Raises NoVerdict if the command cannot be started."""
        if self._process is not None:
            if self._process.poll() is None:
                return False
            _forget_if_gone(self._process)
        self._start()
        return True

    def _start(self) -> None:
        raise NotImplementedError

    def _begin(self, added: Mapping[str, str], *pipes: int) -> subprocess.Popen[bytes]:
        """Start a process, as `Command` has it."""
        self._starts.append(time.monotonic())
        self._process = self._command.start(added, *pipes)
        return self._process

    @property
    def group(self) -> int | None:
        """Its processes, while it runs."""
        return self._process.pid if self._process and os.name == "posix" else None

    @property
    def started(self) -> float:
        """The last of its starts."""
        return self._starts[-1] if self._starts else 0.0

    @property
    def lives(self) -> Sequence[tuple[float, float]]:
        """Of all its processes, which followed each other."""
        alive = self._process is not None and self._process.poll() is None
        ends = *self._starts[1:], math.inf if alive else time.monotonic()
        return list(zip(self._starts, ends, strict=False))

    def ended(self) -> Ended | None:
        """How it ended, or None while it runs."""
        status = self._process.poll() if self._process else None
        if status is None:
            return None
        return Ended(status, crashed=status < 0 or status >= self.crashed_from)

    def stop(self) -> Ended | None:
        """Ask it to end, then make it."""
        if self._process is None:
            return None
        end(self._process)
        ended = self.ended()
        self._process = None
        return ended

    def output(self) -> str:
        """The end of what it printed."""
        return self._command.printed()

    def missed(self, channel: Channel) -> None:
        """It is started anew, so there is nothing to say."""

    def asked_to_start(self, what_for: str) -> bool:
        """The harness starts it by itself."""
        return True

    def close(self) -> None:
        """End it, and forget what it printed."""
        self.stop()
        self._command.forget()


class Launched(Started):
    """One that is started by a command alone."""

    _added: Mapping[str, str] = MappingProxyType({})

    def _start(self) -> None:
        self._begin(self._added, subprocess.DEVNULL)

    def add_to_environment(self, added: Mapping[str, str]) -> None:
        """End it; from now on it is started with these variables beside the usual ones."""
        self.stop()
        self._added = added


class Awaited:
    """A testee that somebody else starts; the harness only sees its connections."""

    expendable = False
    started = 0.0
    lives: Sequence[tuple[float, float]] = ()
    argv: Sequence[str] = ()
    group = None

    def __init__(self, name: str, say: Say = lambda text: None) -> None:
        self.name = name
        self._say = say
        self._starts = 1
        """How often somebody has started it, or was asked to."""

    def ensure_running(self) -> bool:
        """Nothing to do."""
        return False

    def ended(self) -> Ended | None:
        """Not known."""
        return None

    def stop(self) -> Ended | None:
        """Nothing to do."""
        return None

    def output(self) -> str:
        """Nothing."""
        return ""

    def missed(self, channel: Channel) -> None:
        """Whoever started it may have to start it again, and may not have been asked to."""
        if self._starts > 1:
            return
        self._say(
            f"Waiting for the client to connect to the {WORDS[channel]} channel again: if it has "
            "stopped, start it anew (in an engine: press Play)."
        )

    def asked_to_start(self, what_for: str) -> bool:
        """Ask for it, but for no more than anybody likes to do."""
        if self._starts == MOST_STARTS:
            return False
        self._starts += 1
        self._say(
            f"Start {self._starts} of {MOST_STARTS}: stop your client if it still runs, and start "
            f"it again (in an engine: press Play). It is for {what_for} {self._what_follows()}"
        )
        return True

    def _what_follows(self) -> str:
        left = MOST_STARTS - self._starts
        if not left:
            return "It is the last: what takes another is left out, and the verdict follows."
        return f"Then {'comes another' if left == 1 else f'come {left} more'} at most."

    def close(self) -> None:
        """Nothing to do."""


def not_met(testee: Testee, side: str, where: str, host: str, patience: float) -> NoVerdict:
    """Why there is nothing to judge; members as in `mistakes.Absent`."""
    ended = testee.ended()
    status = ended.status if ended else None
    return NoVerdict(
        diagnostics.absent(
            diagnostics.Absent(
                *(side, where, host, patience, testee.argv, str(ended or ""), status),
                testee.output(),
            )
        )
    )
