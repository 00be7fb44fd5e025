"""What the benchmarks on a GPU share: a reason not to run, arrays, kernels, what is published."""

from __future__ import annotations

import ctypes
import math
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from benchmarks import _shared

try:
    from splatbus_server.cuda.driver import Device, api, call
except ImportError:  # `require_gpu` says so
    api = call = Device = None  # type: ignore[assignment,misc]

__all__ = ["PIXEL_BYTES", "SIZES", "Buffer", "Device", "Kernel", "api", "call"]
__all__ += ["require_gpu", "synchronised", "write"]
SIZES = {"720p": (1280, 720), "1080p": (1920, 1080), "4K": (3840, 2160), "8K": (7680, 4320)}
PIXEL_BYTES = 20


def require_gpu(*modules: str) -> None:
    """Ends the program, without complaint, where there is no GPU or a module is missing."""
    missing = [each for each in ("cuda", *modules) if find_spec(each) is None]
    try:
        ctypes.CDLL("libcuda.so.1")
    except OSError:
        missing.append("an NVIDIA GPU")
    if missing:
        print(f"not run: {missing[0]} is not here")
        sys.exit()


class Buffer:
    """Device memory of our own, an array to whoever reads the CUDA array interface."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape, self.bytes = shape, 4 * math.prod(shape)
        self.pointer = int(call(api.cuMemAlloc, self.bytes))

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        about = {"version": 3, "shape": self.shape, "typestr": "<f4"}
        return about | {"data": (self.pointer, False), "strides": None, "stream": None}


class Kernel:
    """A function of CUDA C++ that takes pointers and 32-bit integers, over so many threads."""

    def __init__(self, source: str, name: str, device: Any) -> None:
        from splatbus_server.cuda.kernels import compiled

        module = call(api.cuModuleLoadData, compiled(source, {}, device.capability))
        self._function = call(api.cuModuleGetFunction, module, name.encode())

    def __call__(self, threads: int, stream: int, *arguments: Any) -> None:
        """Ints are 32 bits wide; pointers come as `ctypes.c_void_p`."""
        values = [a if isinstance(a, ctypes.c_void_p) else ctypes.c_uint(a) for a in arguments]
        addresses = (ctypes.c_void_p * len(values))(*(ctypes.addressof(v) for v in values))
        call(
            api.cuLaunchKernel,
            *(self._function, -(-threads // 256), 1, 1, 256, 1, 1, 0, stream),
            *(ctypes.addressof(addresses), 0),
        )


def synchronised(work: Callable[[], object]) -> float:
    """Milliseconds until the GPU is done with it, which is done with all else before."""
    import torch  # type: ignore[import-not-found,unused-ignore]

    torch.cuda.synchronize()
    return _shared.wall_ms(lambda: (work(), torch.cuda.synchronize()))


def write(program: str, report: dict[str, Any]) -> None:
    """`results/NAME.json`, with the GPU that it was measured on."""
    import cuda.bindings

    query = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    gpu, driver = subprocess.check_output(query, text=True).splitlines()[0].split(", ")
    about = {"gpu": gpu, "driver": driver, "cuda_bindings": cuda.bindings.__version__}
    _shared.write(program, about | report)
