"""DLPack as other libraries write it, here NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from splatbus_server.cuda.dlpack import contiguous, shared

HOST = (1, 0)


@pytest.mark.parametrize(
    ("array", "strides", "bits"),
    [
        (np.zeros((2, 3, 4), np.float32), (12, 4, 1), 32),
        (np.zeros((4, 6), np.float16)[1:, ::2], (6, 2), 16),
        (np.zeros(3, np.int32), (1,), 0),
        (np.zeros(3, np.complex64), (1,), 0),
    ],
)
def test_a_capsule_is_read(array: Any, strides: tuple[int, ...], bits: int) -> None:
    """Strides are in numbers, a part begins where it does, and what is no float has no bits."""
    found = shared(array.__dlpack__())
    assert found[:5] == (array.ctypes.data, array.shape, strides, bits, HOST)


def test_a_capsule_is_read_once() -> None:
    capsule = np.zeros(3, np.float32).__dlpack__()
    methods = {"__dlpack__": lambda *_, **__: capsule, "__dlpack_device__": lambda _: HOST}
    np.from_dlpack(type("Taken", (), methods)())
    with pytest.raises(ValueError, match="PyCapsule"):
        shared(capsule)


def test_the_strides_of_an_array_in_c_order() -> None:
    assert contiguous((5, 4, 3)) == (12, 3, 1)
    assert contiguous(()) == ()
