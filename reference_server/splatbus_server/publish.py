"""Puts what a renderer gives into a slot of host memory: bottom-up rows, colour in [0, 1], depth.

Sources are float32 arrays with the top row of the image first; destinations are views of the
slot, (height, width, 4) for colour and (height, width) for depth, whose row j takes image row
height − 1 − j [BUF-1]. Rows go through in blocks that stay in the processor's cache.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Image = NDArray[np.float32]
Layout = Literal["HWC", "CHW"]
DepthKind = Literal["linear", "inverse", "accumulated"]
Mask = NDArray[np.bool_]

COVERED_ALPHA = np.float32(1.0 / 255.0)  # rounds up: no float32 lies between it and 1/255
LARGEST = np.finfo(np.float32).max
BLOCK_BYTES = 1 << 20


class Source(NamedTuple):
    """An image as a renderer gave it, in float32.

    Attributes:
        color: its axes are in the order of `layout`.
        layout: of the colour.
        depth: (height, width), or None.
        alpha: (height, width), or None where the renderer gives none.
        depth_kind: what the depth is.
    """

    color: Image
    layout: Layout
    depth: Image | None
    alpha: Image | None
    depth_kind: DepthKind


def source(
    color: ArrayLike,
    depth: ArrayLike | None,
    alpha: ArrayLike | None,
    depth_kind: DepthKind,
    width: int,
    height: int,
    premultiplied: bool,
) -> Source:
    """Looks at what a renderer gives, as `Bus.publish` describes it.

    Premultiplied colour has no background in it, so that the alpha beside RGB is its own.

    Raises:
        ValueError: an array has another shape; there is no such kind of depth.
    """
    if depth_kind not in get_args(DepthKind):
        raise ValueError(f"depth_kind {depth_kind!r} is none of {', '.join(get_args(DepthKind))}")
    pixels, layout = _color(color, (height, width))
    depths = _plane("depth", depth, (height, width))
    alphas = _plane("alpha", alpha, (height, width))
    if alphas is None and pixels.shape[layout.index("C")] == 4:
        alphas = pixels[..., 3] if layout == "HWC" else pixels[3]
    elif alphas is not None and premultiplied and pixels.shape[layout.index("C")] == 3:
        fourth = alphas[..., None] if layout == "HWC" else alphas[None]
        pixels = np.concatenate((pixels, fourth), axis=layout.index("C"))
    return Source(pixels, layout, depths, alphas, depth_kind)


def _color(color: ArrayLike, size: tuple[int, int]) -> tuple[Image, Layout]:
    """The pixels, and in which order the axes are."""
    pixels = np.asarray(color, np.float32)
    if pixels.ndim == 3 and pixels.shape[:2] == size and pixels.shape[2] in (3, 4):
        return pixels, "HWC"
    if pixels.ndim == 3 and pixels.shape[1:] == size and pixels.shape[0] in (3, 4):
        return pixels, "CHW"
    raise ValueError(
        f"colour of shape {pixels.shape} is neither ({size[0]}, {size[1]}, 3 or 4)"
        f" nor (3 or 4, {size[0]}, {size[1]})"
    )


def _plane(what: str, plane: ArrayLike | None, size: tuple[int, int]) -> Image | None:
    if plane is None:
        return None
    values = np.asarray(plane, np.float32)
    if values.shape not in (size, (*size, 1), (1, *size)):
        raise ValueError(f"{what} of shape {values.shape} is not {size}")
    return values.reshape(size)


class Publisher:
    """Converts images of one size, with scratch of one block that it keeps."""

    def __init__(self, width: int, height: int) -> None:
        self.width = width
        self.height = height
        self._rows = max(1, BLOCK_BYTES // (16 * width))
        self._scratch = np.empty(self._rows * width * 4, np.float32)
        self._masks = np.empty((2, self._rows, width), np.bool_)

    def color(self, source: Image, slot: Image, layout: Layout = "HWC") -> None:
        """Stores colour clamped to [0, 1] [BUF-3]; a pixel with a NaN becomes (0, 0, 0, 0).

        Args:
            source: straight RGBA, or RGB, which gets alpha 1 [BUF-5]; (height, width, channels)
                or (channels, height, width) as the layout says.
            slot: (height, width, 4).
            layout: order of the source's axes.

        Raises:
            ValueError: an array has another shape or is not float32.
        """
        if layout == "CHW" and source.ndim == 3:
            source = source.transpose(1, 2, 0)
        channels = source.shape[-1] if source.ndim == 3 and source.shape[-1] == 3 else 4
        self._check("colour", source, (channels,))
        self._check("colour slot", slot, (4,))
        in_place = channels == 4 and layout == "HWC"
        flipped = source[::-1]
        for rows in self._blocks():
            block, out = flipped[rows], slot[rows]
            clamped = out if in_place else self._like(block, layout)
            np.clip(block, 0.0, 1.0, out=clamped)
            if not in_place:
                for channel in range(channels):
                    out[..., channel] = clamped[..., channel]
                if channels == 3:
                    out[..., 3] = 1.0
            if np.isnan(clamped.max()):
                self._blank_nan(clamped, out)

    def depth(self, source: Image, slot: Image, alpha: Image | None = None) -> None:
        """Stores planar depth z; +inf where the pixel is empty [BUF-6, BUF-7].

        A pixel is covered if z is positive and finite and its alpha, where given, is finite and
        at least 1/255 [ACC-9].

        Args:
            source: (height, width), planar z.
            slot: (height, width).
            alpha: (height, width), accumulated alpha.

        Raises:
            ValueError: an array has another shape or is not float32.
        """
        self._check_depth(source, slot, alpha)
        for rows in self._blocks():
            out = slot[rows]
            np.copyto(out, source[::-1][rows])
            self._blank_empty(out, self._weight(alpha, rows))

    def inverse_depth(self, source: Image, slot: Image, alpha: Image | None = None) -> None:
        """Stores A/d for accumulated inverse depth d and alpha A; +inf where empty [ACC-8, ACC-9].

        One float32 division of float32 numbers: correctly rounded. What overflows is stored as
        the largest finite float32.

        Args:
            source: (height, width), d = Σ (1/zᵢ) αᵢ Tᵢ.
            slot: (height, width).
            alpha: (height, width), A = Σ αᵢ Tᵢ; 1 where the renderer gives none.

        Raises:
            ValueError: an array has another shape or is not float32.
        """
        self._check_depth(source, slot, alpha)
        with np.errstate(all="ignore"):
            for rows in self._blocks():
                out, block = slot[rows], source[::-1][rows]
                weight = self._weight(alpha, rows)
                np.divide(1.0 if weight is None else weight, block, out=out)
                self._limit(out, block)
                self._blank_empty(out, weight)

    def accumulated_depth(self, source: Image, slot: Image, alpha: Image | None = None) -> None:
        """Stores D/A for accumulated depth D and alpha A; +inf where empty [ACC-9].

        Rounded once, and limited, as in `inverse_depth`; errors as there.

        Args:
            source: (height, width), D = Σ zᵢ αᵢ Tᵢ.
            slot: (height, width).
            alpha: (height, width), A = Σ αᵢ Tᵢ; 1 where the renderer gives none.
        """
        self._check_depth(source, slot, alpha)
        with np.errstate(all="ignore"):
            for rows in self._blocks():
                out, block = slot[rows], source[::-1][rows]
                weight = self._weight(alpha, rows)
                np.divide(block, 1.0 if weight is None else weight, out=out)
                self._limit(out, block)
                self._blank_empty(out, weight)

    def _limit(self, out: Image, block: Image) -> None:
        """Stores the largest finite number where a quotient overflowed that is a depth [ACC-8]."""
        infinite = np.greater(out, LARGEST, out=self._masks[0, : len(out)])
        if infinite.any():
            infinite &= (block > 0.0) & (block <= LARGEST)
            np.copyto(out, LARGEST, where=infinite)

    def _weight(self, alpha: Image | None, rows: slice) -> Image | None:
        """A contiguous copy of these rows: alpha is often every fourth number of the colour."""
        if alpha is None:
            return None
        block = alpha[::-1][rows]
        weight = self._scratch[: block.size].reshape(block.shape)
        np.copyto(weight, block)
        return weight

    def _blank_empty(self, out: Image, alpha: Image | None) -> None:
        """Stores +inf where a depth is not positive, or its alpha too small or not finite."""
        covered, also = self._masks[:, : len(out)]
        np.greater(out, 0.0, out=covered)
        if alpha is not None:
            covered &= np.greater_equal(alpha, COVERED_ALPHA, out=also)
            covered &= np.less_equal(alpha, LARGEST, out=also)
        np.copyto(out, np.float32(np.inf), where=np.logical_not(covered, out=covered))

    def _blank_nan(self, clamped: Image, out: Image) -> None:
        blank, also = self._masks[:, : len(out)]
        blank.fill(False)
        for channel in range(clamped.shape[-1]):
            blank |= np.isnan(clamped[..., channel], out=also)
        out[blank] = 0.0

    def _blocks(self) -> Iterator[slice]:
        for start in range(0, self.height, self._rows):
            yield slice(start, min(start + self._rows, self.height))

    def _like(self, block: Image, layout: Layout) -> Image:
        """Scratch of the block's shape whose axes lie in memory as the layout's do."""
        scratch = self._scratch[: block.size]
        if layout == "HWC":
            return scratch.reshape(block.shape)
        rows, width, channels = block.shape
        return scratch.reshape(channels, rows, width).transpose(1, 2, 0)

    def _check_depth(self, source: Image, slot: Image, alpha: Image | None) -> None:
        self._check("depth", source)
        self._check("depth slot", slot)
        if alpha is not None:
            self._check("alpha", alpha)

    def _check(self, what: str, array: Image, channels: tuple[int, ...] = ()) -> None:
        expected = (self.height, self.width, *channels)
        if array.dtype != np.float32 or array.shape != expected:
            raise ValueError(
                f"{what} is {array.dtype} of shape {array.shape}, not float32 of {expected}"
            )
