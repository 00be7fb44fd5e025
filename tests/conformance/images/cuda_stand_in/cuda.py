"""A process with CUDA: `python cuda.py LIBRARY` evaluates the expressions that it is told, a line
each, and prints their values as JSON. `cuda` in them is the library.
"""

import ctypes
import json
import sys
from typing import Any

H2D, D2H = 1, 2
UNTIMED, INTERPROCESS = 2, 4


class Handle(ctypes.Structure):
    """A `cudaIpcMemHandle_t` or `cudaIpcEventHandle_t`."""

    _fields_ = [("reserved", ctypes.c_ubyte * 64)]


class Cuda:
    """`Malloc(…)` calls `cudaMalloc` of a runtime, `MemAlloc(…)` `cuMemAlloc_v2` of a driver; the
    answer is the error code.
    """

    def __init__(self, path: str) -> None:
        self._library = ctypes.CDLL(path)
        self._prefix = "cu" if "libcuda." in path else "cuda"

    def __getattr__(self, name: str) -> Any:
        names = (f"{self._prefix}{name}_v2", f"{self._prefix}{name}")
        function = next(getattr(self._library, it) for it in names if hasattr(self._library, it))
        wide = ctypes.c_uint64  # else a pointer were cut to 32 bits
        return lambda *given: function(*(wide(it) if isinstance(it, int) else it for it in given))

    def made(self, name: str, *arguments: Any, kind: Any = ctypes.c_void_p) -> Any:
        """What a call of this name stores where its first argument points."""
        value = kind()
        if code := getattr(self, name)(ctypes.byref(value), *arguments):
            raise RuntimeError(f"{self._prefix}{name} gave {code}")
        return getattr(value, "value", value) or 0

    def handle(self, what: str, of: int) -> str:
        """The interprocess handle of `Mem` or `Event`, in hexadecimal digits."""
        return bytes(self.made(f"IpcGet{what}Handle", of, kind=Handle)).hex()

    def opened(self, what: str, text: str, *flags: int) -> Any:
        """What a handle names: `Mem` or `Event`; the error code, negative, if it is refused."""
        value = ctypes.c_void_p()
        handle = Handle.from_buffer_copy(bytes.fromhex(text))
        code = getattr(self, f"IpcOpen{what}Handle")(ctypes.byref(value), handle, *flags)
        return -code or value.value


if __name__ == "__main__":
    known = {**globals(), "cuda": Cuda(sys.argv[1]), "host": (ctypes.c_ubyte * (64 << 10))()}
    for line in sys.stdin:
        print(json.dumps(eval(line, known)), flush=True)
