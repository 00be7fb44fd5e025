"""Memory that other processes share, opened once in this process however many read it [CUD-2]."""

import threading
from typing import NamedTuple

from splatbus_client.cuda.driver import Device, api, call, filled

_LAZY_PEER_ACCESS = 1


class Allocation(NamedTuple):
    """Somebody's allocation, mapped here; size in bytes."""

    pointer: int
    size: int


class _Opened:
    def __init__(self, allocation: Allocation) -> None:
        self.allocation = allocation
        self.users = 0


_lock = threading.Lock()
_opened: dict[tuple[int, bytes], _Opened] = {}


def open_memory(device: Device, handle: bytes) -> Allocation:
    """Map the allocation that a handle stands for; `close_memory` once for each call.

    The device's context has to be current.

    Raises:
        CudaError: the handle is of this very process, of one that has ended, or of no use here.
    """
    with _lock:
        key = device.ordinal, handle
        if key not in _opened:
            memory = filled(api.CUipcMemHandle(), handle)
            pointer = int(call(api.cuIpcOpenMemHandle, memory, _LAZY_PEER_ACCESS))
            size = int(call(api.cuMemGetAddressRange, pointer)[1])
            _opened[key] = _Opened(Allocation(pointer, size))
        _opened[key].users += 1
        return _opened[key].allocation


def close_memory(device: Device, handle: bytes) -> None:
    """Unmap it with its last user, whose reads have finished [CUD-5]."""
    with _lock:
        key = device.ordinal, handle
        _opened[key].users -= 1
        if not _opened[key].users:
            call(api.cuIpcCloseMemHandle, _opened.pop(key).allocation.pointer)
