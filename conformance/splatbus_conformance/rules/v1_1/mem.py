"""Rules on the init packet's members of 1.1 (spec 1.1 chapter 3)."""

from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from splatbus_conformance.rules import Breach, Json, Judgement, Sighting, judged, kept, rule
from splatbus_conformance.rules.form import form, growing
from splatbus_conformance.rules.v1_0.ini import handle, layout, size
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import show, strings, whole, within

RING = ("slots", "colorOffset", "colorStride", "depthOffset", "depthStride")


class AnnouncedMemory(NamedTuple):
    """An init packet, and what it shows."""

    message: Message
    additions: tuple[Judgement, ...]
    """What it shows of chapter 3 of 1.1."""
    granted: frozenset[str] | None
    """The capabilities of a `welcome` before it; None without one, or where they are unreadable."""
    breaks_no_rule: bool
    """Neither the packet nor its text breaks anything that keeps a client from opening it."""

    @property
    def generation(self) -> object:
        """Its `generation`, whatever that is."""
        return self.message.members.get("generation")


@rule("MEM-1", "MEM-2", "MEM-3", "MEM-8", "MEM-9", "MEM-12", "INI-7")
def members_of_1_1(conversation: Conversation) -> Iterator[Sighting]:
    """MEM-1, 2, 3, 8, 9, 12: version, generation, memory, ring (INI-7: its events), semantics."""
    for packet in announced(conversation):
        yield from judged(packet.message, packet.additions)


@lru_cache(maxsize=1)  # each rule on memory asks for the same
def announced(conversation: Conversation) -> tuple[AnnouncedMemory, ...]:
    """The init packets of a connection."""
    found: list[AnnouncedMemory] = []
    newest = 0
    speaks_1_1 = conversation.welcome is not None
    for message, _, welcome in conversation.placed("init_packet"):
        assert message.value is not None  # what is of a kind could be read
        granted = capabilities(welcome)
        added: tuple[Judgement, ...] = ()
        if speaks_1_1 or _is_of_1_1(message.value):
            added = tuple(additions(message.value, newest, granted or frozenset()))
            newest = max(newest, whole(message.value.get("generation"), 1) or newest)
        shown = tuple(layout(message.value))
        is_one = "meta" in message.value and "type" not in message.value  # INI-11
        sound = is_one and not message.faults and kept(shown + added)
        found.append(AnnouncedMemory(message, added, granted, sound))
    return tuple(found)


def capabilities(message: Message | None) -> frozenset[str] | None:
    """The capabilities that a `hello` or `welcome` lists; None where it lists none readably."""
    listed = strings(((message.value if message else None) or {}).get("capabilities"))
    return None if listed is None else frozenset(listed)


def lists(message: Message | None, name: str) -> bool:
    """Whether a `hello` or `welcome` lists a capability."""
    return name in (capabilities(message) or ())


def kind_of_memory(message: Message) -> object:
    """The kind of memory that an init packet announces, whatever that is."""
    return within(message.members, "memory", "kind") if message.kind == "init_packet" else None


def additions(value: Json, newest: int, granted: frozenset[str]) -> Iterator[Judgement]:
    """What an init packet shows of MEM-1 to MEM-12, after one of generation `newest`."""
    versioned, memory = "version" in value, value.get("memory")
    kind = within(memory, "kind")
    shows = ["MEM-1"]
    shows += ["MEM-2"] if versioned or "memory" in value else []
    shows += ["MEM-3"] if kind == "host_shm" else []
    shows += ["MEM-12"] if versioned or "semantics" in value else []
    for judgement in form(value, "init_packet", *shows):
        # A handle is for the ring.
        if judgement.pointer != "/memory/handle" or "ring" in value or within(memory, "handle"):
            yield judgement
    yield from growing(value, "generation", newest, "MEM-1")
    if "ring" in value or (versioned and (kind == "host_shm" or "frames" in granted)):
        ring = tuple(_ring(value, kind))
        yield from ring
        if kept(ring):
            yield from _within_memory(value)


def _is_of_1_1(value: Json) -> bool:
    return any(name in value for name in ("version", "generation", "memory", "ring", "semantics"))


def _ring(value: Json, kind: object) -> Iterator[Judgement]:
    ring = value.get("ring")
    if not isinstance(ring, dict):
        text = f"is {show(ring)}, no object" if "ring" in value else "is missing"
        code = "not-an-object" if "ring" in value else "missing-member"
        yield Judgement("MEM-8", Breach(code, f"ring {text}"), "/ring")
        return
    yield from form(value, "init_packet", "MEM-8")
    width, height = size(value.get("meta")) or (1, 1)
    for name, least in (("color", 16 * width * height), ("depth", 4 * width * height)):
        stride = whole(ring.get(f"{name}Stride"))
        if stride is not None and stride < least:
            wrong = Breach("out-of-range", f"{name}Stride is {stride}, less than {least:,}")
            yield Judgement("MEM-8", wrong, f"/ring/{name}Stride")
    if kind == "cuda_ipc":
        events = ring.get("events")
        if not isinstance(events, list) or whole(ring.get("slots")) not in (None, len(events)):
            breach = Breach("not-an-array", "events is no array of one handle a slot")
            yield Judgement("MEM-8", breach, "/ring/events")
        else:
            for i, event in enumerate(events):
                yield handle(event, f"/ring/events/{i}")


def _within_memory(value: Json) -> Iterator[Judgement]:
    """MEM-9, for a ring that satisfies MEM-8."""
    ring, image = value["ring"], size(value.get("meta"))
    total = whole(within(value, "memory", "bytes"), 1)
    slots, *places = (whole(ring.get(name), 0) for name in RING)
    if total is None or image is None or slots is None or None in places:
        return
    color_offset, color_stride, depth_offset, depth_stride = (place or 0 for place in places)
    pixels = image[0] * image[1]
    planes = sorted(
        [(color_offset + k * color_stride, 16 * pixels, f"colour {k}") for k in range(slots)]
        + [(depth_offset + k * depth_stride, 4 * pixels, f"depth {k}") for k in range(slots)]
    )
    yield Judgement("MEM-9")
    end, last = max((begin + length, name) for begin, length, name in planes)
    if end > total:
        text = f"{last} ends at byte {end:,}, the memory at {total:,}"
        yield Judgement("MEM-9", Breach("beyond-memory", text), "/memory/bytes")
    for (begin, length, name), (following, _, other) in pairwise(planes):
        if following < begin + length:
            breach = Breach("overlapping", f"{name} and {other} overlap")
            yield Judgement("MEM-9", breach, "/ring")
