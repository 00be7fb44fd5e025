"""Frames in memory of a GPU: opened by handle, read where they lie, given back once that is done.

Only `usable` is meant to be imported without cuda-bindings, which the extra `cuda` brings.
"""

import ctypes
import importlib.util
import sys


def usable() -> bool:
    """Whether cuda-bindings and a CUDA driver are there; starts neither."""
    try:
        if importlib.util.find_spec("cuda.bindings") is None:
            return False
        ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except (ImportError, OSError):
        return False
    return True
