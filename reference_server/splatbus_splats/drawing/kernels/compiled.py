"""How the loops are compiled, and how what they hand on is laid out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np

from splatbus_splats.drawing import definition

Function = TypeVar("Function", bound=Callable[..., Any])

TILE, BLOCK = 16, 4
"""Pixels, the width and height of a tile, and of the blocks in it that are drawn at once."""
U, V, ACROSS, ALONG, DOWN = range(5)
"""Of a Gaussian's shape, float64: its centre, pixels, and what U and V take of dx and dy."""
RED, GREEN, BLUE, OPACITY, INVERSE = range(5)
"""Of its paint, float32; `INVERSE` is 1/z."""
LEFT, RIGHT, TOP, BOTTOM = range(4)
"""Of its box, int32, pixels: its first column and the one after its last, and rows likewise."""
NOTHING, ONE = np.float32(0.0), np.float32(1.0)
LARGEST_ALPHA = np.float32(definition.LARGEST_ALPHA)
LEAST_ALPHA = np.float32(definition.LEAST_ALPHA)
LEAST_LEFT = np.float32(definition.LEAST_LEFT)


def compiled(function: Function) -> Function:
    """Compiled when it is called, without the interpreter's lock."""
    options = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
    try:
        return cast(Function, numba.njit(cache=True, **options)(function))
    except RuntimeError:  # there is no folder that it may keep it in
        return cast(Function, numba.njit(**options)(function))
