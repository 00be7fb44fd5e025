"""Rules on telemetry (spec 1.1 annex A)."""

from collections.abc import Iterator

from splatbus_conformance.rules import (
    Breach,
    Json,
    Judgement,
    Sighting,
    about,
    greeted,
    judged,
    kept,
    rule,
)
from splatbus_conformance.rules.exchanges import exchanges
from splatbus_conformance.rules.form import each_once, form, growing
from splatbus_conformance.rules.v1_1.mem import lists
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import (
    array,
    ascending,
    numbers,
    show,
    whole,
    within,
)

Names = frozenset[str] | None
"""What a client has subscribed to; None for all."""


@rule("TEL-1")
def well_formed_wish(conversation: Conversation) -> Iterator[Sighting]:
    """TEL-1: the members of `subscribe_telemetry`."""
    for message in greeted(conversation, "subscribe_telemetry"):
        yield from judged(message, wish(message.members))


@rule("TEL-2")
def well_formed_telemetry(conversation: Conversation) -> Iterator[Sighting]:
    """TEL-2: the members of `telemetry`, and `seq` that grows."""
    newest = -1
    for message in greeted(conversation, "telemetry"):
        yield from judged(message, _telemetry(message.members, newest))
        newest = max(newest, whole(message.members.get("seq"), 0) or 0)


@rule("TEL-3")
def only_what_was_asked_for(conversation: Conversation) -> Iterator[Sighting]:
    """TEL-3: `telemetry` only where that was agreed, and only the series subscribed to.

    A `subscribe_telemetry` has certainly arrived once a request sent after it is answered; until
    then the one before it may still be in force. After one that breaks TEL-1 nothing is judged.
    """
    questions = {
        pair.answer.packet.offset: pair.question.packet.offset
        for pair in exchanges(conversation).pairs
    }
    possible: list[tuple[int, Names]] = [(-1, frozenset())]
    for message, hello, welcome in conversation.placed():
        value = message.members
        if message.kind == "subscribe_telemetry":
            if message.faults or not kept(wish(value)):
                return
            names = value["names"]
            asked_for = None if names is None else frozenset(names)
            possible.append((message.packet.offset, asked_for))
        elif message.sender == "server" and message.packet.offset in questions:
            asked = questions[message.packet.offset]
            newest = max((offset for offset, _ in possible if offset < asked), default=-1)
            possible = [each for each in possible if each[0] >= newest]
        elif message.kind == "telemetry" and hello is not None:
            wrong = _unwanted(message, possible)
            if not lists(welcome, "telemetry"):
                wrong = Breach("not-granted", "telemetry, although no welcome lists it")
            yield about(message, "TEL-3", wrong, "/series")


def wish(value: Json) -> Iterator[Judgement]:
    """What a `subscribe_telemetry` shows of TEL-1."""
    return form(value, "subscribe_telemetry", "TEL-1")


def _telemetry(value: Json, newest: int) -> Iterator[Judgement]:
    yield from form(value, "telemetry", "TEL-2")
    yield from growing(value, "seq", newest, "TEL-2")
    series = array(value.get("series"))
    yield from each_once(series, "name", "TEL-2", "/series")
    for i, item in enumerate(series):
        edges, counts = within(item, "edges"), within(item, "counts")
        if within(item, "kind") != "histogram" or not numbers(edges, len(array(edges))):
            continue
        if not ascending(edges, len(edges), strictly=True):
            wrong = Breach("wrong-edges", f"edges is {show(edges)}, in which none is to fall")
            yield Judgement("TEL-2", wrong, f"/series/{i}/edges")
        elif isinstance(counts, list) and len(counts) != len(edges) - 1:
            wrong = Breach("wrong-counts", f"counts is {show(counts)}, not {len(edges) - 1}")
            yield Judgement("TEL-2", wrong, f"/series/{i}/counts")


def _unwanted(message: Message, possible: list[tuple[int, Names]]) -> Breach | None:
    """What is wrong with the series, where one of these subscriptions is in force."""
    names = [within(each, "name") for each in array(message.members.get("series"))]
    wanted = [asked_for for _, asked_for in possible]
    if all(asked_for == frozenset() for asked_for in wanted):
        return Breach("not-subscribed", "telemetry, although the client has subscribed to none")
    if None in wanted:
        return None
    allowed: frozenset[str] = frozenset().union(*(each for each in wanted if each is not None))
    stray = [name for name in names if isinstance(name, str) and name not in allowed]
    if not stray:
        return None
    text = f"series {show(stray[0])}, which the client has not subscribed to"
    return Breach("another-series", text)
