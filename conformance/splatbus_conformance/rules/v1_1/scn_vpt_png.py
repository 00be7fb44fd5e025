"""Rules on the replies that capabilities of 1.1 promise (spec 1.1 chapters 7 to 9)."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from splatbus_conformance.rules import Breach, Json, Judgement, Sighting, about, judged, rule
from splatbus_conformance.rules.exchanges import Exchange, exchanges
from splatbus_conformance.rules.form import each_once, form
from splatbus_conformance.rules.v1_0.req_replies import size_told
from splatbus_conformance.rules.v1_1.mem import lists
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import (
    array,
    as_double,
    finite,
    finites,
    is_number,
    show,
    unspeakable,
    whole,
    within,
)
from splatbus_conformance.wire.message_kinds import NEEDS


@rule("SCN-2")
def scenes_are_told(conversation: Conversation) -> Iterator[Sighting]:
    """SCN-2: `get_scene` is answered with `scene`, and the members of that."""
    for pair in granted(conversation, "get_scene"):
        yield from judged(pair.answer, _promised(pair, "SCN-2", _scene))


@rule("VPT-2")
def viewports_are_as_asked(conversation: Conversation) -> Iterator[Sighting]:
    """VPT-2: `set_viewport` is answered with the size asked for, or an `error`."""
    for question, answer, *_ in granted(conversation, "set_viewport"):
        asked = tuple(whole(question.members.get(side)) for side in ("width", "height"))
        told = size_told(answer)
        kept = answer.kind == "error" or told == asked
        text = f"viewport_size is {show(told)}, {list(asked)} was asked for"
        wrong = None if kept else Breach("wrong-size", text)
        yield about(answer, "VPT-2", wrong, "/viewport_size")


@rule("PNG-2")
def pings_are_returned(conversation: Conversation) -> Iterator[Sighting]:
    """PNG-2: `ping` is answered with `pong`, the same `t`, and the server's time."""
    for pair in granted(conversation, "ping"):
        yield from judged(pair.answer, _promised(pair, "PNG-2", _pong))


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
        yield about(answer, "PNG-3", wrong, "/serverTime")


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
            yield about(message, "PNG-3", wrong, "/renderedAt")
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
    time = message.members.get(name)
    if message.kind not in kinds or not is_number(time) or unspeakable(time):
        return None
    return as_double(time)


def granted(conversation: Conversation, kind: str) -> Iterator[Exchange]:
    """The answers to faultless requests of a kind that `welcome` agrees to."""
    if lists(conversation.welcome, NEEDS[kind]):
        for pair in exchanges(conversation).pairs:
            readable = pair.answer.value is not None
            if pair.question.kind == kind and pair.welcomed and pair.certain and readable:
                yield pair


def _promised(
    pair: Exchange, requirement: str, content: Callable[[Json, Json], Iterator[Judgement]]
) -> Iterator[Judgement]:
    """What an answer shows of the requirement that promises it: `internal` owns up to a defect."""
    value = pair.answer.members
    if pair.answer.kind != "error":
        named = ("/type", "/id")  # by NEG-28
        shown = content(value, pair.question.members)
        yield from (it for it in shown if it.pointer not in named)
    elif value.get("code") != "internal":
        text = f"answered by error {show(value.get('code'))}"
        yield Judgement(requirement, Breach("answered-by-error", text), "/code")


def _scene(value: Json, _: Json) -> Iterator[Judgement]:
    yield from form(value, "scene", "SCN-2")
    objects, times = array(value.get("objects")), finites(value.get("timeRange"), 2)
    yield from each_once(objects, "id", "SCN-2", "/objects")
    for i, item in enumerate(objects):
        low, high = (finites(within(item, "bounds", name), 3) for name in ("min", "max"))
        if low and high and any(a > b for a, b in zip(low, high, strict=True)):
            wrong = Breach("min-beyond-max", f"min {show(low)} is beyond max {show(high)}")
            yield Judgement("SCN-2", wrong, f"/objects/{i}/bounds")
    if times and times[0] > times[1]:
        wrong = Breach("not-a-range", f"timeRange is {show(times)}, which ends before it begins")
        yield Judgement("SCN-2", wrong, "/timeRange")


def _pong(value: Json, asked: Json) -> Iterator[Judgement]:
    yield from form(value, "pong", "PNG-2")
    told = finite(value.get("t"))
    if told is not None and told != as_double(asked["t"]):
        text = f"t is {show(value['t'])}, the ping's was {show(asked['t'])}"
        yield Judgement("PNG-2", Breach("another-time", text), "/t")
