"""Whatever is asked, with whatever ids, the answers of a model that keeps the rules break nothing,
and one too few, one too many or two in the wrong order do where no way of keeping them fits.
"""

from functools import cache
from typing import NamedTuple

import pytest
from hypothesis import assume, event, given
from hypothesis import strategies as st
from splatbus_conformance.rules import sightings
from splatbus_conformance.rules.exchanges import exchanges
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.message_kinds import REPLY_TO, REQUESTS_1_0

from tests.conformance.rules.talk import (
    ALL_MSG,
    CAMERA,
    PONG,
    POSE,
    SCENE,
    SIZE,
    Json,
    Step,
    client,
    error,
    greeting,
    msg,
    server,
)

VALID: dict[str, tuple[Json, Json]] = {
    "get_viewport_size": ({}, SIZE),
    "get_camera_pose": ({"cam_idx": 0}, CAMERA),
    "get_scene": ({}, SCENE),
    "set_viewport": ({"width": 64, "height": 48}, SIZE),
    "ping": ({"t": 12.5}, PONG),
}
"""Requests and their replies."""
OTHERS: list[Json] = [
    *({"type": "get_camera_pose"}, {"type": "set_viewport", "width": 64, "height": -1}),
    *({"type": "ping", "t": "noon"}, {"type": "get_something"}, {"type": "camera_pose"}, POSE),
]
NAMES: list[Json] = [{}, {"id": 0}, {"id": 7}]


class Asked(NamedTuple):
    """What the client sends."""

    message: Json
    request: str | None = None
    """Its type, if it is a valid request."""

    @property
    def named(self) -> Json:
        return {name: it for name, it in self.message.items() if name == "id"}


class Said(NamedTuple):
    """What the server sends, and the message that made it."""

    message: Json
    cause: Asked

    @property
    def kind(self) -> str:
        return str(self.message.get("type", ""))


Event = Asked | Said
KNOWN = [Asked({"type": kind, **members}, kind) for kind, (members, _) in VALID.items()]
QUESTIONS = st.builds(
    lambda asked, name: asked._replace(message={**asked.message, **name}),
    st.sampled_from([*KNOWN, *KNOWN, *map(Asked, OTHERS)]),
    st.sampled_from(NAMES),
)
"""Requests, valid and not, poses and what nobody knows; ids repeat."""


def answer(draw: st.DrawFn, asked: Asked, *, negotiated: bool) -> Json | None:
    """What a server says that keeps the rules, in any of the ways that they leave."""
    if asked.request not in (VALID if negotiated else REQUESTS_1_0):
        named = asked.named if draw(st.booleans()) else {}
        return error("invalid_message", **named) if negotiated and draw(st.booleans()) else None
    _, reply = VALID[asked.request]
    if not negotiated:
        return reply
    if draw(st.integers(0, 3)) == 0:
        return error("internal", **asked.named)
    return {**reply, "type": REPLY_TO[asked.request], **asked.named}


@st.composite
def sessions(draw: st.DrawFn, *, negotiated: bool) -> list[Event]:
    """What crosses: requests are answered in order, some at once and some later; what else is said
    comes at any time after what it is about.
    """
    events: list[Event] = []
    replies: list[Said] = []
    others: list[Said] = []
    asking = draw(st.lists(QUESTIONS, min_size=1, max_size=8))
    for left, asked in zip(reversed(range(len(asking))), asking, strict=True):
        events.append(asked)
        if message := answer(draw, asked, negotiated=negotiated):
            (replies if asked.request else others).append(Said(message, asked))
        while (replies or others) and (not left or draw(st.booleans())):
            chosen = replies if replies and (not others or draw(st.booleans())) else others
            events.append(chosen.pop(0))
    return events


def steps(events: list[Event], *, negotiated: bool) -> list[Step]:
    """As bytes."""
    crossed = [(client if isinstance(it, Asked) else server)(it.message) for it in events]
    capabilities = [name for name in ALL_MSG if name != "intrinsics"]
    return [*greeting(*capabilities), *crossed] if negotiated else crossed


def explained(events: list[Event], *, negotiated: bool) -> bool:
    """Some server that keeps the rules can have said this, as far as kinds, ids and order show."""

    @cache
    def from_here(at: int, answered: int, used: frozenset[int]) -> bool:
        if at == len(events):
            return True
        said = events[at]
        if isinstance(said, Asked):
            return from_here(at + 1, answered, used)
        before = [(i, it) for i, it in enumerate(events[:at]) if isinstance(it, Asked)]
        kinds = VALID if negotiated else REQUESTS_1_0
        known = [it for _, it in before if it.request in kinds]
        due = known[answered] if answered < len(known) else None
        id = said.message.get("id")
        if due and fits(said, due, negotiated) and from_here(at + 1, answered + 1, used):
            return True
        if said.kind != "error":
            return False
        if id is None:
            return from_here(at + 1, answered, used)
        return any(
            from_here(at + 1, answered, used | {i})
            for i, it in before
            if it.request is None and it.named.get("id") == id and i not in used
        )

    return from_here(0, 0, frozenset())


def fits(said: Said, due: Asked, negotiated: bool) -> bool:
    """Its kind and its id are of an answer to the request; nothing forbids a reply an id that was
    not asked with.
    """
    id, asked_with = said.message.get("id"), due.named.get("id") if negotiated else None
    named = id == asked_with or (asked_with is None and said.kind != "error")
    meant = "viewport_size" if "viewport_size" in said.message else "camera"
    return named and (said.kind or meant) in ("error", REPLY_TO[due.request or ""])


def accused(events: list[Event], *, negotiated: bool) -> set[str]:
    """What the server is said to have broken, but that it owns up to defects."""
    found = sightings(msg(*steps(events, negotiated=negotiated)))
    return {it.requirement for it in found if it.breach and it.peer == "server"} - {"NEG-41"}


BOTH = pytest.mark.parametrize("negotiated", [False, True], ids=["1.0", "1.1"])


@BOTH
@given(data=st.data())
def test_a_server_that_keeps_the_rules_is_never_accused(
    data: st.DataObject, negotiated: bool
) -> None:
    events = data.draw(sessions(negotiated=negotiated))
    assert explained(events, negotiated=negotiated)
    assert not accused(events, negotiated=negotiated)


@BOTH
@given(data=st.data())
def test_a_pair_that_is_certain_is_what_the_server_meant(
    data: st.DataObject, negotiated: bool
) -> None:
    events = data.draw(sessions(negotiated=negotiated))
    (conversation,) = conversations(msg(*steps(events, negotiated=negotiated)))
    told = (
        message for message in conversation.messages if message.kind not in ("hello", "welcome")
    )
    meant = dict(zip((it.packet for it in told), events, strict=True))
    for pair in exchanges(conversation).pairs:
        if pair.certain:
            said = meant[pair.answer.packet]
            assert isinstance(said, Said)
            assert said.cause is meant[pair.question.packet]


@BOTH
@pytest.mark.parametrize("how", ["drop", "double", "swap"])
@given(data=st.data())
def test_what_no_server_that_keeps_them_can_have_said_is_a_breach(
    how: str, data: st.DataObject, negotiated: bool
) -> None:
    events = data.draw(sessions(negotiated=negotiated))
    places = [i for i, it in enumerate(events) if isinstance(it, Said)]
    assume(places)
    place = data.draw(st.sampled_from(places))
    said = events[place]
    if how == "drop":
        del events[place]
    elif how == "double":
        events.insert(data.draw(st.integers(place, len(events))), said)
    else:
        other = data.draw(st.sampled_from(places))
        events[place], events[other] = events[other], said
    possible = explained(events, negotiated=negotiated)
    event("possible" if possible else "impossible")
    if not possible:
        assert accused(events, negotiated=negotiated)
