"""The calls of the CUDA driver that the harness makes, by ctypes: no toolkit, no package."""

import ctypes
import sys
from ctypes import POINTER, c_char_p, c_int, c_size_t, c_uint, c_uint64, c_void_p
from typing import Any

from splatbus_schemas import LIMITS

HANDLE_BYTES: int = LIMITS["handle_bytes"]
UUID_BYTES = 16
LIBRARY = "nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1"


class CudaError(OSError):
    """The driver refused a call."""


class Handle(ctypes.Structure):
    """An interprocess handle, which the driver takes by value."""

    _fields_ = (("bytes", ctypes.c_ubyte * HANDLE_BYTES),)


FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "cuInit": (c_uint,),
    "cuDeviceGetCount": (POINTER(c_int),),
    "cuDeviceGet": (POINTER(c_int), c_int),
    "cuDeviceGetUuid_v2": (c_void_p, c_int),
    "cuDevicePrimaryCtxRetain": (POINTER(c_void_p), c_int),
    "cuDevicePrimaryCtxRelease_v2": (c_int,),
    "cuCtxPushCurrent_v2": (c_void_p,),
    "cuCtxPopCurrent_v2": (POINTER(c_void_p),),
    "cuMemAlloc_v2": (POINTER(c_uint64), c_size_t),
    "cuMemGetInfo_v2": (POINTER(c_size_t), POINTER(c_size_t)),
    "cuMemFree_v2": (c_uint64,),
    "cuMemGetAddressRange_v2": (POINTER(c_uint64), POINTER(c_size_t), c_uint64),
    "cuMemHostAlloc": (POINTER(c_void_p), c_size_t, c_uint),
    "cuMemHostGetDevicePointer_v2": (POINTER(c_uint64), c_void_p, c_uint),
    "cuMemFreeHost": (c_void_p,),
    "cuMemcpyHtoDAsync_v2": (c_uint64, c_char_p, c_size_t, c_void_p),
    "cuMemcpyDtoHAsync_v2": (c_void_p, c_uint64, c_size_t, c_void_p),
    "cuMemsetD8Async": (c_uint64, ctypes.c_ubyte, c_size_t, c_void_p),
    "cuStreamCreate": (POINTER(c_void_p), c_uint),
    "cuStreamDestroy_v2": (c_void_p,),
    "cuStreamSynchronize": (c_void_p,),
    "cuStreamWaitValue32_v2": (c_void_p, c_uint64, ctypes.c_uint32, c_uint),
    "cuEventCreate": (POINTER(c_void_p), c_uint),
    "cuEventRecord": (c_void_p, c_void_p),
    "cuEventQuery": (c_void_p,),
    "cuEventDestroy_v2": (c_void_p,),
    "cuIpcGetMemHandle": (c_void_p, c_uint64),
    "cuIpcGetEventHandle": (c_void_p, c_void_p),
    "cuIpcOpenMemHandle_v2": (POINTER(c_uint64), Handle, c_uint),
    "cuIpcOpenEventHandle": (POINTER(c_void_p), Handle),
    "cuIpcCloseMemHandle": (c_uint64,),
    "cuGetErrorName": (c_int, POINTER(c_char_p)),
}
"""Their parameters: a pointer that were passed as a plain int would be cut to 32 bits."""


def load() -> Any:
    """The driver's library. OSError where there is none."""
    library = ctypes.CDLL(LIBRARY)
    for name, parameters in FUNCTIONS.items():
        getattr(library, name).argtypes = parameters
    return library


class Driver:
    """Calls by name: what goes wrong is an error that names the call."""

    def __init__(self, library: Any) -> None:
        self._library = library

    def call(self, name: str, *arguments: Any) -> None:
        """Call it. Raises CudaError."""
        if status := self.status(name, *arguments):
            raise CudaError(f"{name}: {self._name_of(status)}")

    def status(self, name: str, *arguments: Any) -> int:
        """Call it; what it returns, 0 for success."""
        return int(getattr(self._library, name)(*arguments))

    def made(self, name: str, kind: Any, *arguments: Any) -> Any:
        """Call what stores its result where its first argument points; that. Raises CudaError."""
        result = kind()
        self.call(name, ctypes.byref(result), *arguments)
        return result.value

    def bytes_of(self, name: str, count: int, *arguments: Any) -> bytes:
        """Call what fills so many bytes; those. Raises CudaError."""
        buffer = ctypes.create_string_buffer(count)
        self.call(name, buffer, *arguments)
        return buffer.raw

    def _name_of(self, status: int) -> str:
        name = c_char_p()
        self.status("cuGetErrorName", status, ctypes.byref(name))
        return name.value.decode() if name.value else f"error {status}"
