"""Rules on the init packet's members of 1.1 (spec 1.1 chapter 3)."""

import math
import re
from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.rules import Breach, Judgement, Rule, Sighting, judged, rule
from splatbus_conformance.rules.v1_0.ini import HANDLES, handle, layout, size
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import (
    SAFE,
    integer_in,
    is_handle,
    is_number,
    number_in,
    numbers,
    positive,
    show,
    strings,
    whole,
)

Json = dict[str, Any]
MAX_SLOTS: int = LIMITS["max_slots"]
ALIGNMENT = 16
MOST_DEPTH = math.nextafter(2.0**128 - 2.0**103, 0.0)
"""The greatest number that single precision does not round to infinity."""
_NAME = re.compile(rf"(?!\.)[A-Za-z0-9._-]{{1,{LIMITS['max_shm_name_chars']}}}")
_VERSION = re.compile(r"1\.[1-9][0-9]*")
_UUID = re.compile(r"GPU-[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
RING = ("slots", "colorOffset", "colorStride", "depthOffset", "depthStride")
SEMANTICS = {
    "rows": ("bottom_up",),
    "alpha": ("straight", "premultiplied"),
    "colorSpace": ("srgb", "linear"),
}
DEPTH = {
    "kind": ("planar_z", "ray_distance"),
    "estimator": ("harmonic", "expected", "median"),
}


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
        return (self.message.value or {}).get("generation")


@rule("MEM-1", "MEM-2", "MEM-3", "MEM-8", "MEM-9", "MEM-12", "INI-7")
def members_of_1_1(conversation: Conversation) -> Iterator[Sighting]:
    """MEM-1, 2, 3, 8, 9, 12: version, generation, memory, ring (INI-7: its events), semantics."""
    for packet in announced(conversation):
        yield from judged(conversation, packet.message, packet.additions)


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
        sound = is_one and not message.faults and not any(j.breach for j in shown + added)
        found.append(AnnouncedMemory(message, added, granted, sound))
    return tuple(found)


def capabilities(message: Message | None) -> frozenset[str] | None:
    """The capabilities that a `hello` or `welcome` lists; None where it lists none readably."""
    listed = strings(((message.value if message else None) or {}).get("capabilities"))
    return None if listed is None else frozenset(listed)


def kind_of_memory(message: Message) -> object:
    """The kind of memory that an init packet announces, whatever that is."""
    memory = (message.value or {}).get("memory") if message.kind == "init_packet" else None
    return memory.get("kind") if isinstance(memory, dict) else None


def additions(value: Json, newest: int, granted: frozenset[str]) -> Iterator[Judgement]:
    """What an init packet shows of MEM-1 to MEM-12, after one of generation `newest`."""
    yield from _identity(value, newest)
    versioned = "version" in value
    memory = value.get("memory")
    kind = memory.get("kind") if isinstance(memory, dict) else None
    if versioned or "memory" in value:
        yield from _memory(memory, with_ring="ring" in value)
    if kind == "host_shm":
        yield Judgement("MEM-3")
        for name in HANDLES:
            if name in value:
                breach = Breach("stray-member", f"{name} stands beside shared memory")
                yield Judgement("MEM-3", breach, f"/{name}")
    if "ring" in value or (versioned and (kind == "host_shm" or "frames" in granted)):
        ring = tuple(_ring(value, kind))
        yield from ring
        if all(judgement.breach is None for judgement in ring):
            yield from _within_memory(value)
    if versioned or "semantics" in value:
        yield from _semantics(value.get("semantics"))


def _is_of_1_1(value: Json) -> bool:
    return any(name in value for name in ("version", "generation", "memory", "ring", "semantics"))


def _identity(value: Json, newest: int) -> Iterator[Judgement]:
    version, generation = value.get("version"), value.get("generation")
    yield Judgement("MEM-1")
    if not (isinstance(version, str) and _VERSION.fullmatch(version)):
        text = show(version) if "version" in value else "missing"
        breach = Breach("wrong-version", f'version is {text}, not "1.1" nor a later 1.x')
        yield Judgement("MEM-1", breach, "/version")
    if not integer_in(generation, 1):
        text = show(generation) if "generation" in value else "missing"
        wrong = f"generation is {text}, no integer from 1 to {SAFE}"
        yield Judgement("MEM-1", Breach("out-of-range", wrong), "/generation")
    elif (whole(generation) or newest + 1) <= newest:
        breach = Breach("not-growing", f"generation {generation} follows {newest}")
        yield Judgement("MEM-1", breach, "/generation")


def _memory(memory: object, *, with_ring: bool) -> Iterator[Judgement]:
    if not isinstance(memory, dict):
        text = "is missing" if memory is None else f"is {show(memory)}, no object"
        code = "missing-member" if memory is None else "not-an-object"
        yield Judgement("MEM-2", Breach(code, f"memory {text}"), "/memory")
        return
    kind, name, uuid = memory.get("kind"), memory.get("name"), memory.get("deviceUuid")
    yield Judgement("MEM-2")
    if kind not in ("host_shm", "cuda_ipc"):
        breach = Breach("unknown-kind", f"the kind of memory is {show(kind)}")
        yield Judgement("MEM-2", breach, "/memory/kind")
    if kind == "host_shm" and not (isinstance(name, str) and _NAME.fullmatch(name)):
        breach = Breach("not-a-name", f"{show(name)} is no name for memory")
        yield Judgement("MEM-2", breach, "/memory/name")
    if kind == "cuda_ipc" and not (isinstance(uuid, str) and _UUID.fullmatch(uuid)):
        breach = Breach("not-a-uuid", f"deviceUuid is {show(uuid)}")
        yield Judgement("MEM-2", breach, "/memory/deviceUuid")
    wanted = kind == "cuda_ipc" and (with_ring or "handle" in memory)
    if wanted and not is_handle(memory.get("handle")):
        text = f"handle is {show(memory.get('handle'))}, no base64 of a CUDA IPC handle"
        yield Judgement("MEM-2", Breach("not-a-handle", text), "/memory/handle")
    if not integer_in(memory.get("bytes"), 1):
        text = f"bytes is {show(memory.get('bytes'))}, no integer from 1 to {SAFE}"
        yield Judgement("MEM-2", Breach("out-of-range", text), "/memory/bytes")


def _ring(value: Json, kind: object) -> Iterator[Judgement]:
    ring = value.get("ring")
    if not isinstance(ring, dict):
        text = f"is {show(ring)}, no object" if "ring" in value else "is missing"
        code = "not-an-object" if "ring" in value else "missing-member"
        yield Judgement("MEM-8", Breach(code, f"ring {text}"), "/ring")
        return
    width, height = size(value.get("meta")) or (1, 1)
    least = {"colorStride": 16 * width * height, "depthStride": 4 * width * height}
    yield Judgement("MEM-8")
    for name in RING:
        code = "out-of-range"
        if name == "slots":
            fits, wanted = integer_in(ring.get(name), 1, MAX_SLOTS), f"1 to {MAX_SLOTS:,}"
        else:
            low = least.get(name, 0)
            number = whole(ring.get(name), low)
            fits = integer_in(ring.get(name), low) and (number or 0) % ALIGNMENT == 0
            wanted = f"{low:,} on, a multiple of {ALIGNMENT}"
            code = "misaligned" if integer_in(ring.get(name), low) else code
        text = f"{name} is {show(ring.get(name))}, no integer from {wanted}"
        yield Judgement("MEM-8", None if fits else Breach(code, text), f"/ring/{name}")
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
    ring, memory, image = value["ring"], value.get("memory"), size(value.get("meta"))
    total = whole(memory.get("bytes"), 1) if isinstance(memory, dict) else None
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


def _semantics(semantics: object) -> Iterator[Judgement]:
    if not isinstance(semantics, dict):
        text = "is missing" if semantics is None else f"is {show(semantics)}, no object"
        code = "missing-member" if semantics is None else "not-an-object"
        yield Judgement("MEM-12", Breach(code, f"semantics {text}"), "/semantics")
        return
    yield Judgement("MEM-12")
    yield from _one_of(semantics, SEMANTICS, "/semantics")
    depth = semantics.get("depth")
    if not isinstance(depth, dict):
        breach = Breach("not-an-object", f"depth is {show(depth)}, no object")
        yield Judgement("MEM-12", breach, "/semantics/depth")
    else:
        yield from _one_of(depth, DEPTH, "/semantics/depth")
        empty = depth.get("empty")
        if not (number_in(empty, -MOST_DEPTH, MOST_DEPTH) or empty == "inf"):
            text = f'empty is {show(empty)}, neither a number of single precision nor "inf"'
            code = "out-of-range" if is_number(empty) else "not-a-number"
            yield Judgement("MEM-12", Breach(code, text), "/semantics/depth/empty")
    unit = semantics.get("unitMetres", "missing")
    if not (unit is None or positive(unit)):
        text = f"unitMetres is {show(unit)}, no positive number or null"
        yield Judgement("MEM-12", Breach("not-positive", text), "/semantics/unitMetres")
    if not numbers(semantics.get("origin"), 3):
        text = f"origin is {show(semantics.get('origin'))}, no array of 3 numbers"
        yield Judgement("MEM-12", Breach("not-an-array", text), "/semantics/origin")


def _one_of(part: Json, table: dict[str, tuple[str, ...]], pointer: str) -> Iterator[Judgement]:
    for name, values in table.items():
        if part.get(name) not in values:
            has = show(part[name]) if name in part else "missing"
            text = f"{name} is {has}, not one of {', '.join(values)}"
            yield Judgement("MEM-12", Breach("unknown-value", text), f"{pointer}/{name}")


RULES: tuple[Rule, ...] = (members_of_1_1,)
