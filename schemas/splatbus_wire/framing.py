"""Cut a stream of bytes into packets, and make packets (1.0 chapter 2)."""

from __future__ import annotations

from collections import deque

from splatbus_schemas import FRAMING, LIMITS
from splatbus_schemas.first_bytes import recognised

from splatbus_wire.errors import FramingError, ProtocolError

_HEADER_BYTES: int = FRAMING["length"]["bytes"]
_BYTE_ORDER = FRAMING["length"]["byteOrder"]
_LOOKED_AT = 4096
"""Bytes of a stream that is none of ours, to say what it is."""
MIN_PAYLOAD_BYTES: int = LIMITS["min_payload_bytes"]
MAX_PAYLOAD_BYTES: int = LIMITS["max_payload_bytes"]


def encode_packet(payload: bytes) -> bytes:
    """Return header and payload as one packet, to be sent in a single write [FRM-1, FRM-7].

    Raises:
        ProtocolError: the payload is empty or too long to be sent [FRM-2].
    """
    if not MIN_PAYLOAD_BYTES <= len(payload) <= MAX_PAYLOAD_BYTES:
        raise ProtocolError(
            "packet_too_large" if payload else "malformed_packet",
            f"a payload of {len(payload)} bytes was to be sent; {MIN_PAYLOAD_BYTES} to"
            f" {MAX_PAYLOAD_BYTES} are allowed",
            requirement="FRM-2",
        )
    return len(payload).to_bytes(_HEADER_BYTES, _BYTE_ORDER) + payload


class PacketDecoder:
    """Packets out of the bytes of one connection, however TCP divides or joins them [FRM-4].

    Work is linear in the bytes received, even byte by byte. What is held is at most one unfinished
    packet, and the finished ones that `next_packet` has not yet handed out; nothing is reserved
    because a header promises it.
    """

    def __init__(self) -> None:
        self.unfinished = bytearray()
        self.payloads: deque[bytes] = deque()
        self.offset = 0
        self.error: FramingError | None = None

    def receive(self, data: bytes) -> None:
        """Take bytes as they came from the connection; after a bad header, drop them."""
        if self.error is not None:
            return
        unfinished = self.unfinished
        if unfinished:
            unfinished += data
        # Where nothing is unfinished, packets are cut straight out of what came.
        stream = unfinished or data
        available = len(stream)
        start = 0
        while available - start >= _HEADER_BYTES:
            body = start + _HEADER_BYTES
            length = int.from_bytes(stream[start:body], _BYTE_ORDER)
            if not MIN_PAYLOAD_BYTES <= length <= MAX_PAYLOAD_BYTES:
                self.error = _bad_header(length, self.offset + start, stream[start:])
                unfinished.clear()
                return
            end = body + length
            if end > available:
                break
            self.payloads.append(bytes(stream[body:end]))
            start = end
        self.offset += start
        # What is moved or kept here arrived with `data`, so this too is linear.
        if unfinished:
            del unfinished[:start]
        else:
            unfinished += stream[start:]

    def next_packet(self) -> bytes | None:
        """Return the payload of the next packet, or None if it is not complete yet.

        Raises:
            FramingError: a header announces 0 bytes or too many, and all packets before it have
                been handed out; so does every later call [FRM-3]. `offset` is that of the header
                within the connection.
        """
        if self.payloads:
            return self.payloads.popleft()
        if self.error is not None:
            raise self.error
        return None

    @property
    def incomplete(self) -> bool:
        """Whether the first bytes of a packet are here, and its last are not [FRM-5, FRM-6]."""
        return bool(self.unfinished)


def seems(stream: bytes | bytearray) -> str:
    """What a peer seems to speak instead, as the end of a sentence; empty where nothing seems so.

    Args:
        stream: from the beginning of a packet.
    """
    known = recognised(bytes(stream[:_LOOKED_AT]))
    return f"; {known}" if known else ""


def _bad_header(length: int, offset: int, stream: bytes | bytearray) -> FramingError:
    return FramingError(
        "packet_too_large" if length else "malformed_packet",
        f"a header announces {length} bytes; {MIN_PAYLOAD_BYTES} to {MAX_PAYLOAD_BYTES} are"
        f" allowed, and nothing after it can be trusted{seems(stream)}",
        requirement="FRM-3",
        offset=offset,
    )
