"""A client with an adapter beside it: the harness's side of conformance/ADAPTER.md.

While an answer is awaited the sockets are served, for the client may need the harness's own.
"""

import contextlib
import json
import math
import os
import queue
import subprocess
import threading
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from splatbus_conformance.data import read_json
from splatbus_conformance.plan import NoVerdict
from splatbus_conformance.trials.testee.process import (
    STOP_SECONDS,
    WINDOWS_CRASH,
    Ended,
    Started,
    end,
)
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Peer

if TYPE_CHECKING:  # slow to import, and used where there is an adapter
    from jsonschema_rs import Draft202012Validator

ANSWER_SECONDS = 10.0
GLANCE_SECONDS = 0.002
"""How often the sockets are looked at while an answer is awaited."""
LONGEST_LINE = 1 << 24
CRASHED = 128
"""Exit statuses above this one tell of a signal, as shells say it."""


class AdapterBroken(NoVerdict):
    """The adapter breaks its protocol; nothing can be said of the client beside it."""

    def __init__(self, what: str) -> None:
        super().__init__(f"the adapter is broken: {what}")


class Declined(AdapterBroken):
    """A command was answered by an error."""


class ClientCrashed(Exception):  # noqa: N818 - a finding, no error of ours
    """The client died, by a signal or an abort, while the adapter was asked for something."""


class Greeting(NamedTuple):
    """What an adapter says of itself in its first line."""

    client: str
    """Name and version."""
    axes: str
    units_per_metre: float
    single: bool
    """The engine holds poses in single precision."""
    can: frozenset[str]


class Adapted(Started):
    """A testee that the harness starts, and asks, through its adapter, with which it ends."""

    crashed_from = WINDOWS_CRASH if os.name == "nt" else CRASHED

    def __init__(
        self, command: str, environment: Mapping[str, str], peer: Peer, patience: float
    ) -> None:
        super().__init__(command, environment)
        self.greeting: Greeting | None = None
        """Of the adapter that was started last."""
        self._peer, self._patience = peer, patience
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._commands: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._last = 0
        self._mute = False
        """It broke off: nothing more is asked of it."""

    def _start(self) -> None:
        """With its client. Raises AdapterBroken besides."""
        self.open()
        with contextlib.suppress(ClientCrashed):  # `ended` says so
            self.ask("start")

    def open(self) -> Greeting:
        """Start the adapter, without its client, and read its first line.

        Raises AdapterBroken, and NoVerdict if the command cannot be started.
        """
        process = self._begin({}, subprocess.PIPE, subprocess.PIPE)
        self._mute = False
        self._lines, self._commands = queue.SimpleQueue(), queue.SimpleQueue()
        for what, lines in ((_read, self._lines), (_write, self._commands)):
            threading.Thread(target=what, args=(process, lines), daemon=True).start()
        said = self._next_line("its first line", self._patience)
        _require(said, "greeting", "its first line")
        self.greeting = Greeting(
            f"{said['client']['name']} {said['client']['version']}",
            said["axes"],
            said["unitsPerMetre"],
            said["precision"] == "single",
            frozenset(said["can"]),
        )
        return self.greeting

    def ask(self, command: str, seconds: float = ANSWER_SECONDS, **members: Any) -> Json:
        """Give a command; its answer. Raises AdapterBroken, ClientCrashed."""
        self.give(command, **members)
        return self.take(command, seconds)

    def give(self, command: str, **members: Any) -> None:
        """Give a command, and do not wait for its answer: `take` it before the next."""
        self._last += 1
        given = {"id": self._last, "command": command, **members}
        if command in _schema()["$defs"]["commands"]:
            complaint = _complaint(given, f"commands/{command}")
            assert complaint is None, f"the harness gave a bad command: {complaint}"
        self._commands.put(json.dumps(given, allow_nan=False).encode() + b"\n")

    def take(self, command: str, seconds: float = ANSWER_SECONDS) -> Json:
        """The answer to a command that was given. Raises AdapterBroken, ClientCrashed."""
        answer = self.hear(command, seconds)
        if "error" in answer:
            raise Declined(f"to {command} it answered the error {answer['error']!r}")
        _require(answer, f"answers/{command}", f"its answer to {command}")
        return answer

    def hear(self, command: str, seconds: float = ANSWER_SECONDS) -> Json:
        """The answer to a command that was given, which may be an error. Raises as `take`."""
        answer = self._next_line(f"its answer to {command}", seconds)
        if answer.get("id") != self._last:
            raise AdapterBroken(
                f"its answer to {command} has the id {answer.get('id')!r}, not {self._last}"
            )
        return answer

    def stop(self) -> Ended | None:
        """Ask it to end, then make it."""
        if self._process is None:
            return None
        try:
            self.ask("stop", STOP_SECONDS)
        except (AdapterBroken, ClientCrashed):
            return self.end(patience=0.0)
        return self.end()

    def end(self, patience: float = STOP_SECONDS) -> Ended | None:
        """Wait for its end, and make it end where it does not."""
        process = self._process
        if process is None:
            return None
        self._commands.put(None)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
        end(process)
        ended, self._process = self.ended(), None
        return ended

    def _next_line(self, what: str, seconds: float) -> Json:
        deadline = self._peer.clock() + seconds
        while True:
            self._peer.pump()
            with contextlib.suppress(queue.Empty):
                return self._understood(self._lines.get(timeout=GLANCE_SECONDS), what)
            if self._peer.clock() >= deadline or self._mute:
                self._mute = True
                raise AdapterBroken(f"it was silent for {seconds:g} s: {what} did not come")

    def _understood(self, line: bytes, what: str) -> Json:
        if not line:
            self._mute = True
            self._ended_instead(what)
        try:
            said = json.loads(line, parse_constant=_no_json, parse_float=_in_range)
        except (ValueError, RecursionError):
            shown = shorten(line.decode("utf-8", "backslashreplace").rstrip())
            raise AdapterBroken(f"on stdout, in place of {what}, is no JSON: {shown}") from None
        if not isinstance(said, dict):
            raise AdapterBroken(f"{what} is no JSON object: {shorten(json.dumps(said))}")
        return said

    def _ended_instead(self, what: str) -> None:
        assert self._process is not None
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(STOP_SECONDS)
        ended = self.ended()
        if ended and ended.crashed:
            raise ClientCrashed(f"it {ended} in place of {what}")
        told = self.output().strip()
        how = f"it {ended}" if ended else "it closed its stdout"
        raise AdapterBroken(f"{how} in place of {what}" + (f"; on stderr:\n{told}" if told else ""))


def _read(process: subprocess.Popen[bytes], lines: "queue.SimpleQueue[bytes]") -> None:
    """Hand over each line, and at the end an empty one."""
    assert process.stdout is not None
    with process.stdout as stdout:
        while line := stdout.readline(LONGEST_LINE):
            lines.put(line)
    lines.put(b"")


def _write(process: subprocess.Popen[bytes], lines: "queue.SimpleQueue[bytes | None]") -> None:
    """Write each line: in a thread, for an adapter that does not read must not hold us up."""
    assert process.stdin is not None
    with contextlib.suppress(OSError), process.stdin as stdin:
        while (line := lines.get()) is not None:
            stdin.write(line)
            stdin.flush()


def _in_range(spelling: str) -> float:
    if math.isinf(number := float(spelling)):
        raise ValueError(f"{spelling} is beyond double precision")
    return number


def _no_json(name: str) -> float:
    raise ValueError(f"{name} is no JSON")


def _require(said: Json, name: str, what: str) -> None:
    if complaint := _complaint(said, name):
        raise AdapterBroken(f"{what} breaks its schema: {complaint}")


def _complaint(said: Json, name: str) -> str | None:
    try:
        error = next(_validator(name).iter_errors(said), None)
    except ValueError as unreadable:  # half of a surrogate pair, or nested too deep
        return f"it cannot be read: {unreadable}"
    if error is None:
        return None
    where = "".join(f"/{step}" for step in error.instance_path)
    return f"{where or 'it'}: {shorten(error.message)}"


@cache
def _validator(name: str) -> "Draft202012Validator":
    from jsonschema_rs import Draft202012Validator

    return Draft202012Validator({**_schema(), "$ref": f"#/$defs/{name}"})


@cache
def _schema() -> Json:
    schema: Json = read_json("adapter.schema.json")
    return schema
