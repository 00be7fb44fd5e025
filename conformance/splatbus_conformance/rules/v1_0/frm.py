"""Rules on packets (spec 1.0 section 2.1)."""

import math
from collections.abc import Iterator

from splatbus_schemas.first_bytes import astray, recognised

from splatbus_conformance.rules import Breach, Sighting, about, rule
from splatbus_conformance.wire.conversation import SENDER, Conversation
from splatbus_conformance.wire.json_reading import read
from splatbus_conformance.wire.packets import HEADER, Splitter
from splatbus_conformance.wire.recording import Direction


@rule("FRM-2")
def length_within_limits(conversation: Conversation) -> Iterator[Sighting]:
    """FRM-2: every header announces a payload within the limits."""
    for message in conversation.messages:
        yield about(message, "FRM-2")
    for direction, stream in conversation.streams.items():
        if stream.refused is not None:
            length = int.from_bytes(stream.rest[:4], "little")
            text = f"the header at byte {stream.refused} of the stream announces {length:,} bytes"
            newest = reversed(conversation.messages)
            before = next((it for it in newest if it.direction == direction), None)
            strayed = astray(before.packet.payload, stream.rest) if before else ""
            if known := strayed or recognised(stream.rest):
                text += f": {known}"
            wrong = Breach("out-of-range", text)
            yield _of_stream(stream, direction, "FRM-2", stream.began, wrong)


@rule("FRM-1")
def whole_packets(conversation: Conversation) -> Iterator[Sighting]:
    """FRM-1: lengths are those of payloads, and a stream that its sender ended holds whole packets.

    A peer whose connection was ended by the other side could not finish its packet, nor could one
    whose process ended.
    """
    ended = conversation.ended
    for direction, stream in conversation.streams.items():
        if _counts_its_header(conversation, direction):
            text = "the length counts the four bytes of the header, too"
            wrong = Breach("header-counted", text)
            yield _of_stream(stream, direction, "FRM-1", stream.began, wrong)
            continue
        if stream.refused is not None:
            continue
        other: Direction = "s2c" if direction == "c2s" else "c2s"
        by_itself = ended.get(direction, math.inf) < ended.get(other, math.inf)
        if stream.rest and by_itself and direction not in conversation.died:
            text = f"the stream ends {len(stream.rest)} bytes into a packet"
            wrong = Breach("cut-short", text)
            yield _of_stream(stream, direction, "FRM-1", ended[direction], wrong)
        elif stream.offset:
            yield _of_stream(stream, direction, "FRM-1", stream.began)


def _counts_its_header(conversation: Conversation, direction: Direction) -> bool:
    """Whether the first message is an object if its length is taken for four bytes less."""
    first = next(iter(conversation.sent_by(SENDER[direction])), None)
    if first is not None:
        return first.value is None and read(first.packet.payload[:-HEADER]).value is not None
    rest = conversation.streams[direction].rest
    length = int.from_bytes(rest[:HEADER], "little")
    return len(rest) == length and read(rest[HEADER:]).value is not None


def _of_stream(
    stream: Splitter,
    direction: Direction,
    requirement: str,
    t: float,
    breach: Breach | None = None,
) -> Sighting:
    return Sighting(
        requirement,
        SENDER[direction],
        t,
        breach,
        offset=stream.offset,
        data=stream.rest,
    )


@rule("FRM-7")
def header_with_payload(conversation: Conversation) -> Iterator[Sighting]:
    """FRM-7: header and payload arrive together.

    TCP may part them by itself; that it parts them just there, time and again, is two writes.
    """
    for message in conversation.messages:
        packet = message.packet
        apart = None
        if packet.header_apart:
            late = 1000 * (packet.ended - packet.began)
            text = f"the header arrived alone, its payload {late:.1f} ms later"
            apart = Breach("header-apart", text)
        yield about(message, "FRM-7", apart)
