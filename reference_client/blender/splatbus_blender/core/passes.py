"""The passes of a render that a server's image becomes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from splatbus_viewer.display import planar_depth
from splatbus_viewer.mirror import Copied

Float32Array = NDArray[np.float32]


def passes(image: Copied, unit: float = 1.0) -> tuple[Float32Array, Float32Array]:
    """Return colour and depth as a compositor mixes them, rows top-down.

    The colour stays in the image's own space, and is multiplied by its alpha once: mixed with
    C + (1 − a)·B it is within 3 ULP of what the wire asks for, whichever alpha it has [ACC-10].

    Args:
        image: with colour and depth.
        unit: Blender's units to one of the splats' scene.

    Returns:
        (H, W, 4) float32, nothing where there is no surface, whatever such a pixel holds [BUF-8];
        (H, W) float32, planar depth in Blender's units, +∞ where there is no surface.
    """
    assert image.color is not None
    assert image.depth is not None
    z = planar_depth(image.color, image.depth, image.camera, image.semantics)
    color = np.where(np.isfinite(z)[..., None], image.color, np.float32(0))
    if image.semantics.alpha == "straight":
        color[..., :3] *= color[..., 3:]
    return color, z * np.float32(unit)


def fitted(image: Float32Array, width: int, height: int) -> Float32Array:
    """Return an image stretched to another size: of each pixel's place, the nearest pixel."""
    rows = (np.arange(height) * 2 + 1) * image.shape[0] // (2 * height)
    columns = (np.arange(width) * 2 + 1) * image.shape[1] // (2 * width)
    fits: Float32Array = image[rows[:, None], columns]
    return fits


def bottom_up(image: Float32Array) -> Float32Array:
    """Return the numbers of an image as Blender lays them out: flat, its bottom row first."""
    return np.ascontiguousarray(image[::-1]).reshape(-1)
