"""Rules on telemetry (spec 1.1 annex A)."""

from collections.abc import Iterator
from typing import Any

from splatbus_schemas import LIMITS

from splatbus_conformance.rules import Breach, Judgement, Rule, Sighting, about, judged, rule
from splatbus_conformance.rules.exchanges import exchanges
from splatbus_conformance.rules.members import count, each_once, named, number
from splatbus_conformance.rules.v1_1.mem import capabilities
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import (
    MAX_CHARS,
    ascending,
    integer_in,
    show,
    strings,
    text_of,
    whole,
)

Json = dict[str, Any]
Names = frozenset[str] | None
"""What a client has subscribed to; None for all."""
MAX_SERIES: int = LIMITS["max_series"]
MAX_EDGES: int = LIMITS["max_edges"]
MAX_TEXT: int = LIMITS["max_text_chars"]
KINDS = ("scalar", "histogram", "text")


@rule("TEL-1")
def well_formed_wish(conversation: Conversation) -> Iterator[Sighting]:
    """TEL-1: the members of `subscribe_telemetry`."""
    for message, hello, _ in conversation.placed("subscribe_telemetry"):
        if hello is not None:
            yield from judged(conversation, message, wish(message.value or {}))


@rule("TEL-2")
def well_formed_telemetry(conversation: Conversation) -> Iterator[Sighting]:
    """TEL-2: the members of `telemetry`, and `seq` that grows."""
    newest = -1
    for message, hello, _ in conversation.placed("telemetry"):
        if hello is not None:
            value = message.value or {}
            yield from judged(conversation, message, _telemetry(value, newest))
            newest = max(newest, whole(value.get("seq"), 0) or 0)


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
        value = message.value or {}
        if message.kind == "subscribe_telemetry":
            if message.faults or any(judgement.breach for judgement in wish(value)):
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
            if "telemetry" not in (capabilities(welcome) or ()):
                wrong = Breach("not-granted", "telemetry, although no welcome lists it")
            yield about(conversation, message, "TEL-3", wrong, "/series")


def wish(value: Json) -> Iterator[Judgement]:
    """What a `subscribe_telemetry` shows of TEL-1."""
    has = show(value["names"]) if "names" in value else "missing"
    names = value.get("names", ...)
    listed = strings(names)
    fits = names is None or (
        listed is not None
        and len(listed) <= MAX_SERIES
        and len(set(listed)) == len(listed)
        and all(text_of(name, 1, MAX_CHARS) for name in listed)
    )
    text = (
        f"names is {has}, neither null nor up to {MAX_SERIES} different strings"
        f" of 1 to {MAX_CHARS} characters"
    )
    yield Judgement("TEL-1", None if fits else Breach("wrong-names", text), "/names")


def _telemetry(value: Json, newest: int) -> Iterator[Judgement]:
    yield count(value, "seq", "TEL-2", "")
    seq = whole(value.get("seq"), 0)
    if seq is not None and seq <= newest:
        yield Judgement("TEL-2", Breach("not-growing", f"seq {seq} comes after {newest}"), "/seq")
    yield number(value, "time", "TEL-2", "")
    series = value.get("series")
    if not (isinstance(series, list) and 1 <= len(series) <= MAX_SERIES):
        text = f"series is {show(series)}, no array of 1 to {MAX_SERIES} objects"
        yield Judgement("TEL-2", Breach("not-an-array", text), "/series")
        return
    for i, item in enumerate(series):
        yield from _series(item, f"/series/{i}")
    yield from each_once(series, "name", "TEL-2", "/series")


def _series(item: object, pointer: str) -> Iterator[Judgement]:
    if not isinstance(item, dict):
        yield Judgement("TEL-2", Breach("not-an-object", f"{show(item)} is no object"), pointer)
        return
    yield named(item, "name", "TEL-2", pointer)
    kind = item.get("kind")
    if kind == "scalar":
        yield number(item, "value", "TEL-2", pointer)
        if "unit" in item:
            yield named(item, "unit", "TEL-2", pointer, least=0)
    elif kind == "histogram":
        yield from _histogram(item.get("edges"), item.get("counts"), pointer)
    elif kind == "text":
        text = f"value is {show(item.get('value'))}, no string of up to {MAX_TEXT:,} characters"
        fits = text_of(item.get("value"), 0, MAX_TEXT)
        wrong = None if fits else Breach("bad-string", text)
        yield Judgement("TEL-2", wrong, f"{pointer}/value")
    else:
        has = show(kind) if "kind" in item else "missing"
        breach = Breach("unknown-kind", f"kind is {has}, which is not in the table")
        yield Judgement("TEL-2", breach, f"{pointer}/kind")


def _histogram(edges: object, counts: object, pointer: str) -> Iterator[Judgement]:
    if not ascending(edges, 2, MAX_EDGES, strictly=True):
        text = f"edges is {show(edges)}, no array of 2 to {MAX_EDGES:,} ascending numbers"
        yield Judgement("TEL-2", Breach("wrong-edges", text), f"{pointer}/edges")
        return
    assert isinstance(edges, list)
    fits = isinstance(counts, list) and len(counts) == len(edges) - 1
    if not (fits and isinstance(counts, list) and all(integer_in(each, 0) for each in counts)):
        text = f"counts is {show(counts)}, not {len(edges) - 1} integers from 0"
        yield Judgement("TEL-2", Breach("wrong-counts", text), f"{pointer}/counts")


def _unwanted(message: Message, possible: list[tuple[int, Names]]) -> Breach | None:
    """What is wrong with the series, where one of these subscriptions is in force."""
    series = (message.value or {}).get("series")
    names = (
        [each.get("name") for each in series if isinstance(each, dict)]
        if isinstance(series, list)
        else []
    )
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


RULES: tuple[Rule, ...] = (well_formed_wish, well_formed_telemetry, only_what_was_asked_for)
