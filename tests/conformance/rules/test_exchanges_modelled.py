"""Whatever is asked, with whatever ids, the answers of a model that keeps the rules break nothing,
and one too few, one too many or two in the wrong order do where no way of keeping them fits.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import pytest
from hypothesis import assume, event, given
from hypothesis import strategies as st
from splatbus_conformance.rules.exchanges import exchanges
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.message_kinds import REPLY_TO, REQUESTS_1_0

from tests.conformance.rules.talk import (
    ALL_MSG,
    CAMERA,
    POSE,
    SCENE,
    Json,
    Step,
    breaches,
    client,
    error,
    greeting,
    server,
    talk,
)

VALID: dict[str, Json] = {
    "get_viewport_size": {},
    "get_camera_pose": {"cam_idx": 0},
    "get_scene": {},
    "set_viewport": {"width": 8, "height": 6},
    "ping": {},
}
BROKEN: dict[str, Json] = {
    "get_camera_pose": {},
    "set_viewport": {"width": 64, "height": -1},
    "ping": {"t": "noon"},
    "get_something": {},
    "camera_pose": {},
}
IDS = (None, 0, 7)


class Asked(NamedTuple):
    """What the client sends."""

    message: Json
    id: int | None = None
    request: str | None = None
    """Its type, if it is a valid request."""


class Said(NamedTuple):
    """What the server sends, and the message that made it, by its place."""

    message: Json
    cause: int

    @property
    def kind(self) -> str:
        return "error" if self.message.get("type") == "error" else self.message.get("type", "")


Event = Asked | Said


@st.composite
def questions(draw: st.DrawFn) -> list[Asked]:
    """Requests, valid and not, poses and what nobody knows; ids repeat."""
    found = []
    for number in range(draw(st.integers(1, 8))):
        id = draw(st.sampled_from(IDS))
        named = {} if id is None else {"id": id}
        what = draw(st.sampled_from(["valid", "valid", "broken", "pose"]))
        if what == "pose":
            found.append(Asked(POSE))
            continue
        kind = draw(st.sampled_from(sorted(VALID if what == "valid" else BROKEN)))
        members = (VALID if what == "valid" else BROKEN)[kind]
        if what == "valid" and kind == "ping":
            members = {"t": float(number)}
        message = {"type": kind, **members, **named}
        found.append(Asked(message, id, kind if what == "valid" else None))
    return found


@dataclass
class Model:
    """A server that keeps the rules, in any of the ways that they leave."""

    draw: st.DrawFn
    negotiated: bool
    size: list[int] = field(default_factory=lambda: [64, 48])
    clock: float = 0.0

    def answer(self, asked: Asked, place: int) -> Iterator[Said]:
        """What it says to a message."""
        named = {} if asked.id is None else {"id": asked.id}
        if asked.request not in (VALID if self.negotiated else REQUESTS_1_0):
            if self.negotiated and self.draw(st.booleans()):
                carried = named if self.draw(st.booleans()) else {}
                yield Said(error("invalid_message", **carried), place)
        elif not self.negotiated:
            yield Said(self._reply(asked), place)
        elif self.draw(st.integers(0, 3)) == 0:
            yield Said(error("internal", **named), place)
        else:
            typed = {"type": REPLY_TO[asked.request], **named}
            yield Said({**self._reply(asked), **typed}, place)

    def _reply(self, asked: Asked) -> Json:
        self.clock += 1.0
        message = asked.message
        match asked.request:
            case "get_camera_pose":
                return CAMERA
            case "get_scene":
                return SCENE
            case "ping":
                return {"t": message["t"], "serverTime": self.clock}
            case "set_viewport":
                self.size = [message["width"], message["height"]]
        return {"viewport_size": self.size}


@st.composite
def sessions(draw: st.DrawFn, *, negotiated: bool) -> list[Event]:
    """What crosses: requests are answered in order, some at once and some later; what else is said
    comes at any time after what it is about.
    """
    model = Model(draw, negotiated)
    events: list[Event] = []
    replies: list[Said] = []
    others: list[Said] = []
    for place, asked in enumerate(asking := draw(questions())):
        events.append(asked)
        (replies if asked.request else others).extend(model.answer(asked, place))
        last = place == len(asking) - 1
        while (replies or others) and (last or draw(st.booleans())):
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
            if it.request is None and it.id == id and i not in used
        )

    return from_here(0, 0, frozenset())


def fits(said: Said, due: Asked, negotiated: bool) -> bool:
    """Its kind and its id are of an answer to the request; nothing forbids a reply an id that was
    not asked with.
    """
    id, asked_with = said.message.get("id"), due.id if negotiated else None
    named = id == asked_with or (asked_with is None and said.kind != "error")
    meant = "viewport_size" if "viewport_size" in said.message else "camera"
    return named and (said.kind or meant) in ("error", REPLY_TO[due.request or ""])


def accused(events: list[Event], *, negotiated: bool) -> set[str]:
    """What the server is said to have broken, but that it owns up to defects."""
    found = breaches(talk("msg", *steps(events, negotiated=negotiated)))
    return {requirement for peer, requirement in found if peer == "server"} - {"NEG-41"}


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
    (conversation,) = conversations(talk("msg", *steps(events, negotiated=negotiated)))
    heard = [it for it in events if isinstance(it, Asked)]
    greeted = 1 if negotiated else 0
    asked = {
        message.packet.offset: heard[i - greeted]
        for i, message in enumerate(conversation.sent_by("client"))
        if i >= greeted
    }
    said = dict(
        zip(
            (m.packet.offset for m in conversation.sent_by("server")[greeted:]),
            (it for it in events if isinstance(it, Said)),
            strict=True,
        )
    )
    for pair in exchanges(conversation).pairs:
        if pair.certain:
            assert (
                asked[pair.question.packet.offset] is heard[said[pair.answer.packet.offset].cause]
            )


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
