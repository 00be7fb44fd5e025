"""From accumulated inverse depth d and alpha A to planar depth A/d [ACC-8, ACC-9]."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from splatbus_server.publish import Publisher
from splatbus_server.source import source

from benchmarks.accuracy import search
from benchmarks.accuracy.images import HEIGHT, WIDTH, Doubles, Floats, column, disc, ulps
from benchmarks.accuracy.study import Compute, Measure, Study, Variant, Worst

SAMPLES = 400_000
PUBLISHER = Publisher(WIDTH, HEIGHT)
NO_COLOR = np.zeros((HEIGHT, WIDTH, 3), np.float32)
SINGLE_MAX = np.finfo(np.float32).max
THRESHOLD = np.float32(1 / 255)


def published(d: Floats, A: Floats, out: Floats) -> Floats:
    """What the server does; it stores rows bottom-up."""
    PUBLISHER.write(source(NO_COLOR, d, A, "inverse", WIDTH, HEIGHT, False), None, out)
    return out[::-1]


def finished(depth: Any, d: Floats, A: Floats, out: Floats) -> Floats:
    """Empty where nothing is, the largest finite number where the quotient overflows."""
    out[...] = np.where(is_covered(d, A), np.minimum(depth, SINGLE_MAX), np.inf)
    return out


def double(d: Floats, A: Floats, out: Floats) -> Floats:
    with np.errstate(all="ignore"):
        return finished(A.astype(np.float64) / d, d, A, out)


def reciprocal(d: Floats, A: Floats, out: Floats) -> Floats:
    """A · (1/d): two roundings."""
    with np.errstate(all="ignore"):
        return finished(A * np.reciprocal(d), d, A, out)


def deployed(d: Floats, A: Floats, out: Floats) -> Floats:
    """1/d where d > 10⁻⁶, else 100; rows flipped, A unknown."""
    flipped = d[::-1]
    with np.errstate(all="ignore"):
        out[...] = np.where(flipped > np.float32(1e-6), np.reciprocal(flipped), np.float32(100))
    return out[::-1]


def unchecked(d: Floats, A: Floats, out: Floats) -> Floats:
    with np.errstate(all="ignore"):
        return np.divide(A, d, out=out)


VARIANTS = (
    Variant("default: blocks, float32", published, "default"),
    Variant("float64, rounded once", double),
    Variant("A · (1/d)", reciprocal),
    Variant("deployed: 1/d or 100", deployed, "deployed"),
    Variant("A / d alone", unchecked, unlike="tells no empty pixel from a covered one"),
)


def computed(compute: Compute, inputs: Floats) -> Floats:
    """The depths of any number of inputs (n, 2), by way of whole images."""
    size = WIDTH * HEIGHT
    results = []
    for start in range(0, len(inputs), size):
        part = np.zeros((size, 2), np.float32)
        some = inputs[start : start + size]
        part[: len(some)] = some
        d, A = (np.ascontiguousarray(a).reshape(HEIGHT, WIDTH) for a in part.T)
        depth = compute(d, A, np.empty((HEIGHT, WIDTH), np.float32))
        results.append(np.ascontiguousarray(depth).reshape(-1)[: len(some)])
    return np.concatenate(results)


def is_covered(d: Floats, A: Floats) -> Any:
    return (d > 0) & (d < np.inf) & (A >= THRESHOLD) & (np.inf > A)


def quotient(inputs: Floats) -> Doubles:
    """A/d in float64, whose rounding is far below an ULP of float32; 1 where it is not judged."""
    d, A = inputs.T.astype(np.float64)
    with np.errstate(all="ignore"):
        z = A / d
    return np.where(is_covered(*inputs.T) & (z <= float(SINGLE_MAX)), z, 1.0)


def pool() -> Floats:
    """d of every magnitude, subnormal too; A from 1/255 to 1, and about the threshold."""
    source = np.random.default_rng(search.SEED)
    d = 10.0 ** source.uniform(-45, 38.5, SAMPLES) * source.choice([1, 1, 1, 1, 0, -1], SAMPLES)
    A = source.choice([1.0, *THRESHOLD * (1 + np.arange(-2, 3) * 2.0**-23)], SAMPLES)
    A = np.where(source.random(SAMPLES) < 0.7, source.random(SAMPLES), A)
    odd = [np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-45, 1e-6, 1.0, 3e38]
    strange = np.array([(a, b) for a in odd for b in odd])
    with np.errstate(over="ignore"):
        return np.concatenate([np.stack([d, A], axis=1), strange]).astype(np.float32)


def worst(compute: Compute, known: Sequence[Any]) -> list[Worst]:
    every = pool()

    def errors(inputs: Floats) -> Doubles:
        exact = quotient(inputs)
        return np.where(exact == 1.0, 0.0, ulps(computed(compute, inputs), exact))

    def repaired(inputs: Floats) -> Floats:
        return np.where(is_covered(*inputs.T)[:, None], inputs, np.float32(1))

    seeds = np.array([list(x.values()) for x in known if x], np.float32).reshape(-1, 2)
    error, x = search.climb_columns(errors, np.concatenate([every, seeds]), repaired)
    depth = computed(compute, every)
    taken = np.isfinite(depth) & (depth != 100.0)
    mistaken = np.flatnonzero(taken != is_covered(*every.T))
    example = column("d A", every[mistaken[0]]) if len(mistaken) else None
    return [Worst(error, column("d A", x)), Worst(len(mistaken) / len(every), example)]


def study() -> Study:
    source = np.random.default_rng(search.SEED)
    A = source.random((HEIGHT, WIDTH), np.float32)
    A[~disc()] = 0.0
    d = A / source.uniform(1.0, 10.0, A.shape).astype(np.float32)
    out = np.empty_like(d)
    return Study(
        title="Inverse depth and alpha to planar depth (1920×1080)",
        item="pixel",
        items=d.size,
        floor_title="numpy.copyto of the depths",
        floor=lambda: np.copyto(out, d),
        run=lambda compute: lambda: compute(d, A, out),
        variants=VARIANTS,
        measures=(
            Measure("Depth of a covered pixel", "ULP of float32", 0.5, "ACC-8"),
            Measure("Pixels taken for covered or empty wrongly", "share", 0.0, "ACC-9"),
        ),
        worst=worst,
        rounds=15,
    )
