"""Cases of `images.json`: where in memory a pixel lies."""

from typing import NamedTuple

from splatbus_conformance.oracle.vectors.layout import Json

COLOR_BYTES, DEPTH_BYTES = 16, 4


class Buffers(NamedTuple):
    """What an init packet says of the memory, in pixels and bytes."""

    width: int
    height: int
    color_offset: int
    depth_offset: int


class Ring(NamedTuple):
    """What `ring` says of it, in bytes."""

    slots: int
    color_offset: int
    color_stride: int
    depth_offset: int
    depth_stride: int


SMALL = Buffers(3, 2, 0, 96)
CHAPTER_4 = Buffers(64, 48, 0, 49_152)
LARGEST = Buffers(32_768, 32_768, 256, 17_179_869_440)
MOVED = Buffers(640, 480, 1_232_896, 0)
THREE_SLOTS = Ring(3, 0, 1_228_800, 3_686_400, 307_200)
PADDED = Ring(5, 4096, 1_229_056, 6_150_144, 307_456)

LEGACY = {
    "the upper left of a small image": (SMALL, (0, 0)),
    "the lower right of a small image": (SMALL, (2, 1)),
    "the upper left of the example in chapter 4": (CHAPTER_4, (0, 0)),
    "the lower left of the example in chapter 4": (CHAPTER_4, (0, 47)),
    "offsets that are not 0": (MOVED, (17, 5)),
    "the upper right of the largest image": (LARGEST, (32_767, 0)),
    "the lower left of the largest image": (LARGEST, (0, 32_767)),
}
SLOTS = {
    "slot 0": (THREE_SLOTS, 0, (0, 0)),
    "slot 2, the upper right": (THREE_SLOTS, 2, (319, 0)),
    "slot 4 of a padded ring": (PADDED, 4, (100, 200)),
}


def cases() -> list[Json]:
    """Return the cases of `place`."""
    return [
        *[_legacy(name, *given) for name, given in LEGACY.items()],
        *[_slot(name, *given) for name, given in SLOTS.items()],
    ]


def _legacy(name: str, buffers: Buffers, pixel: tuple[int, int]) -> Json:
    meta = _meta(buffers.width, buffers.height)
    offsets = {"offsetColor": buffers.color_offset, "offsetDepth": buffers.depth_offset}
    return {
        "name": f"place: {name}",
        "requirement": "BUF-1",
        "quantity": "place",
        "meta": {**meta, **offsets},
        "pixel": list(pixel),
        "expected": _place(
            buffers.width, buffers.height, buffers.color_offset, buffers.depth_offset, *pixel
        ),
    }


def _slot(name: str, ring: Ring, slot: int, pixel: tuple[int, int]) -> Json:
    width, height = 320, 240
    color = ring.color_offset + slot * ring.color_stride
    depth = ring.depth_offset + slot * ring.depth_stride
    return {
        "name": f"place: {name}",
        "requirement": "MEM-8",
        "since": "1.1",
        "quantity": "place",
        "meta": _meta(width, height),
        "ring": {
            "slots": ring.slots,
            "colorOffset": ring.color_offset,
            "colorStride": ring.color_stride,
            "depthOffset": ring.depth_offset,
            "depthStride": ring.depth_stride,
        },
        "slot": slot,
        "pixel": list(pixel),
        "expected": _place(width, height, color, depth, *pixel),
    }


def _meta(width: int, height: int) -> dict[str, int]:
    return {
        "w": width,
        "h": height,
        "pitchColor": COLOR_BYTES * width,
        "pitchDepth": DEPTH_BYTES * width,
    }


def _place(width: int, height: int, color: int, depth: int, column: int, row: int) -> Json:
    """Rows of the image counted from the top, rows in memory from the bottom (BUF-1)."""
    below = height - 1 - row
    number = below * width + column
    return {
        "memory_row": below,
        "color_byte": color + COLOR_BYTES * number,
        "depth_byte": depth + DEPTH_BYTES * number,
    }
