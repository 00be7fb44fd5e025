"""What a renderer gives, in host memory: arrays with the top row of the image first."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Numbers = NDArray[Any]
DepthKind = Literal["linear", "inverse", "accumulated"]

COVERED_ALPHA = np.float32(1.0 / 255.0)  # rounds up: no float32 lies between it and 1/255
LARGEST = np.finfo(np.float32).max
VISIBLE_ALPHA = 0.5


class Source(NamedTuple):
    """An image as a renderer gave it: real numbers of any type and with any strides.

    Attributes:
        color: (height, width, 3 or 4).
        own_alpha: (height, width); stored as the alpha of RGB, which is 1 if None [BUF-5].
        depth: (height, width), or None.
        alpha: (height, width); what says how far depth is covered, 1 if None.
        depth_kind: what the depth is.
    """

    color: Numbers
    own_alpha: Numbers | None
    depth: Numbers | None
    alpha: Numbers | None
    depth_kind: DepthKind

    def rows(self, wanted: slice) -> Source:
        """Views of some rows."""
        own_alpha, depth, alpha = (
            None if plane is None else plane[wanted]
            for plane in (self.own_alpha, self.depth, self.alpha)
        )
        return Source(self.color[wanted], own_alpha, depth, alpha, self.depth_kind)


def source(
    color: ArrayLike,
    depth: ArrayLike | None,
    alpha: ArrayLike | None,
    depth_kind: DepthKind,
    width: int,
    height: int,
    premultiplied: bool,
) -> Source:
    """Looks at what a renderer gives, as `Bus.publish` describes it; copies no arrays.

    Premultiplied colour has no background in it, so that the alpha beside RGB is its own.

    Raises:
        ValueError: an array has another shape or no real numbers; there is no such kind of depth.
    """
    if depth_kind not in get_args(DepthKind):
        raise ValueError(f"depth_kind {depth_kind!r} is none of {', '.join(get_args(DepthKind))}")
    pixels = _color(color, (height, width))
    depths = _plane("depth", depth, (height, width))
    alphas = _plane("alpha", alpha, (height, width))
    own_alpha = alphas if premultiplied and pixels.shape[2] == 3 else None
    if alphas is None and pixels.shape[2] == 4:
        alphas = pixels[..., 3]
    return Source(pixels, own_alpha, depths, alphas, depth_kind)


def _as_bytes(image: Source) -> str:
    if image.color.dtype.kind not in "iu" or image.color.max() <= 1:
        return ""
    return f"colour of {image.color.dtype} has values above 1, which is white: divide bytes by 255"


def _nowhere(image: Source) -> str:
    alpha, depth = image.alpha, image.depth
    clear = alpha is not None and not (alpha >= VISIBLE_ALPHA).any()
    if clear or depth is None or (np.isfinite(depth) & (depth > 0)).any():
        return ""
    return (
        "no pixel has a depth that is finite and above 0, so clients will show nothing: depth is "
        "positive in front of the camera"
    )


DOUBTS: dict[str, Callable[[Source], str]] = {"color": _as_bytes, "depth": _nowhere}
"""By what they look at: a sentence on what is likely a mistake; nothing where all is well."""


def _color(color: ArrayLike, size: tuple[int, int]) -> Numbers:
    pixels = _numbers("colour", color)
    if pixels.ndim == 3 and pixels.shape[:2] == size and pixels.shape[2] in (3, 4):
        return pixels
    if pixels.ndim == 3 and pixels.shape[1:] == size and pixels.shape[0] in (3, 4):
        return pixels.transpose(1, 2, 0)
    raise ValueError(
        f"colour of shape {pixels.shape} is neither ({size[0]}, {size[1]}, 3 or 4)"
        f" nor (3 or 4, {size[0]}, {size[1]})"
    )


def _plane(what: str, plane: ArrayLike | None, size: tuple[int, int]) -> Numbers | None:
    if plane is None:
        return None
    values = _numbers(what, plane)
    if values.shape not in (size, (*size, 1), (1, *size)):
        raise ValueError(f"{what} of shape {values.shape} is not {size}")
    return values.reshape(size)


def _numbers(what: str, values: ArrayLike) -> Numbers:
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{what} of {array.dtype} is not of real numbers")
    return array
