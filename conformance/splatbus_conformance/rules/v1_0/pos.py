"""Rules on poses (spec 1.0 section 6.1)."""

from collections.abc import Iterator

from splatbus_conformance.rules import Breach, Json, Judgement, Sighting, about, judged, rule
from splatbus_conformance.rules.form import form, unit_norm
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import is_number, show, unspeakable, within
from splatbus_conformance.wire.message_kinds import CLIENT_1_0, POSES

STAMPED = (*CLIENT_1_0, "object_pose")
MEMBERS = {"position": "xyz", "rotation": "xyzw"}


@rule("POS-1", "POS-2", "POS-3", "POS-4")
def well_formed_pose(conversation: Conversation) -> Iterator[Sighting]:
    """POS-1 to POS-4: members and their order, magnitude of positions, norm of rotations."""
    if conversation.channel == "msg":
        for message in conversation.of(*POSES):
            yield from judged(message, pose(message.members))


@rule("POS-8")
def timestamp_is_a_number(conversation: Conversation) -> Iterator[Sighting]:
    """POS-8: a timestamp is a number."""
    for message in _stamped(conversation):
        version = "1.0" if message.kind in CLIENT_1_0 else "1.1"
        shown = form(message.members, str(message.kind), "POS-8", version=version)
        yield from judged(message, shown)


@rule("POS-9")
def timestamps_do_not_decrease(conversation: Conversation) -> Iterator[Sighting]:
    """POS-9: a timestamp is not less than the one before it."""
    before: float | None = None
    for message in _stamped(conversation):
        assert message.value is not None
        timestamp = message.value["timestamp"]
        if is_number(timestamp) and not unspeakable(timestamp):
            wrong = None
            if before is not None and timestamp < before:
                text = f"timestamp is {show(timestamp)} after {show(before)}"
                wrong = Breach("went-back", text)
            yield about(message, "POS-9", wrong, "/timestamp")
            before = timestamp


def pose(value: Json) -> Iterator[Judgement]:
    """What a pose shows of POS-1 to POS-4."""
    kind = value.get("type")
    shows = ["POS-1", *(["POS-2"] if isinstance(value.get("position"), dict) else [])]
    yield from form(value, str(kind) if kind in POSES else POSES[0], *shows, version="1.0")
    yield from unit_norm([within(value, "rotation", name) for name in "xyzw"], "POS-3")
    for name, members in MEMBERS.items():
        part = value.get(name)
        order = "".join(it for it in part if it in set(members)) if isinstance(part, dict) else ""
        if sorted(order) == sorted(members):
            text = f"the members of {name} stand in the order {', '.join(order)}"
            wrong = Breach("wrong-order", text) if order != members else None
            yield Judgement("POS-4", wrong, f"/{name}")


def _stamped(conversation: Conversation) -> Iterator[Message]:
    for message in conversation.of(*STAMPED):
        if "timestamp" in message.members and conversation.channel == "msg":
            yield message
