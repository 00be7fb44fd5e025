"""A rendered image over a client's own geometry [ACC-10, BUF-8, BUF-9].

Single precision is enough: of the four roundings of a·C + (1 − a)·B, with everything in 0…1, the
sum's costs ½ ULP and the other three together less than 1½.
"""

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]


def over_straight(
    splats: Float32Array,
    depth: Float32Array,
    background: Float32Array,
    background_depth: Float32Array,
) -> Float32Array:
    """Return a·C + (1 − a)·B where the splats are in front, B elsewhere, within 2 ULP.

    Args:
        splats: (…, 4) float32, red, green, blue not multiplied by alpha [BUF-4], and alpha.
        depth: (…) float32, planar depth of the splats in scene units. An empty pixel has
            depth +∞ or alpha 0; NaN and depths that are not positive are no surface.
        background: (…, 3) float32, colour of the client's own geometry.
        background_depth: (…) float32, its planar depth, +∞ where there is none.

    Returns:
        (…, 3) float32 colours.
    """
    alpha = splats[..., 3:]
    with np.errstate(invalid="ignore"):  # what an empty pixel holds may be infinite
        premultiplied = alpha * splats[..., :3]
    return _over(premultiplied, alpha, depth, background, background_depth)


def over_premultiplied(
    splats: Float32Array,
    depth: Float32Array,
    background: Float32Array,
    background_depth: Float32Array,
) -> Float32Array:
    """Return C + (1 − a)·B where the splats are in front, B elsewhere, within 2 ULP.

    As `over_straight`, but red, green and blue of `splats` are multiplied by alpha already.
    """
    return _over(splats[..., :3], splats[..., 3:], depth, background, background_depth)


def _over(
    premultiplied: Float32Array,
    alpha: Float32Array,
    depth: Float32Array,
    background: Float32Array,
    background_depth: Float32Array,
) -> Float32Array:
    in_front = (depth > 0) & (depth < background_depth) & (alpha[..., 0] > 0)
    with np.errstate(invalid="ignore"):
        blended = premultiplied + (np.float32(1) - alpha) * background
    return np.where(in_front[..., np.newaxis], blended, background)
