"""An image on a GPU, for whichever library reads it there: DLPack, the CUDA array interface."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from typing import Any

_CUDA = 2  # kDLCUDA
_FLOAT32 = (2, 32, 1)  # kDLFloat, bits, lanes
LEGACY_STREAM = 1
"""The default stream of a process, as DLPack and the array interface number it."""


class DeviceArray:
    """Float32 numbers of a frame where they lie, bottom row first [BUF-1]; not to be written.

    `torch.from_dlpack(array)`, `cupy.from_dlpack(array)`, `jax.dlpack.from_dlpack(array)` read it
    without a copy, on the stream that is current there: it is made to wait for the image first, and
    is waited for before the frame is given back. What was made of it must not be used after that.

    Attributes:
        shape: (height, width, 4) or (height, width).
        pointer: address on the device.
    """

    def __init__(
        self,
        pointer: int,
        shape: tuple[int, ...],
        device: tuple[int, int],
        read_on: Callable[[int | None], int],
    ) -> None:
        """Args are the attributes, DLPack's device, and what is to be told who reads.

        `read_on` takes the stream that is going to read, None where that is not known, makes it
        wait for the image, and returns it, or one that the reader has to wait for.
        """
        self.pointer, self.shape = pointer, shape
        self._device, self._read_on = device, read_on

    def ready_on(self, stream: int) -> int:
        """Make a stream wait for the image, and return the pointer, for kernels of one's own.

        Args:
            stream: the driver's handle; what it has to do is waited for when the frame is released.

        Raises:
            CudaError: the driver refuses.
        """
        self._read_on(stream)
        return self.pointer

    def __dlpack_device__(self) -> tuple[int, int]:
        """Return DLPack's kind and number of the device."""
        return self._device

    def __dlpack__(self, *, stream: int | None = None, **_: Any) -> Any:
        """Return a capsule named "dltensor" for a reader on `stream`.

        Args:
            stream: as DLPack numbers streams; None is the default one, -1 asks for no waiting.
        """
        if self._device[0] == _CUDA:
            self._read_on(None if stream == -1 else stream or LEGACY_STREAM)
        return _capsule(self)

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        """Version 3: the reader waits for the stream that it names."""
        return {
            "version": 3,
            "shape": self.shape,
            "typestr": "<f4",
            "data": (self.pointer, True),
            "strides": None,
            "stream": self._read_on(None),
        }


class _Device(ctypes.Structure):
    _fields_ = (("type", ctypes.c_int32), ("id", ctypes.c_int32))


class _Type(ctypes.Structure):
    _fields_ = (("code", ctypes.c_uint8), ("bits", ctypes.c_uint8), ("lanes", ctypes.c_uint16))


class _Managed(ctypes.Structure):
    """DLManagedTensor of dlpack.h."""


_Deleter = ctypes.CFUNCTYPE(None, ctypes.POINTER(_Managed))
_Managed._fields_ = (
    ("data", ctypes.c_void_p),
    ("device", _Device),
    ("ndim", ctypes.c_int32),
    ("dtype", _Type),
    ("shape", ctypes.POINTER(ctypes.c_int64)),
    ("strides", ctypes.POINTER(ctypes.c_int64)),
    ("byte_offset", ctypes.c_uint64),
    ("context", ctypes.c_void_p),
    ("deleter", _Deleter),
)


def _python_api(name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    """A function of Python's own, typed for us alone: `ctypes.pythonapi` is everybody's."""
    return ctypes.PYFUNCTYPE(result, *arguments)((name, ctypes.pythonapi))


_new_capsule = _python_api(
    "PyCapsule_New", ctypes.py_object, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p
)
# Of a capsule that is being destroyed: no reference to it can be made any more.
_is_valid = _python_api("PyCapsule_IsValid", ctypes.c_int, ctypes.c_void_p, ctypes.c_char_p)
_pointer_of = _python_api("PyCapsule_GetPointer", ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)

_lent: dict[int, tuple[_Managed, Any, DeviceArray]] = {}
"""What somebody has of us, by address: kept until its deleter is called."""


def _return(managed: Any) -> None:
    _lent.pop(ctypes.addressof(managed.contents), None)


_take_back = _Deleter(_return)


def _drop(capsule: int) -> None:
    """Takes back what nobody took out of its capsule; a reader renames the capsule."""
    if _is_valid(capsule, b"dltensor"):
        _lent.pop(_pointer_of(capsule, b"dltensor"), None)


_drop_unused = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)(_drop)


def _capsule(array: DeviceArray) -> Any:
    axes = len(array.shape)
    steps = [math.prod(array.shape[axis + 1 :]) for axis in range(axes)]
    shape, strides = (ctypes.c_int64 * axes)(*array.shape), (ctypes.c_int64 * axes)(*steps)
    managed = _Managed(
        array.pointer,
        _Device(*array.__dlpack_device__()),
        axes,
        _Type(*_FLOAT32),
        shape,
        strides,
        0,
        None,
        _take_back,
    )
    address = ctypes.addressof(managed)
    _lent[address] = (managed, (shape, strides), array)
    return _new_capsule(address, b"dltensor", ctypes.cast(_drop_unused, ctypes.c_void_p))
