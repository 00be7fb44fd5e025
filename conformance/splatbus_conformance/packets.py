"""Cut a byte stream into packets as the judge sees them: note what is wrong, refuse nothing.

This is the harness's own reading of spec 1.0 section 2.1, independent of the wire package.
"""

from typing import NamedTuple

from splatbus_schemas import LIMITS

HEADER = 4


class Packet(NamedTuple):
    """One packet of a stream."""

    payload: bytes
    offset: int
    """Byte offset of the header in its stream."""
    began: float
    """When the first byte of the header arrived, in seconds."""
    ended: float
    """When the last byte of the payload arrived."""
    header_apart: bool
    """The header arrived alone, and the payload after it (FRM-7)."""


def packet(payload: bytes) -> bytes:
    """The bytes of a packet with this payload (FRM-1)."""
    return len(payload).to_bytes(HEADER, "little") + payload


class Splitter:
    """Collects the bytes of one direction of one connection."""

    def __init__(self) -> None:
        self.rest = b""
        """Bytes of a packet that is not complete."""
        self.refused: int | None = None
        """Offset of a header with a length that FRM-2 forbids; nothing after it can be split."""
        self.unsplit = 0
        """Bytes that came after such a header was read; they are counted, not kept."""
        self.offset = 0
        """Bytes of whole packets: where `rest` begins in the stream."""
        self.began = 0.0
        """When the first byte of `rest` arrived, in seconds."""
        self._header_apart = False

    def feed(self, data: bytes, now: float) -> list[Packet]:
        """Take what arrived at once at time `now`, in seconds; return the packets it completes."""
        if self.refused is not None:
            self.unsplit += len(data)
            return []
        done: list[Packet] = []
        if not self.rest:
            self.began = now
        self.rest += data
        while self.refused is None and len(self.rest) >= HEADER:
            length = int.from_bytes(self.rest[:HEADER], "little")
            if not LIMITS["min_payload_bytes"] <= length <= LIMITS["max_payload_bytes"]:
                self.refused = self.offset
            elif len(self.rest) < HEADER + length:
                self._header_apart = self._header_apart or len(self.rest) == HEADER
                break
            else:
                payload = self.rest[HEADER : HEADER + length]
                done.append(Packet(payload, self.offset, self.began, now, self._header_apart))
                self.offset += HEADER + length
                self.rest = self.rest[HEADER + length :]
                self.began, self._header_apart = now, False
        return done
