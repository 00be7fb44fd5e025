"""A log of what goes over both channels, packet by packet, with the bytes."""

from __future__ import annotations

import json
import re
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from splatbus_schemas.visible import visible
from splatbus_wire.errors import FramingError
from splatbus_wire.framing import PacketDecoder

KEPT = 2000
KEPT_BYTES = 4 << 20
_TOKEN = re.compile(rb'("token"\s*:\s*)"(?:[^"\\]|\\.)*"')
_ROW_BYTES = 16
_SUMMARY_LETTERS = 160


class Packet(NamedTuple):
    """One packet.

    Attributes:
        time: seconds on the client's clock.
        channel: `"IPC"` or `"message"`.
        way: `"sent"` or `"received"`.
        payload: its bytes without the header; a token's are not kept.
    """

    time: float
    channel: str
    way: str
    payload: bytes

    @property
    def size(self) -> int:
        """Bytes on the wire, header included."""
        return len(self.payload) + 4

    @property
    def summary(self) -> str:
        """The beginning of its text, fit for one line."""
        return visible(self.payload[:_SUMMARY_LETTERS].decode("utf-8", "replace"))

    @property
    def text(self) -> str:
        """Its JSON, one member a line; as it came where it is none."""
        try:
            return json.dumps(json.loads(self.payload), indent=2)
        except ValueError:
            return visible(self.payload.decode("utf-8", "replace"))

    @property
    def dump(self) -> str:
        """Offset, hexadecimal bytes and letters, sixteen a row."""
        rows = []
        for start in range(0, len(self.payload), _ROW_BYTES):
            row = self.payload[start : start + _ROW_BYTES]
            letters = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in row)
            rows.append(f"{start:06x}  {row.hex(' '):<{3 * _ROW_BYTES}} {letters}")
        return "\n".join(rows)


class Packets:
    """What a session's tap hears, cut into packets; the oldest go when there are too many.

    Attributes:
        newest: in the order in which they went.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self.newest: deque[Packet] = deque()
        self.is_paused = False
        self._clock = clock
        self._bytes = 0
        self._decoders: dict[tuple[str, str], PacketDecoder] = {}

    def hear(self, channel: str, what: str, data: bytes) -> None:
        """Take what went; see `splatbus_client.channel.Tap`."""
        if what == "connected":
            for way in ("sent", "received"):
                self._decoders[channel, way] = PacketDecoder()
            return
        decoder = self._decoders[channel, what]
        decoder.receive(data)
        try:
            while (payload := decoder.next_packet()) is not None:
                self._keep(Packet(self._clock(), channel, what, hidden(payload)))
        except FramingError:
            return  # the session says so, and closes

    def clear(self) -> None:
        """Forget all."""
        self.newest.clear()
        self._bytes = 0

    def _keep(self, packet: Packet) -> None:
        if self.is_paused:
            return
        self.newest.append(packet)
        self._bytes += packet.size
        while len(self.newest) > KEPT or self._bytes > KEPT_BYTES:
            self._bytes -= self.newest.popleft().size


def hidden(payload: bytes) -> bytes:
    """Return the payload without its token: a log is shown, copied and mailed."""
    return _TOKEN.sub(rb'\1"..."', payload) if b'"token"' in payload else payload
