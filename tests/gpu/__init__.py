"""Tests that need an NVIDIA GPU: `python -m tests.gpu` runs them all, with the sanitizer."""

from __future__ import annotations

import ctypes
import importlib.util
from functools import cache

import pytest


@cache
def why_not() -> str:
    """Why these tests cannot run here; nothing if they can."""
    try:
        found = importlib.util.find_spec("cuda.bindings")
    except ImportError:
        found = None
    if found is None:
        return "needs cuda-bindings: pip install '.[cuda]'"
    try:
        driver = ctypes.CDLL("libcuda.so.1")
    except OSError:
        return "needs a machine with an NVIDIA GPU"
    count = ctypes.c_int()
    if driver.cuInit(0) or driver.cuDeviceGetCount(ctypes.byref(count)) or not count.value:
        return "needs an NVIDIA GPU that this process sees"
    return ""


def require_gpu() -> None:
    """Skips the module that calls it where there is none."""
    if reason := why_not():
        pytest.skip(reason, allow_module_level=True)
