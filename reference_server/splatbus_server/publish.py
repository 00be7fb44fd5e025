"""Puts what a renderer gives into a slot of host memory: bottom-up rows, colour in [0, 1], depth.

Sources are float32 arrays with the top row of the image first; destinations are views of the
slot, (height, width, 4) for colour and (height, width) for depth, whose row j takes image row
height − 1 − j [BUF-1]. Rows go through in blocks that stay in the processor's cache.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]

COVERED_ALPHA = np.float32(1.0 / 255.0)  # rounds up: no float32 lies between it and 1/255
LARGEST = np.finfo(np.float32).max
BLOCK_BYTES = 1 << 20


class Publisher:
    """Converts images of one size, with scratch of one block that it keeps."""

    def __init__(self, width: int, height: int) -> None:
        self.width = width
        self.height = height
        self._rows = max(1, BLOCK_BYTES // (16 * width))
        self._scratch = np.empty(self._rows * width * 4, np.float32)
        self._masks = np.empty((2, self._rows, width), np.bool_)

    def color(self, source: Image, slot: Image, layout: Literal["HWC", "CHW"] = "HWC") -> None:
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
                infinite = np.greater(out, LARGEST, out=self._masks[0, : len(out)])
                if infinite.any():
                    infinite &= block > 0.0
                    np.copyto(out, LARGEST, where=infinite)
                self._blank_empty(out, weight)

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

    def _like(self, block: Image, layout: Literal["HWC", "CHW"]) -> Image:
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
