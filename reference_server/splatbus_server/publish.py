"""Puts what a renderer gives into a slot of host memory: bottom-up rows, colour in [0, 1], depth.

Sources have the top row of the image first; destinations are views of the slot, (height, width, 4)
for colour and (height, width) for depth, whose row j takes image row height − 1 − j [BUF-1]. Rows
go through NumPy in blocks that stay in the processor's cache. Where Numba is installed, `compiled`
takes large images instead, and stores the same to the last bit.
"""

from __future__ import annotations

import math
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from splatbus_server.source import COVERED_ALPHA, LARGEST, Numbers, Source

Image = NDArray[np.float32]
BLOCK_BYTES = 3 << 19
WORTH_COMPILING = 1 << 18
"""Pixels. Fewer take NumPy about a millisecond; to import Numba takes about a second."""


class Publisher:
    """Converts images of one size, with scratch of one block that it keeps."""

    def __init__(self, width: int, height: int, empty: float = math.inf) -> None:
        """Makes room. Where Numba is installed and the image large, this takes up to seconds.

        Args:
            width: pixels.
            height: pixels.
            empty: depth of empty pixels [BUF-7].
        """
        self.width = width
        self.height = height
        self._empty = np.float32(empty)
        self._block = min(height, max(1, BLOCK_BYTES // (16 * width)))
        self._pixels = np.empty((self._block, width, 4), np.float32)
        self._planes = np.empty((2, self._block, width), np.float32)
        self._masks = np.empty((2, self._block, width), np.bool_)
        self._compiled = _compiled() if width * height >= WORTH_COMPILING else None

    def write(self, image: Source, color: Image | None, depth: Image | None) -> None:
        """Stores an image, or what is wanted of it.

        Colour is clamped to [0, 1] [BUF-3]; a pixel with a NaN becomes (0, 0, 0, 0).

        Depth is planar z: d itself, A/d for accumulated inverse depth d = Σ (1/zᵢ) αᵢ Tᵢ, or d/A
        for accumulated depth d = Σ zᵢ αᵢ Tᵢ, with A = Σ αᵢ Tᵢ [ACC-8]. The quotient of the float32
        numbers is rounded once; what overflows becomes the largest float32. A pixel is covered if
        d is positive and finite, A finite and at least 1/255 [ACC-9], and the quotient does not
        vanish; others are empty [BUF-6, BUF-7].

        Args:
            image: of this size; rounded to float32 first where it is not.
            color: slot, (height, width, 4), or None.
            depth: slot, (height, width), or None.

        Raises:
            ValueError: the image has another size, or no depth where one is to be stored; a slot
                has another shape, is not contiguous, or not float32.
        """
        self._check(image, color, depth)
        flipped = image.rows(slice(None, None, -1))
        if self._compiled is not None and self._compiled.takes(flipped):
            self._compiled.write(flipped, color, depth, self._empty)
            return
        self._pixels[..., 3] = 1.0
        with np.errstate(all="ignore"):
            for start in range(0, self.height, self._block):
                rows = slice(start, start + self._block)
                block = flipped.rows(rows)
                if color is not None:
                    self._write_color(block.color, block.own_alpha, color[rows])
                if depth is not None:
                    self._write_depth(block, depth[rows])

    def _write_color(self, color: Numbers, own_alpha: Numbers | None, out: Image) -> None:
        if color.dtype == np.float32 and color.strides[1:] == (16, 4) and color.shape[2] == 4:
            pixels = color
        else:
            pixels = self._pixels[: len(color)]
            for channel in range(color.shape[2]):
                np.copyto(pixels[..., channel], color[..., channel], casting="unsafe")
            if own_alpha is not None:
                np.copyto(pixels[..., 3], own_alpha, casting="unsafe")
        pixels.clip(0.0, 1.0, out=out)
        if np.isnan(out.max()):
            self._blank_nan(out)

    def _blank_nan(self, out: Image) -> None:
        blank, also = self._masks[:, : len(out)]
        np.isnan(out[..., 0], out=blank)
        for channel in (1, 2, 3):
            blank |= np.isnan(out[..., channel], out=also)
        for channel in range(4):
            np.copyto(out[..., channel], 0.0, where=blank)

    def _write_depth(self, image: Source, out: Image) -> None:
        assert image.depth is not None
        depth = self._single(image.depth, self._planes[0])
        alpha = None if image.alpha is None else self._single(image.alpha, self._planes[1])
        if image.depth_kind == "inverse":
            depth = _quotient(np.float32(1.0) if alpha is None else alpha, depth, out)
        elif image.depth_kind == "accumulated" and alpha is not None:
            depth = _quotient(depth, alpha, out)
        covered, also = self._masks[:, : len(out)]
        np.greater(depth, 0.0, out=covered)
        covered &= np.less_equal(depth, LARGEST, out=also)
        if alpha is not None:
            covered &= np.greater_equal(alpha, COVERED_ALPHA, out=also)
            if image.depth_kind == "linear":  # elsewhere infinite alpha gives no such quotient
                covered &= np.less_equal(alpha, LARGEST, out=also)
        # A choice among bits costs the same wherever pixels are empty; a masked copy up to six
        # times as much where they alternate.
        bits, empty = out.view(np.int32), self._empty.view(np.int32)
        np.bitwise_xor(depth.view(np.int32), empty, out=bits)
        np.multiply(bits, covered, out=bits)
        np.bitwise_xor(bits, empty, out=bits)

    def _single(self, plane: Numbers, scratch: Image) -> Image:
        """As contiguous float32: alpha is often every fourth number of the colour."""
        if plane.dtype == np.float32 and plane.strides[1] == 4:
            return plane
        single = scratch[: len(plane)]
        np.copyto(single, plane, casting="unsafe")
        return single

    def _check(self, image: Source, color: Image | None, depth: Image | None) -> None:
        size = (self.height, self.width)
        if depth is not None and image.depth is None:
            raise ValueError("depth is to be stored, and the image has none")
        for plane in (image.color[..., 0], image.own_alpha, image.depth, image.alpha):
            if plane is not None and plane.shape != size:
                raise ValueError(f"an image of {plane.shape} is not of {size}")
        for slot, shape in ((color, (*size, 4)), (depth, size)):
            if slot is not None and not (
                slot.shape == shape and slot.dtype == np.float32 and slot.flags.c_contiguous
            ):
                found = f"{slot.dtype} of shape {slot.shape}"
                raise ValueError(f"a slot is {found}, not contiguous float32 of {shape}")


def _quotient(dividend: Image | np.float32, divisor: Image, out: Image) -> Image:
    """Rounded once; what overflows is the largest number, what is divided by 0 infinite [ACC-8]."""
    try:
        with np.errstate(over="raise"):
            return np.divide(dividend, divisor, out=out)
    except FloatingPointError:
        np.divide(dividend, divisor, out=out)
        overflows = (out > LARGEST) & (divisor > 0.0) & (dividend <= LARGEST)
        np.copyto(out, LARGEST, where=overflows)
        return out


def _compiled() -> ModuleType | None:
    try:
        from splatbus_server import compiled
    except ImportError:
        return None
    return compiled
