"""What the steps on whole images share: sizes, blocks, and errors in ULP of float32."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT = 1920, 1080
BLOCK_BYTES = 1 << 18

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]


def blocks(height: int, row_bytes: int) -> Iterator[slice]:
    """Rows that together take about 256 KiB, so that they stay in the processor's cache."""
    rows = max(1, BLOCK_BYTES // row_bytes)
    for start in range(0, height, rows):
        yield slice(start, start + rows)


def in_blocks(compute: Callable[..., Any], row_bytes: int) -> Callable[..., Any]:
    """The same step, a block of rows at a time; the last argument is what it writes to."""

    def work(*arrays: Floats) -> Floats:
        for rows in blocks(len(arrays[0]), row_bytes):
            compute(*(array[rows] for array in arrays))
        return arrays[-1]

    return work


def disc() -> NDArray[np.bool_]:
    """What a scene covers: masks of real images hang together, and branches foresee them."""
    y, x = np.mgrid[-1 : 1 : HEIGHT * 1j, -1 : 1 : WIDTH * 1j]
    return np.asarray(x * x + y * y < 0.9)


def ulps(got: Floats, exact: Doubles) -> Doubles:
    """|got − exact| in ULP of float32 at `exact`; `exact` must be finite."""
    _, exponent = np.frexp(exact)
    step = np.ldexp(1.0, np.maximum(exponent, -125) - 24)
    with np.errstate(invalid="ignore", over="ignore"):
        error: Doubles = np.abs(got.astype(np.float64) - exact) / step
    return np.where(np.isnan(error), np.inf, error)


def column(name: str, numbers: Floats) -> dict[str, float]:
    """One input of float32 numbers, as JSON; `name` lists what they are."""
    return {each: float(a) for each, a in zip(name.split(), numbers, strict=True)}
