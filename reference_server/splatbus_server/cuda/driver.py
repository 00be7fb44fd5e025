"""The CUDA driver as this server needs it: one device, and errors that say what to do."""

from __future__ import annotations

import ctypes
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from splatbus_schemas import LIMITS

_HANDLE_BYTES: int = LIMITS["handle_bytes"]
_EXTRA = "install it with: pip install 'splatbus-protocol[cuda]'"

try:
    from cuda.bindings import __version__ as bindings  # type: ignore[import-not-found,unused-ignore]
    from cuda.bindings import driver as api
except ImportError as problem:  # pragma: no cover
    raise ImportError(f"memory on a GPU needs cuda-bindings; {_EXTRA}") from problem
if not bindings.startswith("13."):  # pragma: no cover
    raise ImportError(f"memory on a GPU needs cuda-bindings 13, and this is {bindings}; {_EXTRA}")

__all__ = ["CudaError", "Device", "api", "call", "event_handle", "interprocess_event"]
__all__ += ["memory_handle", "refused"]

_HINTS = {
    "CUDA_ERROR_NO_DEVICE": "this process sees no GPU: look at CUDA_VISIBLE_DEVICES",
    "CUDA_ERROR_INVALID_DEVICE": "there is no such device: look at CUDA_VISIBLE_DEVICES",
    "CUDA_ERROR_OUT_OF_MEMORY": "an image takes 20 bytes a pixel, and there are readers + 3",
    "CUDA_ERROR_NOT_SUPPORTED": "this platform shares no GPU memory (WSL 2, MIG, a container?)",
    "CUDA_ERROR_NOT_INITIALIZED": "was this process forked after it had used CUDA?",
}


class CudaError(OSError):
    """The driver refused a call: which one, why, and what can be done."""


def call(function: Callable[..., Any], *arguments: Any) -> Any:
    """What the driver's function returns, without its status.

    Raises:
        CudaError: the status is not success.
    """
    status, *results = function(*arguments)
    if status:
        raise refused(function.__name__, status)
    return results[0] if len(results) == 1 else tuple(results)


def refused(name: str, status: Any) -> CudaError:
    """The error for a call that returned `status`."""
    _, text = api.cuGetErrorString(status)
    reason = text.decode() if text else "unknown error"
    hint = _HINTS.get(status.name)
    return CudaError(f"{name}: {reason} ({status.name})" + (f"; {hint}" if hint else ""))


class Device:
    """A device and its primary context, the one that PyTorch, CuPy and JAX use too.

    Attributes:
        ordinal: as this process counts.
        uuid: `GPU-` and the UUID in lower case [MEM-2].
        capability: major and minor number of what it can compute.
        context: of the driver.
    """

    def __init__(self, ordinal: int) -> None:
        """Starts to use the device.

        Raises:
            CudaError: there is no driver, no such device, or it shares no memory.
        """
        try:
            call(api.cuInit, 0)
        except CudaError:
            raise
        except Exception as problem:  # of cuda.pathfinder: its type differs between versions
            raise CudaError(f"there is no CUDA driver on this machine: {problem}") from None
        self.ordinal = ordinal
        self._device = call(api.cuDeviceGet, ordinal)
        self.uuid = f"GPU-{uuid.UUID(bytes=_bytes(call(api.cuDeviceGetUuid, self._device), 16))}"
        attribute = api.CUdevice_attribute
        self.capability = (
            self._attribute(attribute.CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR),
            self._attribute(attribute.CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MINOR),
        )
        if not self._attribute(attribute.CU_DEVICE_ATTRIBUTE_IPC_EVENT_SUPPORTED):
            raise CudaError(
                f"device {ordinal} shares no events with other processes on this system"
            )
        self.context = call(api.cuDevicePrimaryCtxRetain, self._device)

    @contextmanager
    def current(self) -> Iterator[None]:
        """Makes the context this thread's for the block."""
        call(api.cuCtxPushCurrent, self.context)
        try:
            yield
        finally:
            call(api.cuCtxPopCurrent)

    def _attribute(self, which: Any) -> int:
        value: int = call(api.cuDeviceGetAttribute, which, self._device)
        return value


def memory_handle(pointer: Any) -> bytes:
    """The 64 bytes by which another process opens an allocation [CUD-1]."""
    return _bytes(call(api.cuIpcGetMemHandle, pointer), _HANDLE_BYTES)


def event_handle(event: Any) -> bytes:
    """The 64 bytes by which another process opens an event."""
    return _bytes(call(api.cuIpcGetEventHandle, event), _HANDLE_BYTES)


def interprocess_event() -> Any:
    """An event that other processes can open [CUD-3]."""
    flags = api.CUevent_flags
    return call(api.cuEventCreate, flags.CU_EVENT_INTERPROCESS | flags.CU_EVENT_DISABLE_TIMING)


def _bytes(structure: Any, count: int) -> bytes:
    """A structure's bytes, by its address: its members have other names in each version."""
    return ctypes.string_at(structure.getPtr(), count)
