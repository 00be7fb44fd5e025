"""DLPack as other libraries write it, here NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from splatbus_server.cuda.dlpack import contiguous, shared

HOST = (1, 0)


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_a_capsule_is_read(dtype: type) -> None:
    array = np.zeros((2, 3, 4), dtype)
    found = shared(array.__dlpack__())
    assert found.pointer == array.ctypes.data
    assert (found.shape, found.strides) == ((2, 3, 4), (12, 4, 1))
    assert found.bits == array.itemsize * 8
    assert found.device == HOST


def test_strides_are_in_numbers_and_a_part_begins_where_it_does() -> None:
    array = np.zeros((4, 6), np.float32)[1:, ::2]
    found = shared(array.__dlpack__())
    assert found.pointer == array.ctypes.data
    assert found.strides == (6, 2)


@pytest.mark.parametrize("dtype", [np.int32, np.uint8, np.complex64])
def test_what_is_no_float_has_no_bits(dtype: type) -> None:
    assert shared(np.zeros(3, dtype).__dlpack__()).bits == 0


def test_a_capsule_is_read_once() -> None:
    capsule = np.zeros(3, np.float32).__dlpack__()
    np.from_dlpack(_Taken(capsule))
    with pytest.raises(ValueError, match="PyCapsule"):
        shared(capsule)


def test_the_strides_of_an_array_in_c_order() -> None:
    assert contiguous((5, 4, 3)) == (12, 3, 1)
    assert contiguous(()) == ()


class _Taken:
    def __init__(self, capsule: object) -> None:
        self._capsule = capsule

    def __dlpack__(self, **_: object) -> object:
        return self._capsule

    def __dlpack_device__(self) -> tuple[int, int]:
        return HOST
