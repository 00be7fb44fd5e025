"""Rules on what a server answers (spec 1.0 section 6.2, spec 1.1 section 2.6)."""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.rules import Breach, Judgement, Sighting, about, judged, kept, rule
from splatbus_conformance.rules.exchanges import exchanges, valid_request
from splatbus_conformance.rules.form import form, greeting, unit_norm
from splatbus_conformance.rules.v1_0.ini import size
from splatbus_conformance.rules.v1_0.pos import pose
from splatbus_conformance.rules.v1_0.req_blame import caused, without_reply
from splatbus_conformance.rules.v1_1.obj import STEERING
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import (
    array,
    integer_in,
    show,
    whole,
)
from splatbus_conformance.wire.message_kinds import (
    CLIENT_1_1,
    CLOSING_ERRORS,
    POSES,
    REPLY_TO,
    REQUESTS,
)

MAX_SIZE: int = LIMITS["max_image_size"]
JUDGED = {**dict.fromkeys(POSES, pose), **STEERING, "hello": greeting}
"""What messages show that are no requests, which a server may close on."""


class Size(NamedTuple):
    """The size of the images, as an init packet announced it."""

    t: float
    size: tuple[int, int]


@rule("REQ-3", "REQ-5")
def well_formed_reply(conversation: Conversation) -> Iterator[Sighting]:
    """REQ-3, REQ-5: the members of a reply, their numbers, and the camera's rotation."""
    for question, answer, *_ in exchanges(conversation).pairs:
        if answer.value is not None and answer.kind != "error":
            if question.kind == "get_viewport_size":
                yield from judged(answer, viewport_size(answer.value))
            elif question.kind == "get_camera_pose":
                yield from judged(answer, camera(answer.value))


@rule("REQ-4")
def size_of_the_images(conversation: Conversation) -> Iterator[Sighting]:
    """REQ-4: the size told is that of the init packet, or `[0,0]` while nothing was rendered.

    An init packet counts from when it was sent, on whichever connection, and so does a size that a
    `set_viewport` was granted, which an init packet follows (VPT-5); that an image was rendered
    shows when a `frame` is sent, on whichever connection.
    """
    announced = sizes(conversation)
    rendered = _rendered(conversation.recording)
    for question, answer, *_ in exchanges(conversation).pairs:
        told = size_told(answer)
        if question.kind != "get_viewport_size" or told is None:
            continue
        asked = question.packet.ended
        before, allowed = sizes_at(announced, asked)
        wrong = None
        if told == (0, 0):
            text = "the size is told to be [0, 0] after a frame"
            wrong = Breach("unknown-size", text) if rendered < asked else None
        elif 0 in told:
            wrong = Breach("zero-side", f"the size is told to be {list(told)}")
        elif before and told not in allowed:
            text = f"the size is told to be {list(told)}, the init packet said {list(before)}"
            wrong = Breach("wrong-size", text)
        if wrong or before:
            yield about(answer, "REQ-4", wrong, "/viewport_size")


@rule("REQ-7", "NEG-29")
def one_answer_each_in_order(conversation: Conversation) -> Iterator[Sighting]:
    """REQ-7, after `hello` NEG-29: one answer to each valid request, in order.

    That one is missing shows when a later one is answered, or when the server ends the connection
    of a faultless client that it had served, with no other connection to prefer to it.
    """
    found = exchanges(conversation)
    negotiated = conversation.welcome is not None
    for pair in found.pairs:
        requirement = "NEG-29" if pair.asked_after_hello and negotiated else "REQ-7"
        text = f"this answers a request after {pair.late} that had no answer yet"
        late = Breach("out-of-order", text)
        yield about(pair.answer, requirement, late if pair.late else None)
    for extra in caused(conversation):
        if extra.requirement == "REQ-7":
            text = "a reply that nothing asked for"
            yield about(extra.answer, "REQ-7", Breach("unasked-reply", text))
    if found.unanswered and _left_by_the_server(conversation):
        hello = conversation.hello
        for question in found.unanswered:
            after = hello is not None and hello.packet.offset < question.packet.offset
            requirement = "NEG-29" if after and negotiated else "REQ-7"
            text = "the server ended the connection without answering this request"
            wrong = Breach("not-answered", text)
            yield about(question, requirement, wrong, peer="server")


@rule("CHN-11", "JSN-8", "POS-10", "REQ-8", "REQ-9")
def nothing_but_replies(conversation: Conversation) -> Iterator[Sighting]:
    """CHN-11, JSN-8, POS-10, REQ-8, REQ-9: what has no reply, by what was sent before it."""
    found = exchanges(conversation)
    causes = set()
    for answer, cause, requirement in caused(conversation):
        if requirement != "REQ-7":
            wrong = Breach("unasked-packet", "a packet unasked")
            if cause is not None:
                text = f"a packet after a message of type {show(cause.type)}"
                wrong = Breach("answered", text)
            yield about(answer, requirement, wrong)
            causes.add(cause.packet.offset if cause else None)
    if conversation.hello is None:
        for pair in found.pairs:
            yield about(pair.answer, "CHN-11")
    for message in conversation.sent_by("client"):
        left_alone = without_reply(message)
        if conversation.channel == "msg" and left_alone and message.packet.offset not in causes:
            yield about(message, left_alone, peer="server")


@rule("NEG-28")
def typed_replies(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-28: after `welcome`, a reply has its type and the id of its request."""
    for pair in exchanges(conversation).pairs:
        spoiled = pair.answer.value is None or pair.answer.kind == "error"
        if pair.welcomed and not spoiled:
            yield from judged(pair.answer, _typed(pair.question.members, pair.answer))


@rule("CHN-16")
def answers_before_the_end(conversation: Conversation) -> Iterator[Sighting]:
    """CHN-16: requests that came whole before the client's end of stream are answered.

    Judged once the server has ended its own stream after the client's.
    """
    ended = conversation.ended
    half_closed = ended.get("c2s", math.inf) <= ended.get("s2c", -math.inf)
    found = exchanges(conversation)
    if half_closed and not conversation.resets and _complete(conversation):
        missing = found.unanswered
        if missing and _faultless(conversation):
            text = f"the server closed with {len(missing)} requests unanswered"
            wrong = Breach("not-answered", text)
            yield about(missing[0], "CHN-16", wrong, peer="server")
        elif found.pairs and not missing:
            yield about(found.pairs[-1].answer, "CHN-16")


def viewport_size(value: dict[str, Any]) -> Iterator[Judgement]:
    """What the reply to `get_viewport_size` shows of REQ-3."""
    yield from form(value, "viewport_size_reply", "REQ-3", version="1.0")
    for i, part in enumerate(array(value.get("viewport_size"))):
        if isinstance(part, float) and part.is_integer():
            wrong = Breach("out-of-range", f"{show(part)} is no plain integer")
            yield Judgement("REQ-3", wrong, f"/viewport_size/{i}")


def camera(value: dict[str, Any]) -> Iterator[Judgement]:
    """What the reply to `get_camera_pose` shows of REQ-5."""
    yield from form(value, "camera_pose_reply", "REQ-5", version="1.0")
    yield from unit_norm(value.get("rotation"), "REQ-5")


def _typed(question: dict[str, Any], answer: Message) -> Iterator[Judgement]:
    value = answer.members
    kind = REPLY_TO[str(question["type"])]
    if answer.type != kind:
        has = show(value["type"]) if "type" in value else "missing"
        yield Judgement("NEG-28", Breach("wrong-type", f'type is {has}, not "{kind}"'), "/type")
    else:
        yield Judgement("NEG-28")
    if integer_in(question.get("id"), 0) and value.get("id") != question["id"]:
        has = show(value["id"]) if "id" in value else "missing"
        text = f"id is {has}, the request's was {show(question['id'])}"
        yield Judgement("NEG-28", Breach("another-id", text), "/id")


def size_told(answer: Message) -> tuple[int, int] | None:
    """The size that a reply tells, if it does."""
    if answer.value is None or not kept(viewport_size(answer.value)):
        return None
    width, height = (whole(part) for part in answer.value["viewport_size"])
    return None if width is None or height is None else (width, height)


def sizes(conversation: Conversation) -> list[Size]:
    """The sizes of the server's images, on whichever connection they were announced or granted."""
    return _sizes(conversation.recording)


@lru_cache(maxsize=1)  # each conversation of a recording asks for the same
def _sizes(recording: Conversation) -> list[Size]:
    found = []
    for each in recording.beside or [recording]:
        asked_for: set[tuple[object, object]] = set()
        replies = ["viewport_size"] if each.of("set_viewport") else []
        for message in each.of("init_packet", "set_viewport", *replies):
            value = message.members
            known = None
            if message.kind == "init_packet":
                known = size(value.get("meta"))
            elif message.kind == "set_viewport":
                asked_for.add((whole(value.get("width")), whole(value.get("height"))))
            elif asked_for:
                told = size_told(message)
                known = told if told in asked_for else None
            if known is not None:
                found.append(Size(message.packet.ended, known))
    return sorted(found)


def sizes_at(
    announced: list[Size], t: float
) -> tuple[tuple[int, int] | None, set[tuple[int, int]]]:
    """The size of the images at a time, if it is known, and all that they may have had since."""
    before = [earlier for at, earlier in announced if at < t]
    allowed = {*before[-1:], *(later for at, later in announced if at >= t)}
    return (before[-1] if before else None), allowed


@lru_cache(maxsize=1)
def _rendered(recording: Conversation) -> float:
    """When the first `frame` was sent, in seconds; infinity if none was."""
    conversations = recording.beside or [recording]
    frames = (message.packet.ended for each in conversations for message in each.of("frame"))
    return min(frames, default=math.inf)


def _left_by_the_server(conversation: Conversation) -> bool:
    """The server ended a connection that it served, of its own accord."""
    end = conversation.ended.get("s2c", math.inf)
    return (
        end < conversation.ended.get("c2s", math.inf)
        and bool(conversation.sent_by("server"))
        and _complete(conversation)
        and _faultless(conversation)
        and not any(
            other.channel == conversation.channel and conversation.opened < other.opened <= end
            for other in conversation.beside
        )
    )


def _complete(conversation: Conversation) -> bool:
    """Both streams could be read to their end."""
    return not any(s.rest or s.refused is not None for s in conversation.streams.values())


def _faultless(conversation: Conversation) -> bool:
    """The client gave its server no reason to close, and was told of none."""
    told = any(
        message.members.get("code") in CLOSING_ERRORS for message in conversation.of("error")
    )
    return not told and all(_sound(message) for message in conversation.sent_by("client"))


def _sound(message: Message) -> bool:
    if message.value is None or message.faults:
        return False
    if message.kind in REQUESTS:
        return valid_request(message)
    if message.kind in JUDGED:
        return kept(JUDGED[message.kind](message.value))
    return message.kind in CLIENT_1_1
