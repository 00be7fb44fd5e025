"""What the steps on whole images share: sizes, blocks, and errors in ULP of float32."""

from __future__ import annotations

from collections.abc import Iterator

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


def column(name: str, numbers: Floats) -> dict[str, float | str]:
    """One input of float32 numbers, as JSON without infinities; `name` lists what they are."""
    found = zip(name.split(), numbers, strict=True)
    return {each: float(a) if np.isfinite(a) else str(a) for each, a in found}
