"""How the time grows: with Gaussians, with pixels, with layers; and beside the floor."""

from __future__ import annotations

from typing import Any

import numpy as np
from splatbus_splats.drawing.skips import EXACT, NOTHING

from benchmarks.splats import drawn, scenes
from benchmarks.splats.brute import brute
from benchmarks.splats.scenes import Shot

COUNTS = (10_000, 30_000, 100_000, 300_000, 1_000_000)
SIZES = ((160, 120), (320, 240), (640, 480), (1280, 720), (1920, 1080))
LAYERS = (1, 3, 10, 30, 100)
BESIDE = ((10_000, (640, 480)), (30_000, (320, 240)), (100_000, (160, 120)))
"""For the floor, which takes a nanosecond for each Gaussian at each pixel."""


def measure(rounds: int) -> list[dict[str, Any]]:
    """Rows of milliseconds."""
    return [
        *(row("gaussians", count, scenes.front(count), rounds) for count in COUNTS),
        *(row("pixels", w * h, scenes.front(100_000, (w, h)), rounds) for w, h in SIZES),
        *(row("layers", count, scenes.walls(count), rounds) for count in LAYERS),
    ]


def row(by: str, x: int, shot: Shot, rounds: int) -> dict[str, Any]:
    """Of one scene, with the exact skips and without any."""
    found = {
        "by": by,
        "x": x,
        "ms": round(drawn.cost(shot, EXACT, rounds).usual, 2),
        "ms_without_skips": round(drawn.cost(shot, NOTHING, rounds).usual, 2),
    }
    print(", ".join(f"{key} {value}" for key, value in found.items()), flush=True)
    return found


def beside_floor(rounds: int) -> list[dict[str, Any]]:
    """How many times as long every Gaussian takes at every pixel."""
    rows = []
    for count, size in BESIDE:
        shot = scenes.front(count, size)
        view, right = shot.views[0], drawn.truth(shot)
        lens = (view.intrinsics, *size)
        image = drawn.image(shot, EXACT)
        floor = drawn.timed(lambda _, shot=shot, lens=lens: brute(shot.placed(), *lens), 1)
        taken = drawn.cost(shot, EXACT, rounds)
        whole = brute(shot.placed(), *lens)
        found = {
            "gaussians": count,
            "size": "{}x{}".format(*size),
            "ms": round(taken.usual, 2),
            "brute_ms": round(floor.usual, 1),
            "ratio": round(floor.usual / taken.usual, 1),
            "error_255": round(255 * drawn.error(image, right), 5),
            "between_255": round(255 * float(np.abs(image.color - whole.color).max()), 5),
        }
        print(", ".join(f"{key} {value}" for key, value in found.items()), flush=True)
        rows.append(found)
    return rows
