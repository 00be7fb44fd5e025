"""DLPack's structure, read: what any library that shares arrays on a GPU hands out.

The layout is that of dlpack.h: a capsule named "dltensor" holds a managed tensor, which begins with
the tensor itself, and whose memory lasts as long as the capsule.
"""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

CUDA_DEVICES = (2, 13)  # kDLCUDA, kDLCUDAManaged
_FLOAT = 2  # kDLFloat


class _Device(ctypes.Structure):
    _fields_ = (("type", ctypes.c_int32), ("id", ctypes.c_int32))


class _Type(ctypes.Structure):
    _fields_ = (("code", ctypes.c_uint8), ("bits", ctypes.c_uint8), ("lanes", ctypes.c_uint16))


class _Tensor(ctypes.Structure):
    _fields_ = (
        ("data", ctypes.c_void_p),
        ("device", _Device),
        ("ndim", ctypes.c_int32),
        ("dtype", _Type),
        ("shape", ctypes.POINTER(ctypes.c_int64)),
        ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("byte_offset", ctypes.c_uint64),
    )


class Shared(NamedTuple):
    """An array that another library shares; shape and strides in numbers, not bytes.

    `bits` of a number, 0 if it is no plain float; `owner` keeps the memory alive.
    """

    pointer: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    bits: int
    device: tuple[int, int]
    owner: Any


# A prototype of its own: that of `ctypes.pythonapi` is everybody's.
_pointer_of = ctypes.PYFUNCTYPE(ctypes.POINTER(_Tensor), ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", ctypes.pythonapi)
)


def shared(capsule: Any) -> Shared:
    """What a capsule of `__dlpack__` holds.

    Raises:
        ValueError: it is no capsule named "dltensor".
    """
    tensor = _pointer_of(capsule, b"dltensor").contents
    shape = tuple(tensor.shape[: tensor.ndim])
    strides = tuple(tensor.strides[: tensor.ndim]) if tensor.strides else contiguous(shape)
    kind = tensor.dtype
    return Shared(
        (tensor.data or 0) + tensor.byte_offset,
        shape,
        strides,
        kind.bits if (kind.code, kind.lanes) == (_FLOAT, 1) else 0,
        (tensor.device.type, tensor.device.id),
        capsule,
    )


def contiguous(shape: tuple[int, ...]) -> tuple[int, ...]:
    """The strides, in numbers, of an array in C order."""
    strides = []
    step = 1
    for length in reversed(shape):
        strides.append(step)
        step *= length
    return tuple(reversed(strides))
