"""Images on a GPU without any library: arrays with the CUDA array interface, slots read back."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from splatbus_server.cuda.driver import api, call
from splatbus_server.cuda.memory import DeviceMemory
from splatbus_wire.semantics import Semantics

BOTH = frozenset(("color", "depth"))
STRAIGHT = Semantics()


class OnDevice:
    """A copy of a NumPy array on the current device, for as long as it lives.

    With `room`, it lies between as many numbers that are not its own.
    """

    def __init__(self, array: np.ndarray, room: int = 0) -> None:
        self.array = np.ascontiguousarray(array)
        self._begin = call(api.cuMemAlloc, self.array.nbytes + 2 * room * array.itemsize)
        self.pointer = int(self._begin) + room * array.itemsize
        call(api.cuMemcpyHtoD, self.pointer, self.array.ctypes.data, self.array.nbytes)

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        return {
            "version": 3,
            "shape": self.array.shape,
            "typestr": self.array.dtype.str,
            "data": (self.pointer, False),
            "strides": None,
            "stream": 1,
        }

    def __del__(self) -> None:
        api.cuMemFree(self._begin)


def memory(
    size: tuple[int, int], device: Any, compiler: Any, semantics: Semantics = STRAIGHT
) -> DeviceMemory:
    return DeviceMemory(*size, 1, semantics, device, compiler)


def slot(of: DeviceMemory, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Colour and depth of a slot, the top row first; slot -1 is the legacy one."""
    call(api.cuCtxSynchronize)
    color = np.empty((of.height, of.width, 4), np.float32)
    depth = np.empty((of.height, of.width), np.float32)
    for array, pointer in zip((color, depth), of._places[number], strict=True):
        call(api.cuMemcpyDtoH, array.ctypes.data, pointer, array.nbytes)
    return color[::-1], depth[::-1]


def publish(
    of: DeviceMemory,
    color: np.ndarray,
    depth: np.ndarray | None = None,
    alpha: np.ndarray | None = None,
    kind: str = "linear",
    wants: frozenset[str] = BOTH,
    number: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """What a slot holds after these arrays were published into it."""
    given = [None if array is None else OnDevice(array) for array in (color, depth, alpha)]
    of.writer(*given, kind, None)(number, wants)
    return slot(of, number)


FORMATS = [
    {"channels": channels, "layout": layout, "color": color, "plane": plane, "kind": kind,
     "alpha": alpha, "meaning": meaning}
    for channels, layout, color, plane, kind, alpha, meaning in itertools.product(
        (3, 4), ("HWC", "CHW"), ("f4", "f2"), ("f4", "f2"),
        ("linear", "inverse", "accumulated"), (False, True), ("straight", "premultiplied"),
    )
]  # fmt: skip


def drawn(
    size: tuple[int, int], seed: int = 0, special: float = 0.1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """RGBA, depth of any magnitude and alpha (H, W, …) float32, some of the kinds that go wrong."""
    random = np.random.default_rng(seed)
    width, height = size
    color = random.uniform(-0.2, 1.2, (height, width, 4)).astype(np.float32)
    depth = (10.0 ** random.normal(0.0, 12.0, (height, width))).clip(0, 3e38).astype(np.float32)
    alpha = (10.0 ** random.uniform(-2.6, 0.0, (height, width))).astype(np.float32)
    odd = [np.nan, np.inf, -np.inf, 0.0, -0.0, -1.0, 1e-45, 3e38, 1e-38, 1.0 / 255.0, 6e4]
    for array in (color, depth, alpha):
        chosen = random.random(array.shape) < special
        array[chosen] = random.choice(odd, int(chosen.sum()))
    return color, depth, alpha


def arrays_of(format: dict[str, Any], size: tuple[int, int]) -> tuple[Any, Any, Any]:
    """An image in one of `FORMATS`: colour, depth, and alpha if it has one beside the colour."""
    color, depth, alpha = drawn(size)
    color = color[..., : format["channels"]]
    if format["layout"] == "CHW":
        color = color.transpose(2, 0, 1)
    with np.errstate(over="ignore"):
        return (
            np.ascontiguousarray(color, format["color"]),
            depth.astype(format["plane"]),
            alpha.astype(format["plane"]) if format["alpha"] else None,
        )
