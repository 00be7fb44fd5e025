"""A rendered image over a client's own geometry [ACC-10, BUF-8, BUF-9].

In single precision the four roundings of a·C + (1 − a)·B may come to 2½ ULP, and a search finds
2.48. So each colour is computed in double precision and rounded once; a channel at a time, of as
many pixels as stay in the cache, which takes less time than whole images in single precision.
"""

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]

_BLOCK_PIXELS = 1 << 15


def over_straight(
    splats: Float32Array,
    depth: Float32Array,
    background: Float32Array,
    background_depth: Float32Array,
) -> Float32Array:
    """Return a·C + (1 − a)·B where the splats are in front, B elsewhere, correct to ½ ULP.

    Args:
        splats: (…, 4) float32, red, green, blue not multiplied by alpha [BUF-4], and alpha.
        depth: (…) float32, planar depth of the splats in scene units. An empty pixel has
            depth +∞ or alpha 0; NaN and depths that are not positive are no surface.
        background: (…, 3) float32, colour of the client's own geometry.
        background_depth: (…) float32, its planar depth, +∞ where there is none.

    Returns:
        (…, 3) float32 colours.
    """
    return _over(splats, depth, background, background_depth, straight=True)


def over_premultiplied(
    splats: Float32Array,
    depth: Float32Array,
    background: Float32Array,
    background_depth: Float32Array,
) -> Float32Array:
    """Return C + (1 − a)·B where the splats are in front, B elsewhere, correct to ½ ULP.

    As `over_straight`, but red, green and blue of `splats` are multiplied by alpha already.
    """
    return _over(splats, depth, background, background_depth, straight=False)


def _over(
    splats: Float32Array,
    depth: Float32Array,
    background: Float32Array,
    background_depth: Float32Array,
    *,
    straight: bool,
) -> Float32Array:
    colour, under = splats.reshape(-1, 4), background.reshape(-1, 3)
    z, far = depth.reshape(-1), background_depth.reshape(-1)
    out = np.empty(under.shape, np.float32)
    for start in range(0, len(z), _BLOCK_PIXELS):
        some = slice(start, start + _BLOCK_PIXELS)
        alpha = colour[some, 3].astype(np.float64)
        rest = 1.0 - alpha
        in_front = (z[some] > 0) & (z[some] < far[some]) & (alpha > 0)
        for channel in range(3):
            C, B = colour[some, channel], under[some, channel]
            with np.errstate(invalid="ignore"):  # what an empty pixel holds may be infinite
                blended = (alpha * C if straight else C) + rest * B
                out[some, channel] = np.where(in_front, blended, B)
    return out.reshape(background.shape)
