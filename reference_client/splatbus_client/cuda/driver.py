"""The CUDA driver as this client needs it, and errors that say what to do."""

import ctypes
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from cuda.bindings import __version__ as bindings  # type: ignore[import-not-found,unused-ignore]
from cuda.bindings import driver as api

if not bindings.startswith("13."):  # pragma: no cover
    extra = "install it with: pip install 'splatbus-protocol[cuda]'"
    raise ImportError(f"memory on a GPU needs cuda-bindings 13, and this is {bindings}; {extra}")

__all__ = ["CudaError", "Device", "api", "call", "device", "filled", "numbered"]

_HINTS = {
    "CUDA_ERROR_INVALID_CONTEXT": "a process cannot open its own memory: is the server in it?",
    "CUDA_ERROR_INVALID_HANDLE": "the process that shared it has ended",
    "CUDA_ERROR_INVALID_VALUE": "it was freed, or comes from another machine or container",
    "CUDA_ERROR_MAP_FAILED": "it is not shared with this process: another container, or WSL 2?",
    "CUDA_ERROR_NOT_SUPPORTED": "this platform shares no GPU memory (WSL 2, MIG, a container?)",
    "CUDA_ERROR_NO_DEVICE": "this process sees no GPU: look at CUDA_VISIBLE_DEVICES",
    "CUDA_ERROR_NOT_INITIALIZED": "was this process forked after it had used CUDA?",
}


class CudaError(Exception):
    """The driver refused a call: which one, why, and what may be the matter."""


def call(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return what the driver's function returns, without its status.

    Raises:
        CudaError: the status is not success.
    """
    status, *results = function(*arguments)
    if status:
        _, text = api.cuGetErrorString(status)
        reason = text.decode() if text else "unknown error"
        hint = _HINTS.get(status.name)
        said = f"{function.__name__}: {reason} ({status.name})"
        raise CudaError(said + (f"; {hint}" if hint else ""))
    return results[0] if len(results) == 1 else tuple(results)


class Device:
    """A device and its primary context, the one that PyTorch, CuPy and JAX use too.

    Attributes:
        ordinal: as this process counts.
    """

    def __init__(self, ordinal: int) -> None:
        self.ordinal = ordinal
        self._context = call(api.cuDevicePrimaryCtxRetain, call(api.cuDeviceGet, ordinal))

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make the context this thread's for the block."""
        call(api.cuCtxPushCurrent, self._context)
        try:
            yield
        finally:
            call(api.cuCtxPopCurrent)


_devices: dict[str, Device] = {}


def device(wanted: str) -> Device:
    """Return the device with a UUID, however this process counts its devices [MEM-17].

    Args:
        wanted: `GPU-` and a UUID in lower case.

    Raises:
        CudaError: there is no driver, or this process does not see the device.
    """
    if wanted not in _devices:
        found = _seen()
        if wanted not in found:
            raise CudaError(
                f"the images are on device {wanted}, and this process sees"
                f" {', '.join(found) or 'none'}: look at CUDA_VISIBLE_DEVICES"
            )
        _devices[wanted] = Device(found.index(wanted))
    return _devices[wanted]


def numbered(ordinal: int) -> Device:
    """Return the device with this number, which is right where the server counts alike [CUD-6].

    Raises:
        CudaError: there is no driver, or this process does not see so many devices.
    """
    found = _seen()
    if ordinal >= len(found):
        raise CudaError(
            f"the images are on device {ordinal}, and this process sees {len(found)} devices:"
            " look at CUDA_VISIBLE_DEVICES"
        )
    return device(found[ordinal])


def _seen() -> list[str]:
    try:
        call(api.cuInit, 0)
    except CudaError:
        raise
    except Exception as problem:  # of cuda.pathfinder: its type differs between versions
        raise CudaError(f"there is no CUDA driver on this machine: {problem}") from None
    return [_uuid(ordinal) for ordinal in range(call(api.cuDeviceGetCount))]


def _uuid(ordinal: int) -> str:
    structure = call(api.cuDeviceGetUuid, call(api.cuDeviceGet, ordinal))
    return f"GPU-{uuid.UUID(bytes=ctypes.string_at(structure.getPtr(), 16))}"


def filled(structure: Any, data: bytes) -> Any:
    """Return a handle of the driver with these bytes, whatever its members are called."""
    ctypes.memmove(structure.getPtr(), data, len(data))
    return structure
