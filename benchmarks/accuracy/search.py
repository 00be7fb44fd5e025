"""The search for bad cases: many inputs at random, then climbing from the worst of them.

Errors are exact, so a search can only understate them; the worst inputs of earlier runs are
starting points of the next.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.study import Compute, Worst

Numbers = tuple[float, ...]
Columns = NDArray[np.float32]

SEED = 1
DRAWN = 6000
STARTS, STEPS = 10, 800
HALF_TURNS = (
    # Where long climbs ended that looked for what 1 − s(y² + z²) costs.
    (-0.001679857130093146, 0.8105190822669939, 0.5862386132455417, -0.0009542649806552684),
    (-0.7142254160634234, 0.708424877744617, 0.012598090850222975, 1.0274872004014964e-05),
    (0.7080916218046034, 0.7084141741311736, -0.01850032608345227, 1.0048220438809929e-08),
    (0.7072903396458428, 0.7105116724151237, -0.07730604940000613, 0.0025501131426139624),
    (-0.003066021279409015, 1.0001740825831513, 0.017486229539117538, -5.849537083236257e-07),
    (0.013311314657677376, -1.0019143669312318, 0.005065870778411405, -0.00028612686603677744),
)
KEPT, AROUND, GENERATIONS = 64, 256, 40


def climbing(
    errors: Sequence[Callable[[Compute, Numbers], float]],
    draw: Callable[[random.Random], Numbers],
    repair: Callable[[Numbers], Numbers],
) -> Callable[[Compute, Sequence[Any]], list[Worst]]:
    """The search for the worst input of a variant by each of some errors.

    Args:
        errors: of a variant's function at an input.
        draw: an input.
        repair: makes a changed input a valid one.
    """

    def worst(compute: Compute, known: Sequence[Any]) -> list[Worst]:
        source = random.Random(SEED)
        pool = [draw(source) for _ in range(DRAWN)] + [*map(tuple, known)]
        return [climb(partial(error, compute), pool, repair) for error in errors]

    return worst


def climb(
    error: Callable[[Numbers], float],
    pool: Sequence[Numbers],
    repair: Callable[[Numbers], Numbers],
) -> Worst:
    """The worst input found: of the pool, or by changing its worst a little, again and again."""
    source = random.Random(SEED)
    ranked = sorted(((error(x), x) for x in pool), reverse=True)[:STARTS]
    best = ranked[0]
    for here in ranked:
        for _ in range(STEPS):
            candidate = repair(_changed(source, here[1]))
            there = error(candidate)
            if there >= here[0]:
                here = there, candidate
        best = max(best, here)
    return Worst(best[0], list(best[1]))


def _changed(source: random.Random, x: Numbers) -> Numbers:
    scale = 10.0 ** source.uniform(-16, 0)
    chosen = source.choice([range(len(x)), [source.randrange(len(x))]])
    return tuple(
        a * (1.0 + scale * source.gauss(0, 1)) + scale * 1e-6 * source.gauss(0, 1)
        if i in chosen
        else a
        for i, a in enumerate(x)
    )


def climb_columns(
    errors: Callable[[Columns], NDArray[np.float64]],
    pool: Columns,
    repair: Callable[[Columns], Columns],
) -> tuple[float, Columns]:
    """As `climb`, for a step on float32 arrays, many inputs at a time.

    Args:
        errors: of inputs (inputs, numbers), float32, one each.
        pool: inputs to begin with.
        repair: makes changed inputs valid ones.
    """
    source = np.random.default_rng(SEED)
    for _ in range(GENERATIONS):
        found = errors(pool)
        best = pool[np.argsort(-found)[:KEPT]]
        scale = 10.0 ** source.uniform(-8, 0, (KEPT * AROUND, 1))
        noise = scale * source.standard_normal((KEPT * AROUND, pool.shape[1]))
        noise *= source.random(noise.shape) < 0.6
        changed = np.repeat(best, AROUND, axis=0) * (1.0 + noise)
        with np.errstate(over="ignore"):
            pool = repair(np.concatenate([best, changed]).astype(np.float32))
    found = errors(pool)
    return float(found.max()), pool[int(found.argmax())]


def unit(q: Numbers) -> Numbers:
    """The quaternion, brought back to norm 1 ± 0.01 if it left that."""
    norm = math.hypot(*q)
    if norm == 0.0:
        return (0.0, 0.0, 0.0, 1.0)
    if 0.9901 <= norm <= 1.0099:
        return q
    return tuple(a / norm for a in q)


def quaternions(source: random.Random) -> Numbers:
    """Anywhere; near 1; near a half-turn; at a bad one; of a norm that is merely near 1."""
    x, y, z, w = (source.gauss(0, 1) for _ in range(4))
    small = 10.0 ** source.uniform(-12, 0)
    shape = source.randrange(4)
    if shape == 3:
        return source.choice(HALF_TURNS)
    if shape == 1:
        x, y, z = x * small, y * small, z * small
    elif shape == 2:
        w *= small
    norm = math.hypot(x, y, z, w) / source.choice([1.0, source.uniform(0.991, 1.009)])
    return x / norm, y / norm, z / norm, w / norm


def positions(source: random.Random, low: float = -3, high: float = 9) -> Numbers:
    """Three coordinates of a magnitude from 10^low to 10^high."""
    magnitude = 10.0 ** source.uniform(low, high)
    return tuple(magnitude * source.uniform(-1, 1) for _ in range(3))


def floats(result: Any) -> list[float]:
    """The numbers of a result, flat, whatever it came in."""
    return [float(a) for a in np.ravel(result)]
