"""What a renderer gives, as the kernels read it: pointers, strides, and which kernels those are."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

from splatbus_server.cuda.arrays import DeviceArray, device_array
from splatbus_server.cuda.kernels import Format

DepthKind = Literal["linear", "inverse", "accumulated"]
_RULES = {"linear": 1, "inverse": 2, "accumulated": 3}
_NO_PLANE = (0, 0, 0)


class Source(NamedTuple):
    """An image on a GPU, top row first.

    Attributes:
        format: of its numbers.
        planes: as the kernels take them: of colour, pointer and strides of row, column and channel;
            of depth and of alpha, pointer and strides of row and column.
        stream: to work on.
        owners: what keeps the memory alive until the kernel has read it.
    """

    format: Format
    planes: tuple[int, ...]
    stream: int
    owners: list[Any]


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
    if depth_kind not in _RULES:
        raise ValueError(f"depth_kind {depth_kind!r} is none of {', '.join(_RULES)}")
    pixels = device_array("colour", color, stream)
    stream = pixels.stream if stream is None else stream
    depths = None if depth is None else device_array("depth", depth, stream)
    alphas = None if alpha is None else device_array("alpha", alpha, stream)
    for what, array in ("colour", pixels), ("depth", depths), ("alpha", alphas):
        if array is not None and array.device not in (device, -1):
            raise ValueError(f"{what} is on device {array.device}, the server's on {device}")
    channels, row, column, channel = _color_strides(pixels, width, height)
    number = pixels.bits // 8
    packed = (
        (channels, channel) == (4, 1)
        and pixels.pointer % (4 * number) == 0
        and column % 4 == row % 4 == 0
    )
    return Source(
        Format(
            channels,
            pixels.bits == 16,
            packed,
            0 if depths is None else _RULES[depth_kind],
            depths is not None and depths.bits == 16,
            alphas is not None,
            alphas is not None and alphas.bits == 16,
            premultiplied,
        ),
        (
            *(pixels.pointer, row, column, channel),
            *_plane("depth", depths, width, height),
            *_plane("alpha", alphas, width, height),
        ),
        stream,
        [a.owner for a in (pixels, depths, alphas) if a is not None and a.owner is not None],
    )


def _color_strides(color: DeviceArray, width: int, height: int) -> tuple[int, int, int, int]:
    """How many channels there are, and the strides of row, column and channel."""
    shape, strides = color.shape, color.strides
    if len(shape) == 3:
        if shape[:2] == (height, width) and shape[2] in (3, 4):
            return shape[2], strides[0], strides[1], strides[2]
        if shape[1:] == (height, width) and shape[0] in (3, 4):
            return shape[0], strides[1], strides[2], strides[0]
    raise ValueError(
        f"colour of shape {shape} is neither ({height}, {width}, 3 or 4)"
        f" nor (3 or 4, {height}, {width})"
    )


def _plane(what: str, plane: DeviceArray | None, width: int, height: int) -> tuple[int, int, int]:
    """Its pointer, and the strides of row and column."""
    if plane is None:
        return _NO_PLANE
    shape, strides = plane.shape, plane.strides
    if shape in ((height, width), (height, width, 1)):
        return plane.pointer, strides[0], strides[1]
    if shape == (1, height, width):
        return plane.pointer, strides[1], strides[2]
    raise ValueError(f"{what} of shape {shape} is not ({height}, {width})")
