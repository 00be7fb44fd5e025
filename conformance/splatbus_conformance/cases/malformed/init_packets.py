"""Init packets that break one rule each of spec 1.0 chapter 4 and spec 1.1 chapter 3.

Apart from what is broken each is good, and small enough for memory of `ROOM` bytes: a client that
misses the rule opens it.
"""

import copy
from collections.abc import Iterator
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.wire.messages import Json, init_packet_1_1

ROOM = 1 << 20
WIDTH, HEIGHT, SLOTS = 64, 48, 3
ABSENT = object()
INFINITE_DEPTH = 2.0**128 - 2.0**103
"""The least number that single precision rounds to infinity."""
BEYOND: int = LIMITS["max_safe_integer"] + 1
NO_OBJECTS: tuple[Any, ...] = (ABSENT, None, [], "{}", 1, True)
NO_STRINGS: tuple[Any, ...] = (ABSENT, None, 1, [], {}, True)
NO_NUMBERS: tuple[Any, ...] = (None, [], {}, False)


class BrokenInitPacket(NamedTuple):
    """Members to be changed in a good init packet, and what that breaks."""

    requirement: str
    changes: dict[str, Any]
    """Values by path (`meta/w`), ABSENT for a member to be left out."""
    width: int = WIDTH
    height: int = HEIGHT
    slots: int = SLOTS
    how: str = ""
    """How it is broken, where that says more than which member is."""

    @property
    def kind(self) -> tuple[str, str, bool]:
        """The rule and the member that are broken; extremes are kinds of their own."""
        path, value = next(iter(self.changes.items()))
        if self.how:
            return self.requirement, self.how, False
        odd_size = (self.width, self.height, self.slots) != (WIDTH, HEIGHT, SLOTS)
        extreme = value is None or (type(value) is int and abs(value) >= 1 << 31)
        return self.requirement, path, extreme or odd_size

    @property
    def what(self) -> str:
        """The changes in words."""
        size = "" if self.width * self.height <= ROOM else f"{self.width}x{self.height}, "
        return size + in_words(self.changes)

    def packet(self, name: str, generation: int) -> Json:
        """The init packet for the memory `name`."""
        good = init_packet_1_1(name, generation, self.width, self.height, self.slots)
        return changed(good, self.changes)


def in_words(changes: dict[str, Any]) -> str:
    """What is changed, and into what."""
    return ", ".join(
        f"no {path}" if value is ABSENT else f"{path} {value!r:.60}"
        for path, value in changes.items()
    )


def changed(good: Json, changes: dict[str, Any]) -> Json:
    """A copy of an init packet with members changed or left out."""
    packet = copy.deepcopy(good)
    for path, value in changes.items():
        *way, last = path.split("/")
        inner = packet
        for step in way:
            inner = inner[step]
        if value is ABSENT:
            del inner[last]
        else:
            inner[last] = value
    return packet


def _each(requirement: str, path: str, values: tuple[Any, ...]) -> Iterator[BrokenInitPacket]:
    for value in values:
        yield BrokenInitPacket(requirement, {path: value})


def breaches_of_1_0() -> list[BrokenInitPacket]:
    """Each rule of INI-1 to INI-6 broken, in a packet for memory of the host."""
    return [*_meta(), *_sizes(), *_pitches(), *_offsets()]


def padded_rows() -> Iterator[BrokenInitPacket]:
    """INI-4 broken, in rings that have room for such rows."""
    for channel, pitch in (("color", 16 * WIDTH), ("depth", 4 * WIDTH)):
        padded = pitch + 16
        room = {f"ring/{channel}Stride": padded * HEIGHT, "ring/depthOffset": ROOM // 2}
        wrong = {f"meta/pitch{channel.title()}": padded, **room, "memory/bytes": ROOM}
        yield BrokenInitPacket("INI-4", wrong, how=f"padded rows of {channel}")


def breaches_of_1_1() -> list[BrokenInitPacket]:
    """Each rule of MEM-1, MEM-2, MEM-8, MEM-9 and MEM-12 broken; for names see `BAD_NAMES`."""
    return [*_version(), *_memory(), *_ring(), *_overlaps(), *_semantics()]


def _meta() -> Iterator[BrokenInitPacket]:
    yield from _each("INI-1", "meta", NO_OBJECTS)
    for member in ("w", "h", "fmtColor", "pitchColor", "fmtDepth", "pitchDepth"):
        yield BrokenInitPacket("INI-1", {f"meta/{member}": ABSENT})
    formats = ("rgba32f", "RGBA16F", "RGBA8", "R32F", "RGBA32F ", "", *NO_STRINGS[1:])
    yield from _each("INI-3", "meta/fmtColor", formats)
    formats = ("r32f", "R16F", "D32F", "RGBA32F", "R32F\x00", "", *NO_STRINGS[1:])
    yield from _each("INI-3", "meta/fmtDepth", formats)


def _sizes() -> Iterator[BrokenInitPacket]:
    most: int = LIMITS["max_image_size"]
    for member, size in (("w", WIDTH), ("h", HEIGHT)):
        values = (str(size), float(size) + 0.5, -size, *NO_NUMBERS)
        yield from _each("INI-2", f"meta/{member}", values)
    no_pitch = {"meta/pitchColor": 0, "meta/pitchDepth": 0}
    yield BrokenInitPacket("INI-2", {"meta/w": 0, **no_pitch})
    yield BrokenInitPacket("INI-2", {"meta/h": 0})
    yield BrokenInitPacket("INI-2", {"meta/w": True}, width=1)
    yield BrokenInitPacket("INI-2", {"meta/h": True}, height=1)
    yield BrokenInitPacket("INI-2", {"meta/w": most + 1}, width=most + 1, height=1, slots=1)
    yield BrokenInitPacket("INI-2", {"meta/h": most + 1}, width=1, height=most + 1, slots=1)


def _pitches() -> Iterator[BrokenInitPacket]:
    for member, pitch in (("pitchColor", 16 * WIDTH), ("pitchDepth", 4 * WIDTH)):
        wrong = (pitch + 16, pitch - 16, 2 * pitch, 0, -pitch, pitch + 0.5, str(pitch))
        yield from _each("INI-4", f"meta/{member}", (*wrong, *NO_NUMBERS))


def _offsets() -> Iterator[BrokenInitPacket]:
    for member, unaligned in (("offsetColor", 8), ("offsetDepth", 2)):
        wrong = (unaligned, -16, 0.5, BEYOND, "0", *NO_NUMBERS)
        yield from _each("INI-5", f"meta/{member}", wrong)
    yield from _each("INI-6", "meta/device", (-1, 0.5, BEYOND, "0", *NO_NUMBERS))


def _version() -> Iterator[BrokenInitPacket]:
    odd = ("1.01", "1.02", "1.2.3", "1.x", "1.", "1.-2", "1.2 ", "1.2\n", "1.٢", "01.2")
    versions = ("1.0", "2.0", "2.2", "1.1 ", "", 1.1, 1.2, *NO_STRINGS)
    yield from _each("MEM-1", "version", odd + versions)
    generations = (ABSENT, 0, -1, 1.5, BEYOND, "1", *NO_NUMBERS, True)
    yield from _each("MEM-1", "generation", generations)


def _memory() -> Iterator[BrokenInitPacket]:
    yield from _each("MEM-2", "memory", NO_OBJECTS)
    kinds = ("posix_shm", "HOST_SHM", "cuda_ipc", "", *NO_STRINGS)
    yield from _each("MEM-2", "memory/kind", kinds)
    sizes = (ABSENT, 0, -1, ROOM - 0.5, BEYOND, str(ROOM), *NO_NUMBERS)
    yield from _each("MEM-2", "memory/bytes", sizes)


def _ring() -> Iterator[BrokenInitPacket]:
    yield from _each("MEM-8", "ring", NO_OBJECTS)
    for member in ("slots", "colorOffset", "colorStride", "depthOffset", "depthStride"):
        yield BrokenInitPacket("MEM-8", {f"ring/{member}": ABSENT})
    yield from _each("MEM-8", "ring/slots", (0, -1, 2.5, "3", *NO_NUMBERS))
    most: int = LIMITS["max_slots"]
    yield BrokenInitPacket("MEM-8", {"ring/slots": most + 1}, width=1, height=1, slots=most + 1)
    yield BrokenInitPacket("MEM-8", {"ring/slots": True}, slots=1)
    room = {"memory/bytes": ROOM}
    for member in ("colorOffset", "depthOffset"):
        for wrong in (-16, 0.5, "0", *NO_NUMBERS):
            yield BrokenInitPacket("MEM-8", {f"ring/{member}": wrong})
    for member, apart in (("colorOffset", ROOM // 2), ("depthOffset", ROOM // 4)):
        yield BrokenInitPacket("MEM-8", {f"ring/{member}": apart + 8, **room})
    color, depth = 16 * WIDTH * HEIGHT, 4 * WIDTH * HEIGHT
    behind = {"ring/depthOffset": ROOM // 2, **room}
    for wrong in (color - 16, color + 8, 0, -color, color + 0.5, str(color), *NO_NUMBERS):
        yield BrokenInitPacket("MEM-8", {"ring/colorStride": wrong, **behind})
    for wrong in (depth - 16, depth + 8, 0, -depth, depth + 0.5, str(depth), *NO_NUMBERS):
        yield BrokenInitPacket("MEM-8", {"ring/depthStride": wrong, **behind})
    yield BrokenInitPacket("MEM-8", {"ring/colorStride": color - 16, **behind}, slots=1)
    yield BrokenInitPacket("MEM-8", {"ring/depthStride": depth - 16, **behind}, slots=1)


def _overlaps() -> Iterator[BrokenInitPacket]:
    color, depth = 16 * WIDTH * HEIGHT, 4 * WIDTH * HEIGHT
    end_of_color = SLOTS * color
    for offset in (0, color, end_of_color - 16):
        yield BrokenInitPacket("MEM-9", {"ring/depthOffset": offset})
    yield BrokenInitPacket(
        "MEM-9", {"ring/colorOffset": depth, "ring/depthOffset": 0, "memory/bytes": ROOM}
    )
    interleaved = {
        "ring/colorStride": color + depth - 16,
        "ring/depthStride": color + depth - 16,
        "ring/depthOffset": color,
        "memory/bytes": ROOM,
    }
    yield BrokenInitPacket("MEM-9", interleaved)


def _semantics() -> Iterator[BrokenInitPacket]:
    yield from _each("MEM-12", "semantics", NO_OBJECTS)
    for member in ("rows", "alpha", "colorSpace", "depth", "unitMetres", "origin"):
        yield BrokenInitPacket("MEM-12", {f"semantics/{member}": ABSENT})
    wrong: dict[str, tuple[Any, ...]] = {
        "rows": ("top_down", "bottom-up", "", *NO_STRINGS[1:]),
        "alpha": ("inverse", "Straight", "", *NO_STRINGS[1:]),
        "colorSpace": ("rec2020", "sRGB", "", *NO_STRINGS[1:]),
        "depth": ("planar_z", *NO_OBJECTS[1:]),
        "depth/kind": ("inverse_z", "", *NO_STRINGS),
        "depth/estimator": ("nearest", "", *NO_STRINGS),
        "depth/empty": (ABSENT, "Infinity", "-inf", "100.0", *NO_NUMBERS),
        "unitMetres": (0, -1, "1", [], {}, False),
        "origin": ([], [0, 0], [0, 0, 0, 0], [0, "0", 0], [0, None, 0], {}, "0", 0, None),
    }
    for member, values in wrong.items():
        yield from _each("MEM-12", f"semantics/{member}", values)
    for beyond in (INFINITE_DEPTH, -INFINITE_DEPTH, 1e39, 10**39, 1e300):
        how = f"an empty depth of {abs(beyond):.1e}"
        yield BrokenInitPacket("MEM-12", {"semantics/depth/empty": beyond}, how=how)


def beyond_memory() -> list[BrokenInitPacket]:
    """Rings that end beyond `memory.bytes`, some by so much that 64 bits overflow."""
    color, depth = 16 * WIDTH * HEIGHT, 4 * WIDTH * HEIGHT
    size = SLOTS * (color + depth)
    near: tuple[dict[str, Any], ...] = (
        {"memory/bytes": size - 1},
        {"memory/bytes": 1},
        {"ring/slots": SLOTS + 1},
        {"ring/depthOffset": SLOTS * color + 16},
        {"ring/depthStride": depth + 16},
        {"ring/colorStride": 2 * SLOTS * color, "ring/depthOffset": color},
        {"ring/colorOffset": size},
    )
    quarter, whole = 1 << 62, 1 << 64
    far: tuple[dict[str, Any], ...] = (
        {"ring/depthOffset": quarter},
        {"ring/colorOffset": whole},
        {"ring/depthOffset": whole + SLOTS * color},
        {"ring/depthStride": quarter, "ring/slots": 5},
        {"ring/colorStride": quarter, "ring/depthStride": quarter, "ring/slots": 5},
        {"ring/colorStride": whole, "ring/depthStride": whole},
    )
    # Within the range of MEM-8 only the most slots at the greatest stride exceed 2⁶³.
    most = BEYOND - 16
    furthest = {
        f"ring/{plane}{what}": most for plane in ("color", "depth") for what in ("Offset", "Stride")
    }
    return [
        *(BrokenInitPacket("MEM-9", change) for change in near),
        BrokenInitPacket("MEM-9", {**furthest, "memory/bytes": ROOM}, 64, 64, LIMITS["max_slots"]),
        *(BrokenInitPacket("MEM-8", change) for change in far),
    ]


def wrapping_in_32_bits() -> list[BrokenInitPacket]:
    """Images and rings beyond memory that look small in arithmetic of 32 bits."""
    color, depth = 16 * WIDTH * HEIGHT, 4 * WIDTH * HEIGHT
    wrap = 1 << 32
    found = [_image(32768, 32768), _image(32768, 16384)]
    changes: tuple[dict[str, Any], ...] = (
        {"ring/colorOffset": wrap},
        {"ring/depthOffset": wrap + SLOTS * color},
        {"ring/colorStride": wrap + color},
        {"ring/depthStride": wrap + depth},
        {"memory/bytes": wrap + ROOM},
    )
    return [*found, *(BrokenInitPacket("MEM-9", change) for change in changes)]


def _image(width: int, height: int) -> BrokenInitPacket:
    """One slot with an image of this size, which `bytes` is too small for."""
    sizes = {"memory/bytes": ROOM, "ring/depthOffset": ROOM // 2}
    return BrokenInitPacket("MEM-9", sizes, width, height, slots=1)
