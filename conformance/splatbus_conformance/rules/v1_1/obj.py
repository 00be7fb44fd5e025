"""Rules on objects and the scene's time (spec 1.1 sections 7.1 and 9.1)."""

from collections.abc import Iterator

from splatbus_conformance.rules import Json, Judgement, Sighting, greeted, judged, rule
from splatbus_conformance.rules.form import each_once, form, unit_norm
from splatbus_conformance.wire.conversation import Conversation
from splatbus_conformance.wire.json_values import array, within

AS_POSES = ("POS-1", "POS-2", "POS-3")
"""What OBJ-1 says of the members of an `object_pose`, too."""


@rule("OBJ-1", "TIM-1")
def well_formed_steering(conversation: Conversation) -> Iterator[Sighting]:
    """OBJ-1, TIM-1: the members of `object_pose` and of `set_time`."""
    for message in greeted(conversation, *STEERING):
        shows = STEERING[str(message.kind)]
        yield from judged(message, shows(message.members))


@rule("OBJ-7")
def well_formed_objects(conversation: Conversation) -> Iterator[Sighting]:
    """OBJ-7: the members of `objects` in a `frame`."""
    for message in greeted(conversation, "frame"):
        if "objects" in message.members:
            yield from judged(message, _placements(message.members))


def object_pose(value: Json) -> Iterator[Judgement]:
    """What an `object_pose` shows of OBJ-1."""
    for judgement in form(value, "object_pose", "OBJ-1", *AS_POSES):
        yield judgement._replace(requirement="OBJ-1")
    yield from unit_norm([within(value, "rotation", name) for name in "xyzw"], "OBJ-1")


def set_time(value: Json) -> Iterator[Judgement]:
    """What a `set_time` shows of TIM-1."""
    return form(value, "set_time", "TIM-1")


def _placements(value: Json) -> Iterator[Judgement]:
    yield from form(value, "frame", "OBJ-7")
    objects = array(value["objects"])
    yield from each_once(objects, "object", "OBJ-7", "/objects")
    for i, item in enumerate(objects):
        yield from unit_norm(within(item, "rotation"), "OBJ-7", f"/objects/{i}/rotation")


STEERING = {"object_pose": object_pose, "set_time": set_time}
"""What 1.1 adds to the poses, and what each shows."""
