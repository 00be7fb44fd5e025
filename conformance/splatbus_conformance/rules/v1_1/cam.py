"""Rules on cameras: tags and intrinsics (spec 1.1 chapter 6)."""

from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

from splatbus_conformance.rules import Breach, Json, Judgement, Sighting, about, judged, rule
from splatbus_conformance.rules.exchanges import exchanges
from splatbus_conformance.rules.form import far_beyond_near, form
from splatbus_conformance.rules.v1_0.req_replies import sizes, sizes_at
from splatbus_conformance.rules.v1_1.mem import lists
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import is_number, show, whole, within


@rule("CAM-1", "CAM-4")
def well_formed_lens_and_tag(conversation: Conversation) -> Iterator[Sighting]:
    """CAM-1, CAM-4: the members that 1.1 adds to `camera_pose`."""
    for message, _, welcome in conversation.placed("camera_pose"):
        if welcome is not None:
            yield from judged(message, additions(message.members))


@rule("CAM-4", "CAM-8")
def cameras_have_a_lens(conversation: Conversation) -> Iterator[Sighting]:
    """CAM-4, CAM-8: the reply to `get_camera_pose` has intrinsics, in pixels of the images.

    The size of the images is known once an init packet was sent, on whichever connection.
    """
    if not lists(conversation.welcome, "intrinsics"):
        return
    announced = sizes(conversation)
    for question, answer, *_, welcomed, _ in exchanges(conversation).pairs:
        value = answer.members
        if not (welcomed and question.kind == "get_camera_pose" and answer.kind == "camera"):
            continue
        known, allowed = sizes_at(announced, question.packet.ended)
        if "intrinsics" not in value:
            if known:
                breach = Breach("missing-member", "the reply has no intrinsics")
                yield about(answer, "CAM-8", breach, "/intrinsics")
            continue
        given = value["intrinsics"]
        yield from judged(answer, lens(value, "camera"))
        size = tuple(whole(within(given, name)) for name in ("width", "height"))
        wrong = None
        if None not in size and known and size not in allowed:
            text = f"the intrinsics are of {list(size)}, the init packet said {list(known)}"
            wrong = Breach("wrong-size", text)
        yield about(answer, "CAM-8", wrong, "/intrinsics")


class _Look(NamedTuple):
    """Where a camera was, exactly."""

    position: tuple[Any, ...]
    rotation: tuple[Any, ...]


@rule("CAM-2")
def tags_come_back(conversation: Conversation) -> Iterator[Sighting]:
    """CAM-2: the first `frame` from where only one pose, which has a tag, put the camera has it.

    Judged where the poses are recorded as well, and none on that connection was answered by an
    error: then no other client can have had control.
    """
    if conversation.channel != "ipc":
        return
    seen: set[_Look] = set()
    tagged = _only_once(conversation.recording)
    for message in conversation.of("frame") if tagged else ():
        camera = _camera(message)
        look = _look(camera, "012", "0123")
        if look is None or look in seen:
            continue
        first = bool(seen)
        seen.add(look)
        asked = tagged.get(look)
        if first and asked is not None and asked.packet.ended < message.packet.ended:
            tag = asked.members["tag"]
            has = show(camera["tag"]) if "tag" in camera else "missing"
            text = f"tag is {has}; the pose of this camera has {show(tag)}"
            wrong = None if camera.get("tag") == tag else Breach("another-tag", text)
            yield about(message, "CAM-2", wrong, "/camera/tag")


@rule("CAM-3")
def tags_come_back_once(conversation: Conversation) -> Iterator[Sighting]:
    """CAM-3: no tag comes on a connection more often than poses before it had that tag.

    A tag that no recorded pose had, or none before, may be that of a pose that is not recorded.
    """
    if conversation.channel != "ipc":
        return
    sent: dict[str, list[float]] = {}
    for each in conversation.beside or [conversation]:
        for message in each.of("camera_pose"):
            tag = message.members.get("tag")
            if isinstance(tag, str):
                sent.setdefault(tag, []).append(message.packet.ended)
    came: Counter[str] = Counter()
    for message in conversation.of("frame") if sent else ():
        tag = _camera(message).get("tag")
        if isinstance(tag, str) and tag in sent:
            if not (times := sum(t < message.packet.ended for t in sent[tag])):
                continue
            came[tag] += 1
            text = f"tag {show(tag)} comes {came[tag]} times, {times} poses before it had it"
            wrong = Breach("too-often", text) if came[tag] > times else None
            yield about(message, "CAM-3", wrong, "/camera/tag")


def additions(value: Json) -> Iterator[Judgement]:
    """What a `camera_pose` shows of CAM-1 and CAM-4."""
    if "tag" in value:
        yield from form(value, "camera_pose", "CAM-1")
    if "intrinsics" in value:
        yield from lens(value, "camera_pose")


def lens(value: Json, kind: str) -> Iterator[Judgement]:
    """What the intrinsics in a message of this kind show of CAM-4."""
    yield from form(value, kind, "CAM-4")
    yield from far_beyond_near(value.get("intrinsics"), "CAM-4", "/intrinsics")


def _camera(message: Message) -> Json:
    """The camera of a `frame`; of no members where there is none."""
    camera = message.members.get("camera")
    return camera if isinstance(camera, dict) else {}


@lru_cache(maxsize=1)  # each conversation of a recording asks for the same
def _only_once(recording: Conversation) -> dict[_Look, Message]:
    """Poses that have a tag, by where they put the camera, where no other pose put it."""
    found: dict[_Look, Message | None] = {}
    for each in recording.beside or [recording]:
        refused = bool(each.of("error"))
        for message, _, welcome in each.placed("camera_pose"):
            value = message.members
            look, tag = _look(value, "xyz", "xyzw"), value.get("tag")
            sure = welcome is not None and isinstance(tag, str) and not refused
            if look is not None:
                found[look] = message if sure and look not in found else None
    return {look: pose for look, pose in found.items() if pose}


def _look(value: Json, *names: str) -> _Look | None:
    """Position and rotation: members of these names, or elements of these numbers."""
    parts = []
    for part, each in zip((value.get("position"), value.get("rotation")), names, strict=True):
        if isinstance(part, list) and len(part) == len(each):
            part = dict(zip(each, part, strict=True))
        numbers = tuple(part.get(name) for name in each) if isinstance(part, dict) else ()
        if not numbers or not all(is_number(number) for number in numbers):
            return None
        parts.append(numbers)
    return _Look(*parts)
