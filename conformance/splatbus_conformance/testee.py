"""The program under test: launched by the harness, or started by hand while the harness waits."""

import contextlib
import os
import shlex
import signal
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Protocol

from splatbus_conformance.plan import NoVerdict

STOP_SECONDS = 5.0
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


FIXED_PORTS = "if it knows only fixed ports, name them: --ports 6001,6000 (IPC, message)."


class Testee(Protocol):
    """What the harness can do with a program under test."""

    name: str
    expendable: bool
    """It may be crashed: the harness can start another."""

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

    def close(self) -> None:
        """End it, and give back what it took."""


def last_words(testee: Testee) -> str:
    """What a testee printed last, to go on after a sentence; nothing if it printed nothing."""
    output = testee.output().strip()
    return f"; the last that it printed:\n{output}" if output else ""


class Command:
    """The command that starts a testee, and what the testee prints."""

    def __init__(self, line: str, environment: Mapping[str, str]) -> None:
        # Windows splits command lines itself, and by rules of its own.
        self._line = shlex.split(line) if os.name == "posix" else line
        self._environment = {**os.environ, **environment}
        file, name = tempfile.mkstemp(prefix="splatbus-testee-", suffix=".log")
        os.close(file)
        self._log = Path(name)

    def start(
        self, added: Mapping[str, str], stdin: int, stdout: int | None = None
    ) -> subprocess.Popen[bytes]:
        """Start it with these variables added; what it prints is kept, but for a stdout of its own.

        Raises NoVerdict if it cannot be started.
        """
        with self._log.open("ab") as log:
            try:
                return subprocess.Popen(
                    self._line,
                    env={**self._environment, **added},
                    stdin=stdin,
                    stdout=log if stdout is None else stdout,
                    stderr=log,
                )
            except OSError as error:
                raise NoVerdict(f"cannot start the testee: {error}") from error

    def printed(self) -> str:
        """The end of what it printed."""
        return self._log.read_text("utf-8", errors="replace")[-2000:]

    def forget(self) -> None:
        """Remove what it printed."""
        self._log.unlink(missing_ok=True)


class Launched:
    """A testee that the harness starts, again for each scenario that left none alive."""

    expendable = True

    def __init__(self, command: str, environment: Mapping[str, str]) -> None:
        self.name = command
        self._command = Command(command, environment)
        self._added: Mapping[str, str] = {}
        self._process: subprocess.Popen[bytes] | None = None

    def ensure_running(self) -> bool:
        """Start it if it does not run. Raises NoVerdict if the command cannot be started."""
        if self._process is not None and self._process.poll() is None:
            return False
        self._process = self._command.start(self._added, subprocess.DEVNULL)
        return True

    def add_to_environment(self, added: Mapping[str, str]) -> None:
        """End it; from now on it is started with these variables beside the usual ones."""
        self.stop()
        self._added = added

    def ended(self) -> Ended | None:
        """How it ended, or None while it runs."""
        status = self._process.poll() if self._process else None
        if status is None:
            return None
        return Ended(status, crashed=status < 0 or (os.name == "nt" and status >= WINDOWS_CRASH))

    def stop(self) -> Ended | None:
        """Ask it to end, then make it."""
        if self._process is None:
            return None
        if self._process.poll() is None:
            self._process.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(STOP_SECONDS)
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait(STOP_SECONDS)
        ended = self.ended()
        self._process = None
        return ended

    def output(self) -> str:
        """The end of what it printed."""
        return self._command.printed()

    def close(self) -> None:
        """End it, and forget what it printed."""
        self.stop()
        self._command.forget()


class Awaited:
    """A testee that somebody else starts; the harness only sees its connections."""

    expendable = False

    def __init__(self, name: str = "the client that connects") -> None:
        self.name = name

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

    def close(self) -> None:
        """Nothing to do."""
