"""What the benchmarks on a GPU share: a reason not to run, arrays, pinned numbers, reports."""

from __future__ import annotations

import ctypes
import importlib.util
import json
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results"
ROOT = Path(__file__).parents[1]
SIZES = {"720p": (1280, 720), "1080p": (1920, 1080), "4K": (3840, 2160), "8K": (7680, 4320)}
PIXEL_BYTES = 20


def require_gpu(*modules: str) -> None:
    """Ends the program, without complaint, where there is no GPU or a module is missing."""
    for module in ("cuda", *modules):
        if importlib.util.find_spec(module) is None:
            print(f"not run: {module} is not installed")
            sys.exit(0)
    try:
        ctypes.CDLL("libcuda.so.1")
    except OSError:
        print("not run: there is no NVIDIA GPU here")
        sys.exit(0)


class Buffer:
    """Device memory of our own, an array to whoever reads the CUDA array interface."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        from splatbus_server.cuda.driver import api, call

        self.shape = shape
        self.bytes = 4
        for length in shape:
            self.bytes *= length
        self.pointer = int(call(api.cuMemAlloc, self.bytes))

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        return {
            "version": 3,
            "shape": self.shape,
            "typestr": "<f4",
            "data": (self.pointer, False),
            "strides": None,
            "stream": None,
        }


class Kernel:
    """A function of CUDA C++ that takes pointers and 32-bit integers, over so many threads."""

    def __init__(self, source: str, name: str, device: Any) -> None:
        from splatbus_server.cuda.driver import api, call
        from splatbus_server.cuda.kernels import compiled

        module = call(api.cuModuleLoadData, compiled(source, {}, device.capability))
        self._function = call(api.cuModuleGetFunction, module, name.encode())

    def __call__(self, threads: int, stream: int, *arguments: Any) -> None:
        """Ints are 32 bits wide; pointers come as `ctypes.c_void_p`."""
        from splatbus_server.cuda.driver import api, call

        values = [a if isinstance(a, ctypes.c_void_p) else ctypes.c_uint(a) for a in arguments]
        addresses = (ctypes.c_void_p * len(values))(*(ctypes.addressof(v) for v in values))
        call(
            api.cuLaunchKernel,
            *(self._function, -(-threads // 256), 1, 1, 256, 1, 1, 0, stream),
            *(ctypes.addressof(addresses), 0),
        )


def machine() -> dict[str, Any]:
    """What it was measured on."""
    import cuda.bindings

    query = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    name, driver = subprocess.check_output(query, text=True).splitlines()[0].split(", ")
    return {
        "gpu": name,
        "driver": driver,
        "cuda_bindings": cuda.bindings.__version__,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def write(name: str, report: dict[str, Any]) -> None:
    """`results/NAME.json`, with the command that made it."""
    command = " ".join(["python -m benchmarks", name, *sys.argv[1:]])
    text = json.dumps({"command": command, **machine(), **report}, indent=1)
    (RESULTS / f"{name}.json").write_text(text + "\n", "utf-8")
