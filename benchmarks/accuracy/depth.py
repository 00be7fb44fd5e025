"""From accumulated inverse depth d and alpha A to planar depth A/d [ACC-8, ACC-9]."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from splatbus_conformance import oracle
from splatbus_conformance.oracle.rounding import SINGLE, to_double, ulp
from splatbus_server.publish import Publisher
from splatbus_server.source import source
from splatbus_wire.depth import planar_depth

from benchmarks.accuracy import search
from benchmarks.accuracy.images import HEIGHT, WIDTH, Doubles, Floats, column, disc, in_blocks, ulps
from benchmarks.accuracy.study import Measure, Part, Study, Variant, Worst

SAMPLES = 400_000
PUBLISHER = Publisher(WIDTH, HEIGHT)
NO_COLOR = np.zeros((HEIGHT, WIDTH, 3), np.float32)
SINGLE_MAX = np.finfo(np.float32).max
THRESHOLD = np.float32(1 / 255)


def published(d: Floats, A: Floats, out: Floats) -> Floats:
    """What the server does; it stores rows bottom-up."""
    PUBLISHER.write(source(NO_COLOR, d, A, "inverse", WIDTH, HEIGHT, False), None, out)
    return out[::-1]


def whole(d: Floats, A: Floats, out: Floats) -> Floats:
    return planar_depth(d, A, out=out)


def finished(depth: Any, d: Floats, A: Floats, out: Floats) -> Floats:
    """Empty where nothing is, the largest finite number where the quotient overflows."""
    covered = (d > 0) & (d < np.inf) & (A >= THRESHOLD) & (np.inf > A)
    out[...] = np.where(covered, np.minimum(depth, SINGLE_MAX), np.inf)
    return out


def divided_everywhere(d: Floats, A: Floats, out: Floats) -> Floats:
    """Divides empty pixels too, and mends them afterwards."""
    with np.errstate(all="ignore"):
        return finished(A / d, d, A, out)


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


ROW_BYTES = 12 * WIDTH
VARIANTS = (
    Variant("default: blocks, float32", published, "default"),
    Variant("planar_depth of the wire", whole),
    Variant("planar_depth, in blocks", in_blocks(whole, ROW_BYTES)),
    Variant("float64, rounded once", double),
    Variant("float64, in blocks", in_blocks(double, ROW_BYTES)),
    Variant("divided everywhere", divided_everywhere),
    Variant("A · (1/d)", reciprocal),
    Variant("A · (1/d), in blocks", in_blocks(reciprocal, ROW_BYTES)),
    Variant("deployed: 1/d or 100", deployed, "deployed"),
    Variant("A / d alone", unchecked, unlike="tells no empty pixel from a covered one"),
)


def computed(variant: Variant, inputs: Floats) -> Floats:
    """The depths of any number of inputs (n, 2), by way of whole images."""
    size = WIDTH * HEIGHT
    results = []
    for start in range(0, len(inputs), size):
        part = np.zeros((size, 2), np.float32)
        some = inputs[start : start + size]
        part[: len(some)] = some
        d, A = (np.ascontiguousarray(a).reshape(HEIGHT, WIDTH) for a in part.T)
        depth = variant.compute(d, A, np.empty((HEIGHT, WIDTH), np.float32))
        results.append(np.ascontiguousarray(depth).reshape(-1)[: len(some)])
    return np.concatenate(results)


def is_covered(inputs: Floats) -> Any:
    d, A = inputs.T
    return (d > 0) & (d < np.inf) & (A >= THRESHOLD) & (np.inf > A)


def quotient(inputs: Floats) -> Doubles:
    """A/d in float64, whose rounding is far below an ULP of float32; 1 where it is not judged."""
    d, A = inputs.T.astype(np.float64)
    with np.errstate(all="ignore"):
        z = A / d
    return np.where(is_covered(inputs) & (z <= float(SINGLE_MAX)), z, 1.0)


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


def worst(variant: Variant, known: Sequence[Any]) -> list[Worst]:
    every = pool()

    def errors(inputs: Floats) -> Doubles:
        depth = np.where(is_covered(inputs), computed(variant, inputs), np.float32(1))
        exact = quotient(inputs)
        return np.where(exact == 1.0, 0.0, ulps(depth, exact))

    def repaired(inputs: Floats) -> Floats:
        return np.where(is_covered(inputs)[:, None], inputs, np.float32(1))

    seeds = [list(x.values()) for x in known if x]
    begin = np.concatenate([every, np.array(seeds, np.float32).reshape(-1, 2)])
    _, x = search.climb_columns(errors, begin, repaired)
    d, A = map(Fraction, map(float, x))
    got = Fraction(float(computed(variant, x[None])[0]))
    error = to_double(abs(got - A / d) / ulp(A / d, SINGLE))

    depth = computed(variant, every)
    right = is_covered(every)
    taken = np.isfinite(depth) & (depth != 100.0)
    mistaken = np.flatnonzero(taken != right)
    example = column("d A", every[mistaken[0]]) if len(mistaken) else None
    return [
        Worst(error, column("d A", x)),
        Worst(len(mistaken) / len(every), _finite(example)),
    ]


def _finite(example: dict[str, float] | None) -> dict[str, Any] | None:
    """JSON has no infinities."""
    if example is None:
        return None
    return {name: a if np.isfinite(a) else str(a) for name, a in example.items()}


def study() -> Study:
    source = np.random.default_rng(search.SEED)
    A = source.random((HEIGHT, WIDTH), np.float32)
    A[~disc()] = 0.0
    d = A / source.uniform(1.0, 10.0, A.shape).astype(np.float32)
    out = np.empty_like(d)
    assert oracle.planar_depth(0.125, 0.5) == 4.0
    part = Part(
        item="pixel",
        items=d.size,
        floor_title="numpy.copyto of the depths",
        floor=lambda: np.copyto(out, d),
        run=lambda compute: lambda: compute(d, A, out),
        worst=worst,
        variants=VARIANTS,
        measures=(
            Measure("Depth of a covered pixel", "ULP of float32", 0.5, "ACC-8"),
            Measure("Pixels taken for covered or empty wrongly", "share", 0.0, "ACC-9"),
        ),
    )
    return Study("Inverse depth and alpha to planar depth (1920×1080)", [part], rounds=15)
