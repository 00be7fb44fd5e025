"""The part that the harness plays towards a server: a well-behaved viewer, on whatever a check
leaves to it.
"""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from splatbus_conformance.images.memory.device import Device
from splatbus_conformance.images.memory.device_reading import open_on_device
from splatbus_conformance.images.memory.reading import CannotOpen, Opened, open_memory
from splatbus_conformance.images.pinhole import camera_of
from splatbus_conformance.trials.dealings import Dealings
from splatbus_conformance.wire import messages
from splatbus_conformance.wire.conversation import Message
from splatbus_conformance.wire.json_values import is_number, whole
from splatbus_conformance.wire.message_kinds import CAPABILITIES
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection


@dataclass
class DialledConnection(Dealings):
    """What was said on one connection, and what was opened."""

    said: list[Json] = field(default_factory=list)
    """Every message that was sent; not what scripts said."""
    init_packets: list[Json] = field(default_factory=list)
    """All whose numbers are finite; members may be missing, and be anything."""
    frames: list[Json] = field(default_factory=list)
    """All that are `readable`."""
    held: Json | None = None
    """The frame that was not given back yet, readable or not."""
    memory: Opened | None = None
    """What the last init packet announced, mapped."""
    refusal: str = ""
    """Why that could not be opened."""
    holds: bool = False
    """Frames on this connection are not given back."""
    keeps: bool = False
    """Memory that was replaced stays open, and `closed` is left out."""
    kept: list[Opened] = field(default_factory=list)
    """Such memory."""

    def errors(self) -> list[str]:
        """The codes of the errors that were heard, in order."""
        return [str(error.get("code")) for error in self.all_of("error")]

    @property
    def answer(self) -> Json | None:
        """What answered `hello`: `welcome`, or an error."""
        return next(iter(self.all_of("welcome", "error")), None)


def readable(frame: Json) -> bool:
    """Whether a frame has what is done with frames; what others lack, IMG-1 says."""
    numbered = all(whole(frame.get(name), 0) is not None for name in ("generation", "seq", "slot"))
    timed = all(is_number(frame.get(name)) for name in ("time", "renderedAt"))
    return numbered and timed and camera_of(frame) is not None


class ScriptedClient:
    """Says `hello`, opens memory, takes leases.

    A check sets the switches before it connects, to leave out what it does itself.
    """

    def __init__(self, token: str | None = None, device: Device | None = None) -> None:
        self.token = token
        self.device = device
        """Where CUDA memory can be read, if anywhere."""
        on_ipc = [name for name in CAPABILITIES["ipc"] if name != "cuda_ipc"]
        self.capabilities = {"ipc": on_ipc, "msg": list(CAPABILITIES["msg"])}
        if device is not None:
            self.capabilities["ipc"] = ["cuda_ipc", *self.capabilities["ipc"]]
        self.opens = True
        """Opens the memory that is announced, and says so."""
        self.releases = True
        """Gives each frame back as soon as it comes, on connections that are made from now on."""
        self.encode: Callable[[Json], bytes] = messages.encode
        """How a message is written."""
        self.dealings: dict[Connection, DialledConnection] = {}

    def with_(self, connection: Connection) -> DialledConnection:
        """What was said on this connection."""
        return self.dealings.setdefault(connection, DialledConnection(holds=not self.releases))

    @contextlib.contextmanager
    def holding(self) -> Iterator[None]:
        """Connections that are made meanwhile give no frame back, not even the first, which may
        have come before whoever connected can say so.
        """
        former, self.releases = self.releases, False
        try:
            yield
        finally:
            self.releases = former

    def on_open(self, connection: Connection) -> None:
        """A connection was made: nothing to say yet."""

    def on_message(self, connection: Connection, arrived: Message) -> None:
        """The server sent a message."""
        if (message := arrived.value) is None:
            return
        dealings = self.with_(connection)
        dealings.heard.append(message)
        kind, finite = message.get("type"), arrived.finite
        if kind == "welcome":
            first, dealings.welcome = dealings.welcome is None, dealings.welcome or message
            before = dealings.init_packets[-1:]
            if first and self.opens and before and "version" in before[0]:
                self.open(connection, before[0])
        elif connection.channel == "ipc" and kind == "frame":
            if finite and readable(message):
                dealings.frames.append(message)
            dealings.held = message
            if not dealings.holds:
                self.release(connection, message)
        elif connection.channel == "ipc" and kind is None and "meta" in message and finite:
            dealings.init_packets.append(message)
            if self.opens and dealings.welcome is not None:
                self.open(connection, message)

    def greet(self, connection: Connection, **changes: object) -> None:
        """Send `hello`, with members changed as named; None leaves one out."""
        offered = self.capabilities[connection.channel]
        hello = messages.hello(offered, self.token) | changes
        hello = {name: value for name, value in hello.items() if value is not None}
        self.with_(connection).hello = hello
        self.say(connection, hello)

    def open(self, connection: Connection, init_packet: Json) -> None:
        """Open what an init packet announces, close what was open, and answer."""
        dealings = self.with_(connection)
        former, generation = dealings.memory, whole(init_packet.get("generation"))
        try:
            dealings.memory = self._opened(init_packet)
        except CannotOpen as error:
            dealings.memory, dealings.refusal = None, str(error)
            failed = {"type": "open_failed", "generation": generation, "reason": str(error)}
            if generation is not None:
                self.say(connection, failed)
        else:
            self.say(connection, {"type": "opened", "generation": generation})
        if former is not None:
            dealings.kept.append(former)
            if not dealings.keeps:
                self.let_go(connection)

    def let_go(self, connection: Connection) -> None:
        """Give up memory that was replaced, and the frame that lies in it."""
        dealings = self.with_(connection)
        while dealings.kept:
            former = dealings.kept.pop(0)
            if dealings.held and dealings.held.get("generation") == former.generation:
                self.release(connection, dealings.held)
            former.close()
            self.say(connection, {"type": "closed", "generation": former.generation})

    def _opened(self, init_packet: Json) -> Opened:
        memory = init_packet.get("memory")
        if self.device and isinstance(memory, dict) and memory.get("kind") == "cuda_ipc":
            return open_on_device(init_packet, self.device)
        return open_memory(init_packet)

    def release(self, connection: Connection, frame: Json, *more: Json) -> None:
        """Give a frame back, and say more in the same write."""
        dealings = self.with_(connection)
        dealings.held = None if dealings.held == frame else dealings.held
        named = {name: frame.get(name) for name in ("generation", "seq")}
        if all(whole(value) is not None for value in named.values()):
            self.say(connection, {"type": "release", **named}, *more)

    def say(self, connection: Connection, *messages: Json) -> None:
        """Send messages, in one write."""
        self.with_(connection).said += messages
        connection.send(b"".join(packet(self.encode(message)) for message in messages))

    def close(self) -> None:
        """Unmap everything that was opened."""
        for dealings in self.dealings.values():
            for memory in (*dealings.kept, dealings.memory):
                if memory is not None:
                    memory.close()
            dealings.kept, dealings.memory = [], None
