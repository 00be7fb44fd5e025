"""Rules on poses (spec 1.0 section 6.1)."""

import math
from collections.abc import Collection, Iterator
from typing import Any

from splatbus_schemas import LIMITS

from splatbus_conformance.rules import Breach, Judgement, Rule, Sighting, about, judged, rule
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import is_number, number_in, show, unspeakable
from splatbus_conformance.wire.message_kinds import CLIENT_1_0, POSES

Json = dict[str, Any]
STAMPED = (*CLIENT_1_0, "object_pose")
MEMBERS = {"position": "xyz", "rotation": "xyzw"}


@rule("POS-1", "POS-2", "POS-3", "POS-4")
def well_formed_pose(conversation: Conversation) -> Iterator[Sighting]:
    """POS-1 to POS-4: members and their order, magnitude of positions, norm of rotations."""
    if conversation.channel == "msg":
        for message in conversation.of(*POSES):
            yield from judged(conversation, message, pose(message.value or {}))


@rule("POS-8")
def timestamp_is_a_number(conversation: Conversation) -> Iterator[Sighting]:
    """POS-8: a timestamp is a number."""
    for message in _stamped(conversation):
        assert message.value is not None
        timestamp = message.value["timestamp"]
        wrong = Breach("not-a-number", f"timestamp is {show(timestamp)}, no number")
        fits = is_number(timestamp)
        yield about(conversation, message, "POS-8", None if fits else wrong, "/timestamp")


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
            yield about(conversation, message, "POS-9", wrong, "/timestamp")
            before = timestamp


def pose(value: Json) -> Iterator[Judgement]:
    """What a pose shows of POS-1 to POS-4."""
    yield from typed(value, POSES, "POS-1", "a pose")
    yield from placement(value)


def typed(value: Json, kinds: Collection[str], requirement: str, what: str) -> Iterator[Judgement]:
    """Whether a message has one of these types; `what` it is else."""
    wrong = None
    if value.get("type") not in kinds:
        has = show(value["type"]) if "type" in value else "missing"
        wrong = Breach("wrong-type", f"type is {has} in what is else {what}")
    yield Judgement(requirement, wrong, "/type")


def placement(value: Json) -> Iterator[Judgement]:
    """What the position and rotation of a message show of POS-1 to POS-4."""
    for part in MEMBERS:
        yield from _members(value.get(part), part)
    position, rotation = value.get("position"), value.get("rotation")
    if isinstance(position, dict):
        numbers = {f"/position/{name}": position.get(name) for name in "xyz"}
        yield from magnitudes(numbers, "POS-2")
    if isinstance(rotation, dict) and set("xyzw") <= set(rotation):
        yield from unit_norm([rotation[name] for name in "xyzw"], "POS-3")


def unit_norm(
    rotation: list[Any], requirement: str, pointer: str = "/rotation"
) -> Iterator[Judgement]:
    """Whether four numbers are a unit quaternion, as POS-3 says."""
    if all(is_number(part) and not unspeakable(part) for part in rotation):
        norm = math.hypot(*map(float, rotation))
        tolerance = LIMITS["rotation_norm_tolerance"]
        off = not abs(norm - 1) <= tolerance
        text = f"the norm of rotation is {norm:.6g}, further than {tolerance} from 1"
        yield Judgement(requirement, Breach("not-unit-norm", text) if off else None, pointer)


def _members(part: Any, name: str) -> Iterator[Judgement]:
    if part is None:
        yield Judgement("POS-1", Breach("missing-member", f"{name} is missing"), f"/{name}")
        return
    if not isinstance(part, dict):
        wrong = Breach("not-an-object", f"{name} is {show(part)}, no object")
        yield Judgement("POS-1", wrong, f"/{name}")
        return
    for member in MEMBERS[name]:
        if member not in part:
            wrong = Breach("missing-member", f"{name} has no member {member}")
            yield Judgement("POS-1", wrong, f"/{name}/{member}")
        elif not is_number(part[member]):
            text = f"{member} of {name} is {show(part[member])}, no number"
            yield Judgement("POS-1", Breach("not-a-number", text), f"/{name}/{member}")
    order = "".join(member for member in part if member in set(MEMBERS[name]))
    if sorted(order) == sorted(MEMBERS[name]):
        text = f"the members of {name} stand in the order {', '.join(order)}"
        wrong = Breach("wrong-order", text)
        yield Judgement("POS-4", wrong if order != MEMBERS[name] else None, f"/{name}")


def magnitudes(numbers: dict[str, Any], requirement: str) -> Iterator[Judgement]:
    """Whether the numbers at these pointers fit into single precision, as POS-2 says."""
    limit = LIMITS["max_position"]
    for pointer, value in numbers.items():
        if is_number(value):
            wrong = None
            if not number_in(value, -limit, limit):
                text = f"{show(value)} is beyond the largest single-precision number"
                wrong = Breach("out-of-range", text)
            yield Judgement(requirement, wrong, pointer)


def _stamped(conversation: Conversation) -> Iterator[Message]:
    for message in conversation.of(*STAMPED):
        if "timestamp" in (message.value or {}) and conversation.channel == "msg":
            yield message


RULES: tuple[Rule, ...] = (well_formed_pose, timestamp_is_a_number, timestamps_do_not_decrease)
