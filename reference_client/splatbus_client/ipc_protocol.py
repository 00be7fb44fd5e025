"""The IPC channel, sans I/O: bytes in, events out, bytes to send (1.0 chapter 4, 1.1 2 to 5).

It knows what was announced, opened and lent; it never touches memory.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.fields import Field
from splatbus_wire.init_packet import InitPacket, readable_generation
from splatbus_wire.json_text import parse_object
from splatbus_wire.messages import (
    Closed,
    ErrorMessage,
    Frame,
    Hello,
    Opened,
    OpenFailed,
    Release,
    Subscribe,
    Welcome,
    decode_from_server_ipc,
    encode,
)
from splatbus_wire.packet_reader import PacketReader

from splatbus_client.events import (
    Announced,
    Declined,
    Ignored,
    IpcEvent,
    Lent,
    Look,
    MustClose,
    Negotiated,
    ServerError,
    negotiated,
)

CHANNELS = frozenset({"color", "depth"})
MOST_BEFORE_WELCOME = 16
"""Init packets that wait for `welcome`; a server that conforms sends one [NEG-15, OPN-7]."""
MOST_UNSENT_BYTES: int = LIMITS["max_unsent_bytes"]
"""What is kept for a server that has us answer and does not read; LIM-2 has it the other way."""


class _Broken(NamedTuple):
    """An init packet that breaks a rule, and of which the generation could be read [OPN-1]."""

    generation: int
    reason: str


class _Lent(NamedTuple):
    """A frame that breaks a rule, and of which so much could be read."""

    generation: int
    slot: int
    seq: int


class IpcProtocol:
    """One connection on the IPC channel, from `hello` to its end.

    Args:
        hello: sent first [NEG-1], with the capabilities that the owner has.
        channels: which of `"color"` and `"depth"` the owner wants to read.
    """

    def __init__(self, hello: Hello, channels: frozenset[str] = CHANNELS) -> None:
        self.version: str | None = None
        self.capabilities: frozenset[str] = frozenset()
        self.hello = hello
        self.reader = PacketReader()
        self.unsent = bytearray(encode(hello))
        self._before_welcome: list[InitPacket | _Broken] = []
        self.last_generation = 0
        self.slots: dict[int, int] = {}  # of each generation that is open
        self._over: str | None = None  # why the connection has to end
        self._look_at: float | None = None
        self._look_every = 0.0
        self.retired: set[int] = set()  # open, but not to be read any more
        self._leases: set[tuple[int, int]] = set()
        self._wanted = channels
        self.written = CHANNELS

    # What the owner does

    def opened(self, packet: InitPacket) -> None:
        """Tell the server that the memory of an announced packet is mapped and checked [OPN-2]."""
        if packet.generation is None:
            return  # 1.0 asks for no answer
        self.slots[packet.generation] = packet.ring.slots if packet.ring else 0
        self.send(Opened(packet.generation))
        self.written = self._wanted_and_written()

    def look(self, every: float) -> None:
        """Say when it is time to look at the buffers of 1.0: now, and every so many seconds."""
        self._look_at, self._look_every = 0.0, every

    def open_failed(self, packet: InitPacket, reason: str) -> None:
        """Tell the server, where it speaks 1.1, that an announced packet cannot be opened."""
        if self.version == "1.1" and packet.generation is not None:
            self.send(OpenFailed(packet.generation, reason[: LIMITS["max_reason_chars"]]))

    def give_up(self, generation: int, reason: str) -> None:
        """Use memory no longer that became shorter: it is retired without a successor.

        Where `reinit` was not agreed upon nothing can be said of it, and the connection ends.
        """
        if "reinit" in self.capabilities:
            self.retired.add(generation)
        else:
            self.slots.clear()
            self._over = reason

    def closed(self, generation: int) -> None:
        """Tell the server that the memory of a retired generation is unmapped [OPN-5]."""
        if generation in self.retired:
            self.retired.remove(generation)
            del self.slots[generation]
            self.send(Closed(generation))

    def release(self, frame: Frame) -> None:
        """Give a slot back, once; reads of it have to have finished [IMG-12, IMG-13]."""
        self.give_back(frame.generation, frame.seq)

    def subscribe(self, channels: frozenset[str]) -> None:
        """Want these of `"color"` and `"depth"` from now on."""
        self._wanted = channels
        if "subscribe" in self.capabilities:
            self.send(Subscribe(channels))
            # A frame that is under way may be older than this message; one that follows a
            # `release` or an `opened` cannot be.
            self.written &= channels

    # What the connection does

    def data_to_send(self, now: float) -> bytes:
        """Return what is to be sent next; call it again when that has been sent whole."""
        data = bytes(self.unsent)
        self.unsent.clear()
        return data

    def deadline(self) -> float:
        """Return when `expire` is to be called, if nothing comes before."""
        if self._over is not None:
            return 0.0
        look_at = math.inf if self._look_at is None else self._look_at
        return min(self.reader.deadline, look_at)

    def expire(self, now: float) -> list[IpcEvent]:
        """Return what follows from the time alone [FRM-5]; an init packet has no limit [CHN-9]."""
        if self._over is not None:
            return [MustClose(self._over)]
        if now >= self.reader.deadline:
            return [MustClose("a packet was begun and not completed in time [FRM-5]")]
        if self._look_at is not None and now >= self._look_at:
            self._look_at = now + self._look_every
            return [Look()]
        return []

    def receive(self, data: bytes, now: float) -> Iterator[IpcEvent]:
        """Yield what the bytes mean; `MustClose`, if any, is the last.

        Act on each event before taking the next: what a packet means can depend on it.
        """
        try:
            self.reader.receive(data, now)
            for payload in self.reader.packets(now):
                for event in self.on_payload(payload):
                    yield event
                    if isinstance(event, MustClose):
                        return
                if len(self.unsent) > MOST_UNSENT_BYTES:
                    yield MustClose(f"the server leaves {len(self.unsent)} bytes unread")
                    return
        except FramingError as error:
            yield MustClose(str(error))

    def on_payload(self, payload: bytes) -> Iterator[IpcEvent]:
        """Yield what a packet means."""
        try:
            message = decode_from_server_ipc(payload)
        except ProtocolError as problem:
            yield from self.on_broken(payload, str(problem))
            return
        if isinstance(message, Welcome):
            yield from self.on_welcome(message)
        elif isinstance(message, InitPacket):
            if message.version is None:
                yield from self.on_init_packet_of_1_0(message)
            else:
                yield from self.on_init_packet(message)
        elif isinstance(message, Frame):
            yield from self.on_frame(message)
        elif isinstance(message, ErrorMessage):
            yield ServerError(message)

    def on_broken(self, payload: bytes, problem: str) -> Iterator[IpcEvent]:
        """Yield what follows from a packet that breaks a rule."""
        message = _readable(payload)
        generation = readable_generation(message) if "meta" in message else None
        if generation is not None:
            yield from self.on_init_packet(_Broken(generation, problem))
            return
        yield Ignored(problem)
        if (lent := _refused_frame(message)) is None or not self.is_open(*lent[:2]):
            return
        generation, _, seq = lent
        if (generation, seq) not in self._leases:
            # It is lent all the same, and without a `release` it would be the last frame [IMG-24].
            self._leases.add((generation, seq))
            self.give_back(generation, seq)

    def on_welcome(self, welcome: Welcome) -> Iterator[IpcEvent]:
        """Settle the version, and take the init packets that came before [NEG-16, NEG-40]."""
        if self.version != "1.0" and welcome.version not in self.hello.versions:
            yield MustClose(f"welcome names version {welcome.version}, not offered [NEG-16]")
        elif self.version is not None:
            yield Ignored("welcome came when the version was settled [NEG-40]")
        else:
            agreed = negotiated(self.hello, welcome)
            self.version, self.capabilities = agreed.version, agreed.capabilities
            yield agreed
            if "subscribe" in self.capabilities and self._wanted != CHANNELS:
                self.subscribe(self._wanted)
            waiting, self._before_welcome = self._before_welcome, []
            for packet in waiting:
                yield from self.on_init_packet(packet)

    def on_init_packet_of_1_0(self, packet: InitPacket) -> Iterator[IpcEvent]:
        """Announce the memory of a server that may know nothing of `hello`."""
        if self.version == "1.1":
            yield Ignored("an init packet without version came after welcome [MEM-1]")
            return
        if self.version is None:
            self.version = "1.0"
            yield Negotiated("1.0", None, frozenset())
        yield Announced(packet)

    def on_init_packet(self, packet: InitPacket | _Broken) -> Iterator[IpcEvent]:
        """Announce memory, or decline what cannot be read; the former is retired."""
        generation = packet.generation or 0
        if self.version is None:
            # It says 1.1, so a welcome follows, before which nothing may be answered [NEG-5]. None
            # may be dropped: each is to be answered [OPN-1], and without `reinit` the first counts.
            if len(self._before_welcome) == MOST_BEFORE_WELCOME:
                yield MustClose(f"{MOST_BEFORE_WELCOME} init packets came, and no welcome [OPN-7]")
                return
            self._before_welcome.append(packet)
        elif self.version == "1.0":
            yield Ignored("an init packet with version came on a connection that speaks 1.0")
        elif generation <= self.last_generation:
            yield Ignored(f"generation {generation} follows {self.last_generation} [MEM-1]")
        elif self.last_generation and "reinit" not in self.capabilities:
            yield Ignored("a further init packet came, and reinit was not agreed [OPN-6]")
        else:
            self.last_generation = generation
            # A frame of the former memory that still comes is given back unread.
            self.retired.update(self.slots)
            if isinstance(packet, InitPacket):
                yield Announced(packet)
            else:
                self.send(OpenFailed(generation, packet.reason[: LIMITS["max_reason_chars"]]))
                yield Declined(generation, packet.reason)

    def on_frame(self, frame: Frame) -> Iterator[IpcEvent]:
        """Lend a frame, or give it back unread if its memory is retired."""
        if not self.is_open(frame.generation, frame.slot):
            yield Ignored(
                f"a frame came of generation {frame.generation}, slot {frame.slot},"
                " which is not open [IMG-15]"
            )
            return
        self._leases.add((frame.generation, frame.seq))
        if frame.generation in self.retired:
            self.release(frame)
        else:
            yield Lent(frame, self.written)

    def is_open(self, generation: int, slot: int) -> bool:
        """Whether the server may lend this slot."""
        return "frames" in self.capabilities and 0 <= slot < self.slots.get(generation, 0)

    def give_back(self, generation: int, seq: int) -> None:
        """Send `release` for an image, once [IMG-12]."""
        lease = (generation, seq)
        if lease in self._leases:
            self._leases.remove(lease)
            self.send(Release(*lease))
            self.written = self._wanted_and_written()

    def _wanted_and_written(self) -> frozenset[str]:
        return self._wanted if "subscribe" in self.capabilities else CHANNELS

    def send(self, message: Opened | OpenFailed | Closed | Release | Subscribe) -> None:
        """Queue a message."""
        self.unsent += encode(message)


def _readable(payload: bytes) -> dict[str, Any]:
    """Return what a refused payload holds, nothing if its text is broken [JSN-8]."""
    try:
        return parse_object(payload)
    except ProtocolError:
        return {}


def _refused_frame(message: dict[str, Any]) -> _Lent | None:
    """Return what was lent by a frame that is malformed otherwise, if it can be read [IMG-24]."""
    try:
        frame = Field(message, "", "IMG-1")
        if frame.value.get("type") != "frame":
            return None
        slot = frame.member("slot").integer(0, LIMITS["max_slots"] - 1)
        return _Lent(frame.generation(), slot, frame.seq())
    except ProtocolError:
        return None
