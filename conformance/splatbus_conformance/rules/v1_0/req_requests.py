"""Rules on what a client asks (spec 1.0 section 6.2, spec 1.1 chapters 7 to 9)."""

import math
from collections.abc import Iterator

from splatbus_schemas import LIMITS

from splatbus_conformance.rules import Breach, Sighting, about, deaf, judged, rule
from splatbus_conformance.rules.exchanges import exchanges, request
from splatbus_conformance.wire.conversation import Conversation
from splatbus_conformance.wire.json_values import show, strings
from splatbus_conformance.wire.message_kinds import (
    CLIENT_1_0,
    CLIENT_1_1,
    KNOWN_VERSIONS,
    REQUESTS,
    REQUESTS_1_0,
    vendor,
)


@rule("REQ-1", "REQ-2", "SCN-1", "VPT-1", "PNG-1")
def well_formed_request(conversation: Conversation) -> Iterator[Sighting]:
    """REQ-1, REQ-2, SCN-1, VPT-1, PNG-1: the type of a request, and its members."""
    if conversation.channel == "msg":
        for message, hello, _ in conversation.placed(*REQUESTS):
            if message.kind in (REQUESTS_1_0 if hello is None else REQUESTS):
                yield from judged(message, request(message))


@rule("REQ-14")
def defined_types(conversation: Conversation) -> Iterator[Sighting]:
    """REQ-14: no message of a type that nothing defines.

    What a client that speaks a version unknown to this harness may send, is not judged; EVO-2 and
    EVO-3 judge what has a type on a connection that speaks 1.1, and what has that of a vendor.
    """
    if conversation.channel == "ipc" and conversation.hello is None:
        return
    for message, hello, welcome in conversation.placed():
        if message.sender == "server" or message.value is None:
            continue
        versions = strings(hello.members.get("versions")) if hello else ["1.0"]
        if versions is not None and set(versions) <= KNOWN_VERSIONS:
            wrong = None
            if message.kind not in CLIENT_1_0 and message.kind not in CLIENT_1_1:
                if message.type and hello and (welcome or vendor(message.type)):
                    continue
                kind = show(message.value["type"]) if "type" in message.value else "missing"
                wrong = Breach("unknown-type", f"type is {kind}, which no version defines")
            yield about(message, "REQ-14", wrong, "/type")


@rule("REQ-12")
def asks_again_later(conversation: Conversation) -> Iterator[Sighting]:
    """REQ-12: after a size of `[0,0]`, 100 milliseconds before the next question.

    Of a client that asks while it waits for a reply, a question may have been on its way.
    """
    found = exchanges(conversation)
    unknown = {
        answer.packet.offset
        for _, answer, *_ in found.pairs
        if not answer.faults and answer.members.get("viewport_size") == [0, 0]
    }
    later = [*(pair.question for pair in found.pairs[1:]), *found.unanswered]
    asks_ahead = any(
        question.packet.began < pair.answer.packet.ended
        for pair, question in zip(found.pairs, later, strict=False)
    )
    told: float | None = None
    for message in conversation.messages if unknown and not asks_ahead else ():
        if message.sender == "server" and message.packet.offset in unknown:
            told = message.packet.ended
        elif message.kind == "get_viewport_size" and told is not None:
            waited = message.packet.began - told
            soon = waited < LIMITS["ask_again_min_seconds"]
            text = f"asked again {1000 * waited:.1f} ms after the size was told to be [0,0]"
            wrong = Breach("too-soon", text) if soon else None
            yield about(message, "REQ-12", wrong)
            told = None


@rule("CHN-15")
def waits_have_a_limit(conversation: Conversation) -> Iterator[Sighting]:
    """CHN-15: a client that waits 10 seconds for a reply closes the connection.

    It is held to that once 10 seconds and the 5 that a close may take have passed.
    """
    if deaf(conversation):
        return
    limit = LIMITS["reply_seconds"] + LIMITS["close_seconds"]
    found = exchanges(conversation)
    answered = {question.packet.offset: answer for question, answer, *_ in found.pairs}
    sent = conversation.sent_by("client")
    for question in [*(pair.question for pair in found.pairs), *found.unanswered]:
        asked = question.packet.ended
        answer = answered.get(question.packet.offset)
        if answer is not None and answer.packet.ended < asked + limit:
            continue
        if sent[-1].packet.ended >= asked + limit:
            text = f"still there {sent[-1].packet.ended - asked:.0f} s after an unanswered request"
            yield about(sent[-1], "CHN-15", Breach("not-closed", text))
            return
        if conversation.ended.get("c2s", math.inf) < asked + limit:
            yield about(question, "CHN-15")
