"""What a renderer gives, as the kernels read it: pointers, strides, and which kernels those are."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Literal, NamedTuple

from splatbus_server.cuda.arrays import DeviceArray, Form, device_array
from splatbus_server.cuda.kernels import Format

DepthKind = Literal["linear", "inverse", "accumulated"]
_RULES = {"linear": 1, "inverse": 2, "accumulated": 3}


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
    pixels = device_array("colour", color, stream)
    stream = pixels.stream if stream is None else stream
    depths = None if depth is None else device_array("depth", depth, stream)
    alphas = None if alpha is None else device_array("alpha", alpha, stream)
    layout = _layout(
        pixels.form,
        depths and depths.form,
        alphas and alphas.form,
        depth_kind,
        width,
        height,
        premultiplied,
        pixels.pointer % (pixels.form.bits // 2) == 0,
    )
    planes: tuple[int, ...] = (pixels.pointer, *layout.color)
    owners = [] if pixels.owner is None else [pixels.owner]
    for what, array, strides in (
        ("depth", depths, layout.depth),
        ("alpha", alphas, layout.alpha),
    ):
        planes += (0 if array is None else array.pointer, *strides)
        if array is not None:
            if array.owner is not None:
                owners.append(array.owner)
            _check_device(what, array, device)
    _check_device("colour", pixels, device)
    return Source(layout.format, planes, stream, owners)


class _Layout(NamedTuple):
    """Strides in numbers: of colour row, column, channel; of depth and alpha row, column."""

    format: Format
    color: tuple[int, int, int]
    depth: tuple[int, int]
    alpha: tuple[int, int]


@lru_cache(maxsize=64)
def _layout(
    color: Form,
    depth: Form | None,
    alpha: Form | None,
    depth_kind: DepthKind,
    width: int,
    height: int,
    premultiplied: bool,
    is_aligned: bool,
) -> _Layout:
    """What follows from how the arrays lie, whatever their addresses are."""
    if depth_kind not in _RULES:
        raise ValueError(f"depth_kind {depth_kind!r} is none of {', '.join(_RULES)}")
    channels, row, column, channel = _color_strides(color, width, height)
    found = Format(
        channels=channels,
        color_half=color.bits == 16,
        packed=is_aligned and (channels, channel, row % 4, column % 4) == (4, 1, 0, 0),
        depth=0 if depth is None else _RULES[depth_kind],
        depth_half=depth is not None and depth.bits == 16,
        alpha=alpha is not None,
        alpha_half=alpha is not None and alpha.bits == 16,
        premultiplied=premultiplied,
    )
    return _Layout(
        found,
        (row, column, channel),
        _plane_strides("depth", depth, width, height),
        _plane_strides("alpha", alpha, width, height),
    )


def _color_strides(color: Form, width: int, height: int) -> tuple[int, int, int, int]:
    """How many channels there are, and the strides of row, column and channel."""
    shape, strides = tuple(color.shape), color.strides
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
    shape, strides = tuple(plane.shape), plane.strides
    if shape in ((height, width), (height, width, 1)):
        return strides[0], strides[1]
    if shape == (1, height, width):
        return strides[1], strides[2]
    raise ValueError(f"{what} of shape {shape} is not ({height}, {width})")


def _check_device(what: str, array: DeviceArray, device: int) -> None:
    if array.device not in (device, -1):
        raise ValueError(f"{what} is on device {array.device}, the server's memory on {device}")
