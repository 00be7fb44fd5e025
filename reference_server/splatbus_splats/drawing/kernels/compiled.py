"""How the loops are compiled, and how what they hand on is laid out."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np

from splatbus_splats.drawing import definition, harmonics

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
NUMBERS = (__file__, definition.__file__, harmonics.__file__)
"""Modules whose numbers are compiled into loops of others."""
LARGEST_ALPHA = np.float32(definition.LARGEST_ALPHA)
LEAST_ALPHA = np.float32(definition.LEAST_ALPHA)
LEAST_LEFT = np.float32(definition.LEAST_LEFT)


def compiled(function: Function) -> Function:
    """Compiled when it is called, without the interpreter's lock."""
    options = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
    try:
        found = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # there is no folder that it may keep it in
        return cast(Function, numba.njit(**options)(function))
    _drop_older(Path(found.stats.cache_path))
    return cast(Function, found)


@cache
def _drop_older(folder: Path) -> None:
    """Has Numba forget what it compiled with other numbers than those of this module.

    It asks whether the file of a function is as it was, and not whether those are whose numbers are
    compiled into it.
    """
    changed = max(Path(each).stat().st_mtime for each in NUMBERS)
    for index in folder.glob("*.nbi"):
        if index.stat().st_mtime < changed:
            index.unlink(missing_ok=True)
