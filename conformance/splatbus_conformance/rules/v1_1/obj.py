"""Rules on objects and the scene's time (spec 1.1 sections 7.1 and 9.1)."""

from collections.abc import Iterator
from typing import Any

from splatbus_schemas import LIMITS

from splatbus_conformance.rules import Breach, Judgement, Rule, Sighting, judged, rule
from splatbus_conformance.rules.members import each_once, named, number, vector
from splatbus_conformance.rules.v1_0.pos import magnitudes, placement, typed, unit_norm
from splatbus_conformance.wire.conversation import Conversation
from splatbus_conformance.wire.json_values import number_in, numbers, positive, show

Json = dict[str, Any]
MAX_OBJECTS: int = LIMITS["max_objects"]
MIN_SCALE: float = LIMITS["min_scale"]
MAX_SCALE: float = LIMITS["max_scale"]
AS_POSES = ("POS-1", "POS-2", "POS-3")
"""What OBJ-1 says of the members of an `object_pose`, too."""


@rule("OBJ-1", "TIM-1")
def well_formed_steering(conversation: Conversation) -> Iterator[Sighting]:
    """OBJ-1, TIM-1: the members of `object_pose` and of `set_time`."""
    for message, hello, _ in conversation.placed(*STEERING):
        if hello is not None:
            shows = STEERING[str(message.kind)]
            yield from judged(conversation, message, shows(message.value or {}))


@rule("OBJ-7")
def well_formed_objects(conversation: Conversation) -> Iterator[Sighting]:
    """OBJ-7: the members of `objects` in a `frame`."""
    for message, hello, _ in conversation.placed("frame"):
        value = message.value or {}
        if hello is not None and "objects" in value:
            yield from judged(conversation, message, _placements(value["objects"]))


def object_pose(value: Json) -> Iterator[Judgement]:
    """What an `object_pose` shows of OBJ-1."""
    yield from typed(value, ("object_pose",), "OBJ-1", "the pose of an object")
    for judgement in placement(value):
        if judgement.requirement in AS_POSES:
            yield judgement._replace(requirement="OBJ-1")
    yield named(value, "object", "OBJ-1", "")
    scale = value.get("scale", 1)
    text = f"scale is {show(scale)}, no number from {MIN_SCALE} to {MAX_SCALE}"
    fits = number_in(scale, MIN_SCALE, MAX_SCALE)
    yield Judgement("OBJ-1", None if fits else Breach("out-of-range", text), "/scale")


def set_time(value: Json) -> Iterator[Judgement]:
    """What a `set_time` shows of TIM-1."""
    yield from typed(value, ("set_time",), "TIM-1", "a time")
    yield number(value, "time", "TIM-1", "")


def _placements(listed: object) -> Iterator[Judgement]:
    if not (isinstance(listed, list) and len(listed) <= MAX_OBJECTS):
        text = f"objects is {show(listed)}, no array of up to {MAX_OBJECTS} objects"
        yield Judgement("OBJ-7", Breach("not-an-array", text), "/objects")
        return
    yield Judgement("OBJ-7")
    yield from each_once(listed, "object", "OBJ-7", "/objects")
    for i, item in enumerate(listed):
        pointer = f"/objects/{i}"
        if not isinstance(item, dict):
            yield Judgement("OBJ-7", Breach("not-an-object", f"{show(item)} is no object"), pointer)
            continue
        yield named(item, "object", "OBJ-7", pointer)
        yield vector(item, "position", "OBJ-7", pointer)
        yield vector(item, "rotation", "OBJ-7", pointer, count=4)
        if numbers(item.get("position"), 3):
            each = {f"{pointer}/position/{i}": part for i, part in enumerate(item["position"])}
            yield from magnitudes(each, "OBJ-7")
        if numbers(item.get("rotation"), 4):
            yield from unit_norm(item["rotation"], "OBJ-7", f"{pointer}/rotation")
        if not positive(item.get("scale")):
            has = show(item["scale"]) if "scale" in item else "missing"
            breach = Breach("not-positive", f"scale is {has}, no positive number")
            yield Judgement("OBJ-7", breach, f"{pointer}/scale")


STEERING = {"object_pose": object_pose, "set_time": set_time}
"""What 1.1 adds to the poses, and what each shows."""
RULES: tuple[Rule, ...] = (well_formed_steering, well_formed_objects)
