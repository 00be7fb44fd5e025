"""What a renderer gives, as the kernels read it: pointers, strides, and which kernels those are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from splatbus_server.cuda.arrays import Form, bits_of, device_array
from splatbus_server.cuda.kernels import Format
from splatbus_server.source import DepthKind

_RULES = {"linear": 1, "inverse": 2, "accumulated": 3}
_VECTOR_BYTES = 16
_NOTHING = 0, None, 0, None


@dataclass(frozen=True, eq=False)
class Layout:
    """What follows from how the arrays lie, whatever their addresses are; there is one of each.

    Attributes:
        format: of the numbers.
        color: strides in numbers of row, column and channel.
        depth: strides in numbers of row and column.
        alpha: the same.
    """

    format: Format
    color: tuple[int, int, int]
    depth: tuple[int, int]
    alpha: tuple[int, int]


Source = tuple[Layout, tuple[int, int, int], int, list[Any]]
"""An image on a GPU, top row first: how its arrays lie; pointers to colour, depth and alpha, 0 for
what there is not; the stream to work on; what keeps the memory alive until the kernel has read it.
"""


def source(
    color: Any,
    depth: Any,
    alpha: Any,
    depth_kind: DepthKind,
    stream: int | None,
    *,
    width: int,
    height: int,
    premultiplied: bool,
    device: int,
) -> Source:
    """Looks at the arrays; reads none of their numbers.

    Args:
        color: (height, width, 3 or 4) or (3 or 4, height, width), float32 or float16.
        depth: (height, width), or with one axis of length 1 more; None where there is none.
        alpha: the same.
        depth_kind: which rule depth follows.
        stream: to work on; the colour's own if None.
        width: in pixels.
        height: in pixels.
        premultiplied: whether the colour is multiplied by alpha.
        device: on which the server's memory is.

    Raises:
        ValueError: an array has another shape, other numbers, or is elsewhere; no such kind.
    """
    at, form, own_stream, owner = device_array("colour", color, stream)
    if stream is None:
        stream = own_stream
    depth_at, depth_form, _, depth_owner = _NOTHING
    if depth is not None:
        depth_at, depth_form, _, depth_owner = device_array("depth", depth, stream)
    alpha_at, alpha_form, _, alpha_owner = _NOTHING
    if alpha is not None:
        alpha_at, alpha_form, _, alpha_owner = device_array("alpha", alpha, stream)
    layout = _layout(
        form,
        depth_form,
        alpha_form,
        depth_kind,
        width,
        height,
        premultiplied,
        at % _VECTOR_BYTES,
        device,
    )
    owners = [it for it in (owner, depth_owner, alpha_owner) if it is not None]
    return layout, (at, depth_at, alpha_at), stream, owners


@lru_cache(maxsize=64)
def _layout(
    color: Form,
    depth: Form | None,
    alpha: Form | None,
    depth_kind: DepthKind,
    width: int,
    height: int,
    premultiplied: bool,
    misaligned: int,
    device: int,
) -> Layout:
    if depth_kind not in _RULES:
        raise ValueError(f"depth_kind {depth_kind!r} is none of {', '.join(_RULES)}")
    bits = _bits("colour", color, device)
    depth_bits, alpha_bits = _bits("depth", depth, device), _bits("alpha", alpha, device)
    channels, row, column, channel = _color_strides(color, width, height)
    is_aligned = misaligned % (bits // 2) == 0
    found = Format(
        channels=channels,
        color_half=bits == 16,
        packed=is_aligned and (channels, channel, row % 4, column % 4) == (4, 1, 0, 0),
        depth=0 if depth is None else _RULES[depth_kind],
        depth_half=depth_bits == 16,
        alpha=alpha is not None,
        alpha_half=alpha_bits == 16,
        premultiplied=premultiplied,
    )
    return Layout(
        found,
        (row, column, channel),
        _plane_strides("depth", depth, width, height),
        _plane_strides("alpha", alpha, width, height),
    )


def _bits(what: str, form: Form | None, device: int) -> int:
    """Of a number, where it is one that the kernels read and on their device."""
    if form is None:
        return 0
    _, _, numbers, own_device = form
    if own_device not in (device, -1):
        raise ValueError(f"{what} is on device {own_device}, the server's memory on {device}")
    bits = bits_of(numbers)
    if not bits:
        raise ValueError(f"{what} is not of float32 or float16 numbers: convert it on the GPU")
    return bits


def _color_strides(color: Form, width: int, height: int) -> tuple[int, int, int, int]:
    """How many channels there are, and the strides of row, column and channel."""
    shape, strides = tuple(color[0]), color[1]
    if len(shape) == 3:
        if shape[:2] == (height, width) and shape[2] in (3, 4):
            return shape[2], strides[0], strides[1], strides[2]
        if shape[1:] == (height, width) and shape[0] in (3, 4):
            return shape[0], strides[1], strides[2], strides[0]
    raise ValueError(
        f"colour of shape {shape} is neither ({height}, {width}, 3 or 4)"
        f" nor (3 or 4, {height}, {width})"
    )


def _plane_strides(what: str, plane: Form | None, width: int, height: int) -> tuple[int, int]:
    if plane is None:
        return 0, 0
    shape, strides = tuple(plane[0]), plane[1]
    if shape in ((height, width), (height, width, 1)):
        return strides[0], strides[1]
    if shape == (1, height, width):
        return strides[1], strides[2]
    raise ValueError(f"{what} of shape {shape} is not ({height}, {width})")
