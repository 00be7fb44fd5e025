"""Images of 8K: a ring of them is longer than 2³¹ bytes. Are all pixels where they should be?

Every slot is filled through the publisher with numbers that say slot, row and column, and then read
back from the file itself, at offsets computed with Python's integers from the init packet's `ring`.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from splatbus_server.exchange import BOTH
from splatbus_server.memory import Memory
from splatbus_wire.init_packet import host_ring
from splatbus_wire.semantics import Semantics

SIZES = {"1080p": (1920, 1080), "4K": (3840, 2160), "8K": (7680, 4320)}

Singles = NDArray[np.float32]


def pattern(width: int, height: int, slot: int) -> tuple[Singles, Singles]:
    """RGBA and depth whose numbers name the pixel; the top row first."""
    columns = np.arange(width, dtype=np.float32)
    rows = np.arange(height, dtype=np.float32)
    color = np.empty((height, width, 4), np.float32)
    color[..., 0] = columns / np.float32(width)
    color[..., 1] = (rows / np.float32(height))[:, None]
    color[..., 2] = np.float32(slot / 64)
    color[..., 3] = 1.0
    depth = 1 + columns[None] + np.float32(slot)
    return color, np.ascontiguousarray(np.broadcast_to(depth, (height, width)))


def wrong_pixels(memory: Memory, samples: int, seed: int = 1) -> int:
    """How many of the sampled pixels of all slots, corners among them, hold other numbers."""
    width, height = memory.width, memory.height
    ring, shared = memory.init_packet.ring, memory.init_packet.memory
    assert ring is not None
    assert shared is not None
    random = np.random.default_rng(seed)
    wrong = 0
    with Path("/dev/shm", getattr(shared, "name", "")).open("rb") as file:

        def numbers(offset: int, count: int) -> Singles:
            file.seek(offset)
            return np.frombuffer(file.read(4 * count), "<f4")

        for slot in range(ring.slots):
            places = [(0, 0), (0, width - 1), (height - 1, 0), (height - 1, width - 1)]
            places += zip(
                random.integers(0, height, samples).tolist(),
                random.integers(0, width, samples).tolist(),
                strict=True,
            )
            for i, j in places:
                pixel = (height - 1 - i) * width + j
                color = numbers(ring.color_offset + slot * ring.color_stride + 16 * pixel, 4)
                depth = numbers(ring.depth_offset + slot * ring.depth_stride + 4 * pixel, 1)
                right = np.array(
                    (j / np.float32(width), i / np.float32(height), slot / 64, 1), np.float32
                )
                wrong += not ((color == right).all() and depth[0] == 1 + j + slot)
    return wrong


def seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def measure(name: str, readers: int, rounds: int, samples: int) -> dict[str, Any]:
    """One size: bytes, whether every pixel is right, time to publish beside a copy."""
    width, height = SIZES[name]
    memory = Memory(width, height, readers, Semantics())
    try:
        ring = memory.init_packet.ring
        assert ring is not None
        for slot in range(ring.slots):
            color, depth = pattern(width, height, slot)
            memory.writer(color, depth, None, "linear", None)(slot, BOTH)
        wrong = wrong_pixels(memory, samples) if sys.platform == "linux" else None
        last = ring.slots - 1

        def publish() -> None:
            memory.writer(color, depth, None, "linear", None)(last, BOTH)

        def copy() -> None:
            np.copyto(memory.color(last), color)
            np.copyto(memory.depth(last), depth)

        times = [(seconds(publish), seconds(copy)) for _ in range(rounds)]
    finally:
        memory.close()
    return {
        "size": name,
        "slots": ring.slots,
        "bytes": ring.depth_offset + ring.slots * ring.depth_stride,
        "first_slot_beyond_2_31": first_beyond(2**31, width, height, ring.slots),
        "sampled_pixels": ring.slots * (samples + 4),
        "wrong_pixels": wrong,
        "publish_ms": round(statistics.median(a for a, _ in times) * 1e3, 2),
        "copyto_ms": round(statistics.median(b for _, b in times) * 1e3, 2),
        "ratio": round(statistics.median(a / b for a, b in times), 2),
    }


def first_beyond(limit: int, width: int, height: int, slots: int) -> dict[str, int | None]:
    """The first slot that ends beyond that many bytes from the start, for colour and depth."""
    ring, _ = host_ring(width, height, slots)
    return {
        "color": next(
            (s for s in range(slots) if ring.color_offset + (s + 1) * ring.color_stride > limit),
            None,
        ),
        "depth": next(
            (s for s in range(slots) if ring.depth_offset + (s + 1) * ring.depth_stride > limit),
            None,
        ),
    }


def largest_offsets() -> list[dict[str, Any]]:
    """By size, the bytes of a ring of the default six slots, and what no longer holds offsets."""
    sizes = SIZES | {"16K": (15360, 8640), "largest": (32768, 32768)}
    rows = []
    for name, (width, height) in sizes.items():
        _, total = host_ring(width, height, 6)
        rows.append(
            {
                "size": name,
                "bytes_of_six_slots": total,
                "pixels": width * height,
                "fits_int32": total < 2**31,
                "fits_uint32": total < 2**32,
                "pixel_index_exact_in_float32": width * height <= 2**24,
            }
        )
    return rows
