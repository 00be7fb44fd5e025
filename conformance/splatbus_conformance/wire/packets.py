"""Cut a byte stream into packets as the judge sees them: note what is wrong, refuse nothing.

This is the harness's own reading of spec 1.0 section 2.1, independent of the wire package.
"""

from typing import NamedTuple

from splatbus_schemas import LIMITS

HEADER = 4
CROWD_BYTES = 1024
"""So much at once is a write of many packets, or of long ones, which the system has divided."""


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
    """The header arrived alone, or behind little else, and the payload after it (FRM-7).

    Where a write of many packets is divided, a part of it ends with a header by chance.
    """


def packet(payload: bytes) -> bytes:
    """The bytes of a packet with this payload (FRM-1)."""
    return len(payload).to_bytes(HEADER, "little") + payload


def is_length(length: int) -> bool:
    """Whether a header may announce so many bytes (FRM-2)."""
    return bool(LIMITS["min_payload_bytes"] <= length <= LIMITS["max_payload_bytes"])


class Splitter:
    """Collects the bytes of one direction of one connection."""

    def __init__(self) -> None:
        self.refused: int | None = None
        """Offset of a header with a length that FRM-2 forbids; nothing after it can be split."""
        self.unsplit = 0
        """Bytes that came after such a header was read; they are counted, not kept."""
        self.offset = 0
        """Bytes of whole packets: where `rest` begins in the stream."""
        self.began = 0.0
        """When the first byte of `rest` arrived, in seconds."""
        self._header_apart = False
        self._rest = bytearray()

    @property
    def rest(self) -> bytes:
        """Bytes of a packet that is not complete."""
        return bytes(self._rest)

    def feed(self, data: bytes, now: float) -> list[Packet]:
        """Take what arrived at once at time `now`, in seconds; return the packets it completes."""
        if self.refused is not None:
            self.unsplit += len(data)
            return []
        done: list[Packet] = []
        rest = self._rest
        if not rest:
            self.began = now
        rest += data
        at = 0
        while self.refused is None and len(rest) - at >= HEADER:
            length = int.from_bytes(rest[at : at + HEADER], "little")
            end = at + HEADER + length
            if not is_length(length):
                self.refused = self.offset
            elif len(rest) < end:
                alone = len(rest) - at == HEADER and len(data) < CROWD_BYTES
                self._header_apart = self._header_apart or alone
                break
            else:
                payload = bytes(rest[at + HEADER : end])
                done.append(Packet(payload, self.offset, self.began, now, self._header_apart))
                self.offset += HEADER + length
                at = end
                self.began, self._header_apart = now, False
        del rest[:at]
        return done
