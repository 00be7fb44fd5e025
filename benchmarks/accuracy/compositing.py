"""A rendered image over a client's own geometry [ACC-10]."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from splatbus_conformance import oracle
from splatbus_conformance.oracle.rounding import SINGLE, to_double, ulp
from splatbus_wire.compositing import over_straight

from benchmarks.accuracy import search
from benchmarks.accuracy.images import HEIGHT, WIDTH, Doubles, Floats, blocks, column, disc, ulps
from benchmarks.accuracy.study import Measure, Part, Study, Variant, Worst

SAMPLES = 400_000
ONE = np.float32(1)


def whole(C: Floats, z: Floats, B: Floats, far: Floats) -> Floats:
    """Whole images in single precision, operation after operation."""
    a = C[..., 3:]
    in_front = (z > 0) & (z < far) & (a[..., 0] > 0)
    with np.errstate(invalid="ignore"):
        blended = a * C[..., :3] + (ONE - a) * B
    return np.where(in_front[..., None], blended, B)


def by_channel(dtype: Any, C: Floats, z: Floats, B: Floats, far: Floats) -> Floats:
    """On planes: no inner loop over three channels."""
    a = C[..., 3].astype(dtype)
    in_front = (z > 0) & (z < far) & (a > 0)
    rest = dtype(1) - a
    out = np.empty_like(B)
    with np.errstate(invalid="ignore"):
        for k in range(3):
            blended = a * C[..., k] + rest * B[..., k]
            out[..., k] = np.where(in_front, blended, B[..., k])
    return out


def blockwise(compute: Any) -> Any:
    """The same, for as many rows at a time as stay in the cache."""

    def work(C: Floats, z: Floats, B: Floats, far: Floats) -> Floats:
        out = np.empty_like(B)
        for rows in blocks(len(C), 8 * C.shape[1]):
            out[rows] = compute(C[rows], z[rows], B[rows], far[rows])
        return out

    return work


def weight(C: Floats, z: Floats, far: Floats) -> Floats:
    """The splats' alpha where they are in front, else 0."""
    alpha = C[..., 3]
    return np.where((z > 0) & (z < far), alpha, np.float32(0))[..., None]


def weighted(C: Floats, z: Floats, B: Floats, far: Floats) -> Floats:
    """a·C + (1 − a)·B with a = 0 behind: B there too, where C is finite."""
    a = weight(C, z, far)
    out = (ONE - a) * B
    out += a * C[..., :3]
    return out


def between(C: Floats, z: Floats, B: Floats, far: Floats) -> Floats:
    """B + a·(C − B): one product less, but C − B cancels."""
    out = C[..., :3] - B
    out *= weight(C, z, far)
    out += B
    return out


def double(C: Any, z: Floats, B: Any, far: Floats) -> Floats:
    wide, under = C.astype(np.float64), B.astype(np.float64)
    a = wide[..., 3:]
    in_front = (z > 0) & (z < far) & (a[..., 0] > 0)
    with np.errstate(invalid="ignore"):
        blended = a * wide[..., :3] + (1.0 - a) * under
    result: Floats = np.where(in_front[..., None], blended, under).astype(np.float32)
    return result


def taken_for_straight(C: Floats, z: Floats, B: Floats, far: Floats) -> Floats:
    """The formula for straight alpha on a·C, which is what a rasteriser accumulates."""
    a = C[..., 3:]
    in_front = (z > 0) & (z < far) & (a[..., 0] > 0)
    accumulated = a * C[..., :3]
    return np.where(in_front[..., None], a * accumulated + (ONE - a) * B, B)


HIDDEN = "NaN where a hidden colour is not finite"
SINGLE_CHANNELS = partial(by_channel, np.float32)
VARIANTS = (
    Variant("default: float64, by channel, in blocks", over_straight, "default"),
    Variant("float32, whole images", whole),
    Variant("float32, by channel", SINGLE_CHANNELS),
    Variant("float32, by channel, in blocks", blockwise(SINGLE_CHANNELS)),
    Variant("float64, whole images", double),
    Variant("float32, alpha 0 behind", weighted, unlike=HIDDEN),
    Variant("float32, B + a·(C − B)", between, unlike=HIDDEN),
    Variant("deployed: premultiplied taken for straight", taken_for_straight, "deployed"),
)


def computed(variant: Variant, inputs: Floats) -> Floats:
    """(n, 3) inputs C, a, B as one row of pixels in front."""
    c, a, b = inputs.T
    C = np.stack([c, c, c, a], axis=-1)[None]
    B = np.stack([b, b, b], axis=-1)[None]
    near = np.ones(B.shape[:2], np.float32)
    result: Floats = variant.compute(C, near, B, 2 * near)[0, :, 0]
    return result


def exactly(inputs: Floats) -> Doubles:
    c, a, b = inputs.T.astype(np.float64)
    blended: Doubles = a * c + (1.0 - a) * b
    return blended


def worst(variant: Variant, known: Sequence[Any]) -> list[Worst]:
    source = np.random.default_rng(search.SEED)
    every = source.random((SAMPLES, 3))
    every *= 10.0 ** (source.uniform(-7, 0, every.shape) * (source.random(every.shape) < 0.5))
    seeds = np.array([list(x.values()) for x in known], np.float32).reshape(-1, 3)

    def errors(inputs: Floats) -> Doubles:
        return ulps(computed(variant, inputs), exactly(inputs))

    def repaired(inputs: Floats) -> Floats:
        return np.clip(inputs, np.float32(1e-7), ONE)

    begin = np.concatenate([repaired(every.astype(np.float32)), seeds])
    _, x = search.climb_columns(errors, begin, repaired)
    c, a, b = map(float, x)
    exact = oracle.composite((c, c, c, a), 1.0, (b, b, b), 2.0)[0]
    got = Fraction(float(computed(variant, x[None])[0]))
    return [Worst(to_double(abs(got - exact) / ulp(exact, SINGLE)), column("C a B", x))]


def study() -> Study:
    source = np.random.default_rng(search.SEED)
    C = source.random((HEIGHT, WIDTH, 4), np.float32)
    B = source.random((HEIGHT, WIDTH, 3), np.float32)
    z = source.uniform(1.0, 2.0, (HEIGHT, WIDTH)).astype(np.float32)
    z[~disc()] = np.inf
    far = np.broadcast_to(np.linspace(0.5, 4.0, WIDTH, dtype=np.float32), z.shape).copy()
    out = np.empty_like(B)
    part = Part(
        item="pixel",
        items=z.size,
        floor_title="numpy.copyto of the colours",
        floor=lambda: np.copyto(out, B),
        run=lambda compute: lambda: compute(C, z, B, far),
        worst=worst,
        variants=VARIANTS,
        measures=(Measure("A colour", "ULP of float32", 3.0, "ACC-10"),),
    )
    return Study("Compositing over a client's own geometry (1920×1080)", [part], rounds=9)
