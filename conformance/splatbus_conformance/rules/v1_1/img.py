"""Rules on frames, their release, and subscriptions (spec 1.1 chapter 5)."""

from collections import Counter
from collections.abc import Iterator

from splatbus_conformance.rules import (
    Breach,
    Json,
    Judgement,
    Sighting,
    about,
    deaf,
    greeted,
    judged,
    rule,
)
from splatbus_conformance.rules.form import far_beyond_near, form, formed, growing, unit_norm
from splatbus_conformance.rules.v1_0.ini import size
from splatbus_conformance.rules.v1_1.mem import announced, capabilities, lists
from splatbus_conformance.wire.conversation import Conversation
from splatbus_conformance.wire.json_values import as_cut, show, whole, within

Image = tuple[int | None, int | None]
"""Generation and number of an image."""


@rule("IMG-1")
def well_formed_frame(conversation: Conversation) -> Iterator[Sighting]:
    """IMG-1: the members of a `frame`, slots and size as announced, and `seq` that grows."""
    memory = announced(conversation)
    newest = -1
    for message in greeted(conversation, "frame"):
        value = message.members
        announcing = [
            packet.message.members
            for packet in memory
            if packet.message.packet.offset < message.packet.offset
            and packet.generation == value.get("generation")
        ]
        described = announcing[-1] if announcing else {}
        yield from judged(message, frame(value, described, newest))
        newest = max(newest, whole(value.get("seq"), 0) or 0)


@rule("IMG-2")
def lent_one_at_a_time(conversation: Conversation) -> Iterator[Sighting]:
    """IMG-2: a `frame` comes after `opened` for its generation and `release` of the one before.

    A lease also ends with `closed` or `open_failed` for its generation (OPN-14). A frame that comes
    later may have crossed that on its way, and lends nothing (IMG-15).
    """
    opened: set[int | None] = set()
    given_up: set[int | None] = set()
    lent: Image | None = None
    told = ("opened", "closed", "open_failed", "release", "frame")
    for message, hello, _ in conversation.placed(*told):
        value = message.members
        generation = whole(value.get("generation"))
        if message.kind == "opened":
            opened.add(generation)
        elif message.kind in ("closed", "open_failed"):
            given_up.add(generation)
            lent = None if lent and lent[0] == generation else lent
        elif message.kind == "release" and lent == (generation, whole(value.get("seq"))):
            lent = None
        elif message.kind == "frame" and hello is not None:
            wrong = None
            if generation is not None and generation not in opened:
                wrong = Breach("not-opened", f"generation {generation} has not been opened")
            elif lent is not None and None not in lent:
                text = f"image {lent[1]} of generation {lent[0]} has not been released"
                wrong = Breach("not-released", text)
            yield about(message, "IMG-2", wrong)
            lent = None if generation in given_up else (generation, whole(value.get("seq")))


@rule("IMG-23")
def frames_are_agreed(conversation: Conversation) -> Iterator[Sighting]:
    """IMG-23: a `frame` only where `welcome` lists `frames`."""
    for message, _, welcome in conversation.placed("frame"):
        granted = capabilities(welcome)
        if welcome is None or granted is not None:
            text = "frame, although no welcome lists frames"
            wrong = None if "frames" in (granted or ()) else Breach("not-granted", text)
            yield about(message, "IMG-23", wrong)


@rule("IMG-12")
def one_release_for_each_frame(conversation: Conversation) -> Iterator[Sighting]:
    """IMG-12: each `release` is the first for a `frame` of this connection.

    A `release` that never comes is not judged: a client may hold an image as long as it likes.
    """
    lent: Counter[Image] = Counter()
    released: Counter[Image] = Counter()
    if deaf(conversation):
        return
    for message, _, welcome in conversation.placed("frame", "release"):
        value = message.members
        image = (whole(value.get("generation")), whole(value.get("seq")))
        if message.kind == "frame":
            lent[image] += 1
        elif lists(welcome, "frames"):
            released[image] += 1
            wrong = None
            if None in image and not any(None in other for other in lent):
                wrong = Breach("not-an-integer", "generation or seq is missing or no integer")
            elif not lent[image]:
                text = f"no frame had generation {image[0]} and seq {image[1]}"
                text += as_cut(image[1], *(seq for _, seq in lent))
                text += as_cut(image[0], *(generation for generation, _ in lent))
                wrong = Breach("unknown-image", text)
            elif released[image] > lent[image]:
                text = f"image {image[1]} of generation {image[0]} is released a second time"
                wrong = Breach("released-twice", text)
            yield about(message, "IMG-12", wrong)


@rule("IMG-12")
def released_before_closed(conversation: Conversation) -> Iterator[Sighting]:
    """IMG-12: what a client was lent of a generation is released before that is `closed`.

    It has certainly seen the frames that came before an init packet which it has answered. One that
    comes later may reach it when it has closed that memory, and is ignored.
    """
    if deaf(conversation):
        return
    slots: dict[int | None, int] = {}
    held: set[Image] = set()
    before: dict[int | None, set[Image]] = {}
    seen: set[Image] = set()
    opened: set[int | None] = set()
    closed: set[int | None] = set()
    told = ("init_packet", "opened", "open_failed", "frame", "release", "closed")
    for message, _, welcome in conversation.placed(*told):
        value = message.members
        generation = whole(value.get("generation"))
        image = (generation, whole(value.get("seq")))
        if message.kind == "init_packet":
            slots[generation] = _slots(value)
            before[generation] = set(held)
        elif message.kind in ("opened", "open_failed"):
            seen |= before.get(generation, set())
            opened |= {generation} if message.kind == "opened" else set()
        elif not lists(welcome, "frames"):
            continue
        elif message.kind == "frame" and generation in opened - closed and None not in image:
            if (whole(value.get("slot"), 0) or 0) < slots.get(generation, 0):
                held.add(image)
        elif message.kind == "release":
            held.discard(image)
            if generation in closed:
                breach = Breach("already-closed", f"generation {generation} has been closed before")
                yield about(message, "IMG-12", breach)
        elif message.kind == "closed":
            left = [number for of, number in held & seen if of == generation]
            text = f"generation {generation} is closed, and its image {left[:1]} is not released"
            wrong = Breach("not-released", text) if left else None
            yield about(message, "IMG-12", wrong)
            closed.add(generation)


def _slots(value: Json) -> int:
    return whole(within(value, "ring", "slots"), 1) or 0


@rule("IMG-19")
def well_formed_subscription(conversation: Conversation) -> Iterator[Sighting]:
    """IMG-19: `subscribe` names colour, depth or both."""
    return formed(greeted(conversation, "subscribe"), "IMG-19")


def frame(value: Json, described: Json, newest: int) -> Iterator[Judgement]:
    """What a `frame` shows of IMG-1, in memory that this init packet describes."""
    yield from form(value, "frame", "IMG-1")
    yield from growing(value, "seq", newest, "IMG-1")
    slot, slots = whole(value.get("slot"), 0), _slots(described)
    if slot is not None and 0 < slots <= slot:
        wrong = Breach("out-of-range", f"slot is {slot}, and the ring has {slots}")
        yield Judgement("IMG-1", wrong, "/slot")
    camera = value.get("camera")
    if isinstance(camera, dict):
        yield from _camera(camera, size(described.get("meta")))


def _camera(camera: Json, image: tuple[int, int] | None) -> Iterator[Judgement]:
    yield from unit_norm(camera.get("rotation"), "IMG-1", "/camera/rotation")
    yield from far_beyond_near(camera, "IMG-1", "/camera")
    for name, told in zip(("width", "height"), image or (), strict=False):
        if whole(camera.get(name)) not in (None, told):
            text = f"{name} is {show(camera[name])}, the init packet said {told}"
            yield Judgement("IMG-1", Breach("wrong-size", text), f"/camera/{name}")
