"""Rules on packets (spec 1.0 section 2.1)."""

from collections.abc import Iterator

from splatbus_conformance.conversation import SENDER, Conversation
from splatbus_conformance.rules import Rule, Sighting, about, rule


@rule("FRM-2")
def length_within_limits(conversation: Conversation) -> Iterator[Sighting]:
    """FRM-2: every header announces a payload within the limits."""
    for message in conversation.messages:
        yield about(conversation, message, "FRM-2")
    for direction, stream in conversation.streams.items():
        if stream.refused is not None:
            length = int.from_bytes(stream.rest[:4], "little")
            yield Sighting(
                "FRM-2",
                SENDER[direction],
                conversation.channel,
                conversation.number,
                conversation.ended.get(direction, conversation.opened),
                f"the header at byte {stream.refused} of the stream announces {length:,} bytes",
            )


@rule("FRM-1")
def whole_packets(conversation: Conversation) -> Iterator[Sighting]:
    """FRM-1: a stream that its sender ended holds whole packets."""
    for direction, stream in conversation.streams.items():
        if stream.refused is None and (stream.rest or conversation.sent_by(SENDER[direction])):
            cut_short = bool(stream.rest) and direction in conversation.ended
            yield Sighting(
                "FRM-1",
                SENDER[direction],
                conversation.channel,
                conversation.number,
                conversation.ended.get(direction, conversation.opened),
                f"the stream ends {len(stream.rest)} bytes into a packet" if cut_short else None,
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
            apart = f"the header arrived alone, its payload {late:.1f} ms later"
        yield about(conversation, message, "FRM-7", apart)


RULES: tuple[Rule, ...] = (length_within_limits, whole_packets, header_with_payload)
