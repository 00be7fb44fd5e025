"""Rules on the replies that capabilities of 1.1 promise (spec 1.1 chapters 7 to 9)."""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.rules import Breach, Judgement, Rule, Sighting, about, judged, rule
from splatbus_conformance.rules.exchanges import Exchange, exchanges
from splatbus_conformance.rules.members import count, each_once, named, number, vector
from splatbus_conformance.rules.v1_0.req_replies import size_told
from splatbus_conformance.rules.v1_1.mem import capabilities
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import (
    as_double,
    ascending,
    is_number,
    show,
    unspeakable,
    whole,
)
from splatbus_conformance.wire.message_kinds import NEEDS

Json = dict[str, Any]
MAX_OBJECTS: int = LIMITS["max_objects"]


@rule("SCN-2")
def scenes_are_told(conversation: Conversation) -> Iterator[Sighting]:
    """SCN-2: `get_scene` is answered with `scene`, and the members of that."""
    for pair in granted(conversation, "get_scene"):
        yield from judged(conversation, pair.answer, _promised(pair, "SCN-2", _scene))


@rule("VPT-2")
def viewports_are_as_asked(conversation: Conversation) -> Iterator[Sighting]:
    """VPT-2: `set_viewport` is answered with the size asked for, or an `error`."""
    for question, answer, *_ in granted(conversation, "set_viewport"):
        asked = tuple(whole((question.value or {}).get(side)) for side in ("width", "height"))
        told = size_told(answer)
        kept = answer.kind == "error" or told == asked
        text = f"viewport_size is {show(told)}, {list(asked)} was asked for"
        wrong = None if kept else Breach("wrong-size", text)
        yield about(conversation, answer, "VPT-2", wrong, "/viewport_size")


@rule("PNG-2")
def pings_are_returned(conversation: Conversation) -> Iterator[Sighting]:
    """PNG-2: `ping` is answered with `pong`, the same `t`, and the server's time."""
    for pair in granted(conversation, "ping"):
        yield from judged(conversation, pair.answer, _promised(pair, "PNG-2", _pong))


@rule("PNG-3")
def clocks_do_not_go_back(conversation: Conversation) -> Iterator[Sighting]:
    """PNG-3: `serverTime` and `renderedAt` are no less than what had been told before.

    A frame is compared with the one before it on the connection; a pong with the pongs, and with
    the frames on whichever connection, that had come between the opening of its own connection and
    its ping: then it is one server that told them all.
    """
    if conversation.channel == "ipc":
        yield from _frames_go_on(conversation)
        return
    pongs = sorted(
        (pair for pair in exchanges(conversation).pairs if _time(pair.answer, "pong") is not None),
        key=lambda pair: pair.question.packet.began,
    )
    told = _told(conversation) if pongs else []
    newest = -math.inf
    for question, answer, *_ in pongs:
        while told and told[-1].at < question.packet.began:
            newest = max(newest, told.pop().time)
        time = _time(answer, "pong") or 0.0
        text = f"serverTime is {show(time)}; {show(newest)} was told before it was asked"
        wrong = Breach("went-back", text) if time < newest else None
        yield about(conversation, answer, "PNG-3", wrong, "/serverTime")


class _Told(NamedTuple):
    """A time on the server's clock, and when it was told."""

    at: float
    time: float


def _frames_go_on(conversation: Conversation) -> Iterator[Sighting]:
    newest = -math.inf
    for message in conversation.of("frame"):
        time = _time(message, "frame")
        if time is not None:
            text = f"renderedAt is {show(time)} after {show(newest)}"
            wrong = Breach("went-back", text) if time < newest else None
            yield about(conversation, message, "PNG-3", wrong, "/renderedAt")
            newest = time


def _told(conversation: Conversation) -> list[_Told]:
    """What was told while a connection was open, the last first."""
    found = [
        _Told(message.packet.ended, time)
        for each in conversation.beside or [conversation]
        for message in each.of("frame", "pong")
        if each.channel == "ipc" or each is conversation
        if message.packet.ended > conversation.opened
        if (time := _time(message, "frame", "pong")) is not None
    ]
    return sorted(found, reverse=True)


def _time(message: Message, *kinds: str) -> float | None:
    """The time on the server's clock that a message of one of these kinds tells, if it does."""
    name = {"frame": "renderedAt", "pong": "serverTime"}.get(message.kind or "", "")
    time = (message.value or {}).get(name)
    if message.kind not in kinds or not is_number(time) or unspeakable(time):
        return None
    return as_double(time)


def granted(conversation: Conversation, kind: str) -> Iterator[Exchange]:
    """The answers to faultless requests of a kind that `welcome` agrees to."""
    if NEEDS[kind] in (capabilities(conversation.welcome) or ()):
        for pair in exchanges(conversation).pairs:
            readable = pair.answer.value is not None
            if pair.question.kind == kind and pair.welcomed and pair.certain and readable:
                yield pair


def _promised(
    pair: Exchange, requirement: str, content: Callable[[Json, Json], Iterator[Judgement]]
) -> Iterator[Judgement]:
    """What an answer shows of the requirement that promises it: `internal` owns up to a defect."""
    value = pair.answer.value or {}
    if pair.answer.kind != "error":
        yield from content(value, pair.question.value or {})
    elif value.get("code") != "internal":
        text = f"answered by error {show(value.get('code'))}"
        yield Judgement(requirement, Breach("answered-by-error", text), "/code")


def _scene(value: Json, _: Json) -> Iterator[Judgement]:
    objects, times = value.get("objects"), value.get("timeRange", "missing")
    if isinstance(objects, list) and 1 <= len(objects) <= MAX_OBJECTS:
        for i, item in enumerate(objects):
            yield from _object(item, f"/objects/{i}")
        yield from each_once(objects, "id", "SCN-2", "/objects")
        ids = [item.get("id") for item in objects if isinstance(item, dict)]
        breach = Breach("no-default", 'no object has the id "default"')
        yield Judgement("SCN-2", None if "default" in ids else breach, "/objects")
    else:
        text = f"objects is {show(objects)}, no array of 1 to {MAX_OBJECTS} objects"
        yield Judgement("SCN-2", Breach("not-an-array", text), "/objects")
    if times is not None:
        breach = Breach("not-a-range", f"timeRange is {show(times)}, no two times")
        yield Judgement("SCN-2", None if ascending(times, 2) else breach, "/timeRange")
    yield count(value, "cameras", "SCN-2", "")
    yield vector(value, "origin", "SCN-2", "")


def _object(item: object, pointer: str) -> Iterator[Judgement]:
    if not isinstance(item, dict):
        yield Judgement("SCN-2", Breach("not-an-object", f"{show(item)} is no object"), pointer)
        return
    yield named(item, "id", "SCN-2", pointer)
    yield named(item, "name", "SCN-2", pointer, least=0)
    yield count(item, "gaussians", "SCN-2", pointer)
    bounds = item.get("bounds", "missing")
    if isinstance(bounds, dict):
        ends = [vector(bounds, name, "SCN-2", f"{pointer}/bounds") for name in ("min", "max")]
        yield from ends
        if not any(end.breach for end in ends):
            turned = any(a > b for a, b in zip(bounds["min"], bounds["max"], strict=True))
            text = f"min {show(bounds['min'])} is beyond max {show(bounds['max'])}"
            wrong = Breach("min-beyond-max", text) if turned else None
            yield Judgement("SCN-2", wrong, f"{pointer}/bounds")
    elif bounds is not None:
        text = f"bounds is {show(bounds)}, neither null nor an object"
        yield Judgement("SCN-2", Breach("not-an-object", text), f"{pointer}/bounds")


def _pong(value: Json, asked: Json) -> Iterator[Judgement]:
    has = show(value["t"]) if "t" in value else "missing"
    same = is_number(value.get("t")) and as_double(value["t"]) == as_double(asked["t"])
    text = f"t is {has}, the ping's was {show(asked['t'])}"
    fine = same or unspeakable(value.get("t"))
    yield Judgement("PNG-2", None if fine else Breach("another-time", text), "/t")
    yield number(value, "serverTime", "PNG-2", "")


RULES: tuple[Rule, ...] = (
    scenes_are_told,
    viewports_are_as_asked,
    pings_are_returned,
    clocks_do_not_go_back,
)
