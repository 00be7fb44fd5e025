"""Depth from 1e-6 to 1e9, alpha from 1 to 1e-7, subnormals: what a stored pixel is worth.

The renderer is made up: layers of alpha and depth, accumulated front to back in single precision
as rasterisers do. What is exact is the same sum in double precision.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.compositing import over_straight
from splatbus_wire.depth import COVERED_ALPHA_MIN, planar_depth

from benchmarks._pictures import pyplot, save

Singles = NDArray[np.float32]

DEPTHS = np.logspace(-6, 9, 15 * 211 + 1)
ALPHAS = np.logspace(0, -7, 141)
SUBNORMAL = np.float32(1e-41)


def deployed_depth(inverse: Singles, alpha: Singles) -> Singles:
    with np.errstate(divide="ignore"):
        return np.where(inverse > 1e-6, np.float32(1) / inverse, np.float32(100))


def plain_reciprocal(inverse: Singles, alpha: Singles) -> Singles:
    with np.errstate(divide="ignore"):
        return np.float32(1) / inverse


WAYS: dict[str, Callable[[Singles, Singles], Singles]] = {
    "deployed: 1/d if d > 1e-6 else 100": deployed_depth,
    "plain reciprocal, 1/d": plain_reciprocal,
    "A/d": planar_depth,
}


def by_depth(alpha: float) -> list[dict[str, Any]]:
    """Relative error of the depth of one surface of this alpha at each depth."""
    z = DEPTHS.astype(np.float32)
    a = np.full_like(z, alpha)
    inverse = a * (np.float32(1) / z)
    rows = []
    for name, way in WAYS.items():
        error = np.abs(way(inverse, a).astype(np.float64) - z) / z
        rows += [
            {"way": name, "alpha": alpha, "depth": float(d), "relative_error": float(e)}
            for d, e in zip(z, error, strict=True)
        ]
    return rows


def accumulated(layer_alphas: Singles, dtype: type) -> tuple[NDArray[Any], NDArray[Any]]:
    """Σαᵢ·Tᵢ and 1 − ΠTᵢ of (N, layers) alphas, in a precision."""
    transmittance = np.ones(len(layer_alphas), dtype)
    total = np.zeros(len(layer_alphas), dtype)
    for alpha in layer_alphas.T.astype(dtype):
        total += alpha * transmittance
        transmittance *= dtype(1) - alpha
    return total, dtype(1) - transmittance


def by_alpha(layers: int = 8) -> list[dict[str, Any]]:
    """Relative errors of the accumulated alpha; a surface at depth 4; straight colour 0.5."""
    a = (1.0 - (1.0 - ALPHAS * (1 - 1e-7)) ** (1.0 / layers)).astype(np.float32)
    stacked = np.repeat(a[:, None], layers, axis=1)
    right, _ = accumulated(stacked, np.float64)
    summed, complement = accumulated(stacked, np.float32)
    colour = np.float32(0.5) * summed  # premultiplied
    inverse = summed / np.float32(4)
    with np.errstate(divide="ignore"):
        straight = colour / complement
    depth = planar_depth(inverse, summed)
    return [
        {
            "alpha": float(right[i]),
            "sum_error": float(abs(summed[i] - right[i]) / right[i]),
            "complement_error": float(abs(complement[i] - right[i]) / right[i]),
            "straight_colour_error_255": float(min(abs(straight[i] - 0.5), 1.0) * 255),
            "depth": float(depth[i]) if np.isfinite(depth[i]) else "empty",
        }
        for i in range(len(ALPHAS))
    ]


def subnormals(pixels: int = 1 << 20, rounds: int = 15) -> list[dict[str, Any]]:
    """Time on the processor with subnormal numbers, as a multiple of that with normal ones."""
    one = np.ones(pixels, np.float32)
    tiny = np.full(pixels, SUBNORMAL)
    splats, faint = np.full((pixels, 4), 0.5, np.float32), np.full((pixels, 4), SUBNORMAL)
    mesh = np.full((pixels, 3), 0.5, np.float32)
    far = 2 * one
    steps: dict[str, tuple[Callable[[], Any], Callable[[], Any]]] = {
        "depth A/d, d subnormal": (
            lambda: planar_depth(one, one),
            lambda: planar_depth(tiny, one),
        ),
        "compositing, alpha and colour subnormal": (
            lambda: over_straight(splats, one, mesh, far),
            lambda: over_straight(faint, one, mesh, far),
        ),
        "products of two numbers, one subnormal": (
            lambda: one * splats[:, 0],
            lambda: tiny * splats[:, 0],
        ),
    }
    rows = []
    for name, (normal, subnormal) in steps.items():
        ratios = [seconds(subnormal) / seconds(normal) for _ in range(rounds)]
        rows.append({"step": name, "ratio_of_times": round(statistics.median(ratios), 2)})
    return rows


def seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def draw(depths: list[dict[str, Any]], alphas: list[dict[str, Any]], path: Path) -> None:
    plt = pyplot()
    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
    floor = 1e-9
    for colour, thick, name in zip(("crimson", "C1", "C0"), (5, 2.5, 1.2), WAYS, strict=True):
        for style, alpha in (("-", 1.0), ("--", 0.5)):
            line = [r for r in depths if r["way"] == name and r["alpha"] == alpha]
            z, error = (np.array([row[m] for row in line]) for m in ("depth", "relative_error"))
            thirds = np.clip(np.floor(3 * np.log10(z)), -18, 26)
            places = sorted(set(thirds.tolist()))
            left.plot(
                [10 ** ((third + 0.5) / 3) for third in places],
                [error[thirds == third].max() for third in places],
                color=colour,
                linestyle=style,
                linewidth=thick,
                label=f"{name}, A = {alpha:g}",
            )
    left.set(xscale="log", yscale="log", xlabel="depth of the surface (units)", ylim=(1e-8, 1e4))
    left.set_title(
        "relative error of the stored depth, worst of each third of a decade", fontsize=10
    )
    left.legend(fontsize=8, loc="upper left")

    places = [row["alpha"] for row in alphas]
    for member, label in (
        ("sum_error", "A = Σαᵢ·Tᵢ, relative error"),
        ("complement_error", "A = 1 − ΠTᵢ, relative error"),
    ):
        right.plot(places, [max(row[member], floor) for row in alphas], label=label)
    right.plot(
        places,
        [max(row["straight_colour_error_255"], floor) for row in alphas],
        label="straight colour by A = 1 − ΠTᵢ, error in /255",
    )
    right.axvline(float(COVERED_ALPHA_MIN), color="grey", linestyle=":")
    right.text(float(COVERED_ALPHA_MIN), 3e-10, " 1/255: fainter is empty", fontsize=8, ha="left")
    right.set(xscale="log", yscale="log", xlabel="accumulated alpha A")
    right.invert_xaxis()
    right.set_title("what a faint pixel is worth (float32, 8 layers)", fontsize=10)
    right.legend(fontsize=8)
    for axes in (left, right):
        axes.grid(alpha=0.3)
    save(figure, path)
