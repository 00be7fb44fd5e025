"""A rendered image over a client's own geometry [ACC-10]."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from splatbus_wire.compositing import over_straight

from benchmarks.accuracy import search
from benchmarks.accuracy.images import HEIGHT, WIDTH, Doubles, Floats, blocks, column, disc, ulps
from benchmarks.accuracy.study import Compute, Measure, Study, Variant, Worst

SAMPLES = 400_000
ONE = np.float32(1)


def whole(dtype: Any, C: Any, z: Floats, B: Any, far: Floats) -> Floats:
    """Whole images, operation after operation."""
    splats, under = C.astype(dtype, copy=False), B.astype(dtype, copy=False)
    a = splats[..., 3:]
    in_front = (z > 0) & (z < far) & (a[..., 0] > 0)
    with np.errstate(invalid="ignore"):
        blended = a * splats[..., :3] + (dtype(1) - a) * under
    result: Floats = np.where(in_front[..., None], blended, under).astype(np.float32, copy=False)
    return result


def by_channel(C: Floats, z: Floats, B: Floats, far: Floats) -> Floats:
    """On planes, without an inner loop over channels, as many rows as stay in the cache."""
    out = np.empty_like(B)
    for rows in blocks(len(C), 8 * C.shape[1]):
        a = C[rows, :, 3]
        in_front = (z[rows] > 0) & (z[rows] < far[rows]) & (a > 0)
        rest = ONE - a
        with np.errstate(invalid="ignore"):
            for k in range(3):
                under = B[rows, :, k]
                out[rows, :, k] = np.where(in_front, a * C[rows, :, k] + rest * under, under)
    return out


def between(C: Floats, z: Floats, B: Floats, far: Floats) -> Floats:
    """B + a·(C − B), a = 0 behind: one product less, but C − B cancels."""
    out = C[..., :3] - B
    out *= np.where((z > 0) & (z < far), C[..., 3], np.float32(0))[..., None]
    out += B
    return out


def taken_for_straight(C: Floats, z: Floats, B: Floats, far: Floats) -> Floats:
    """The formula for straight alpha on a·C, which is what a rasteriser accumulates."""
    a = C[..., 3:]
    in_front = (z > 0) & (z < far) & (a[..., 0] > 0)
    accumulated = a * C[..., :3]
    return np.where(in_front[..., None], a * accumulated + (ONE - a) * B, B)


HIDDEN = "NaN where a hidden colour is not finite"
VARIANTS = (
    Variant("default: float64, by channel, in blocks", over_straight, "default"),
    Variant("float32, whole images", partial(whole, np.float32)),
    Variant("float32, by channel, in blocks", by_channel),
    Variant("float64, whole images", partial(whole, np.float64)),
    Variant("float32, B + a·(C − B)", between, unlike=HIDDEN),
    Variant("deployed: premultiplied taken for straight", taken_for_straight, "deployed"),
)


def computed(compute: Compute, inputs: Floats) -> Floats:
    """(n, 3) inputs C, a, B as one row of pixels in front."""
    c, a, b = inputs.T
    C = np.stack([c, c, c, a], axis=-1)[None]
    B = np.stack([b, b, b], axis=-1)[None]
    near = np.ones(B.shape[:2], np.float32)
    result: Floats = compute(C, near, B, 2 * near)[0, :, 0]
    return result


def exactly(inputs: Floats) -> Doubles:
    c, a, b = inputs.T.astype(np.float64)
    blended: Doubles = a * c + (1.0 - a) * b
    return blended


def worst(compute: Compute, known: Sequence[Any]) -> list[Worst]:
    source = np.random.default_rng(search.SEED)
    every = source.random((SAMPLES, 3))
    every *= 10.0 ** (source.uniform(-7, 0, every.shape) * (source.random(every.shape) < 0.5))
    seeds = np.array([list(x.values()) for x in known], np.float32).reshape(-1, 3)

    def errors(inputs: Floats) -> Doubles:
        return ulps(computed(compute, inputs), exactly(inputs))

    def repaired(inputs: Floats) -> Floats:
        return np.clip(inputs, np.float32(1e-7), ONE)

    begin = np.concatenate([repaired(every.astype(np.float32)), seeds])
    error, x = search.climb_columns(errors, begin, repaired)
    return [Worst(error, column("C a B", x))]


def study() -> Study:
    source = np.random.default_rng(search.SEED)
    C = source.random((HEIGHT, WIDTH, 4), np.float32)
    B = source.random((HEIGHT, WIDTH, 3), np.float32)
    z = source.uniform(1.0, 2.0, (HEIGHT, WIDTH)).astype(np.float32)
    z[~disc()] = np.inf
    far = np.broadcast_to(np.linspace(0.5, 4.0, WIDTH, dtype=np.float32), z.shape).copy()
    out = np.empty_like(B)
    return Study(
        title="Compositing over a client's own geometry (1920×1080)",
        item="pixel",
        items=z.size,
        floor_title="numpy.copyto of the colours",
        floor=lambda: np.copyto(out, B),
        run=lambda compute: lambda: compute(C, z, B, far),
        variants=VARIANTS,
        measures=(Measure("A colour", "ULP of float32", 3.0, "ACC-10"),),
        worst=worst,
        rounds=9,
    )
