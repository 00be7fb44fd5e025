"""A frame as a screen wants it, whatever its semantics [MEM-13]."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.compositing import over_premultiplied, over_straight
from splatbus_wire.messages import FrameCamera
from splatbus_wire.semantics import Semantics

Float32Array = NDArray[np.float32]
# Nine points of Matplotlib's viridis (CC0), near to far: yellow to violet.
RAMP = (
    *((253, 231, 37), (173, 220, 48), (94, 201, 98), (40, 174, 128), (33, 145, 140)),
    *((44, 114, 142), (59, 82, 139), (72, 40, 120), (68, 1, 84)),
)
"""Of false colours, of 255."""


class Shown(NamedTuple):
    """An image in one convention; rows top-down.

    Attributes:
        color: (H, W, 4) float32, straight alpha, sRGB-encoded, in [0, 1].
        depth: (H, W) float32, planar depth in scene units, +∞ where nothing is.
        camera: what it was rendered with.
    """

    color: Float32Array
    depth: Float32Array
    camera: FrameCamera


def shown(
    color: Float32Array, depth: Float32Array, camera: FrameCamera, semantics: Semantics
) -> Shown:
    """Return a copy of a frame with straight alpha, sRGB colour and planar depth.

    Args:
        color: (H, W, 4) float32 RGBA as `semantics` says.
        depth: (H, W) float32 as `semantics` says.
        camera: what they were rendered with.
        semantics: of the init packet.
    """
    rgb, alpha = color[..., :3], color[..., 3:]
    if semantics.alpha == "premultiplied":
        rgb = np.divide(rgb, alpha, out=np.zeros_like(rgb), where=alpha > 0)
    if semantics.color_space == "linear":
        rgb = srgb(rgb)
    z = planar_depth(color, depth, camera, semantics)
    return Shown(np.concatenate([rgb, alpha], axis=-1), z, camera)


def composed(
    color: Float32Array,
    depth: Float32Array,
    camera: FrameCamera | None,
    semantics: Semantics,
    background: Float32Array,
    background_depth: Float32Array,
) -> Float32Array:
    """Put an application's own geometry among the splats [MEM-13, ACC-10, BUF-8, BUF-9].

    Args:
        color: (H, W, 4) float32 RGBA as `semantics` says.
        depth: (H, W) float32 as `semantics` says.
        camera: what they were rendered with; only distances along rays need it.
        semantics: of the init packet.
        background: (H, W, 3) float32 colour of the geometry, in the image's colour space.
        background_depth: (H, W) float32, its planar depth, +∞ where there is none.

    Returns:
        (H, W, 3) float32 in the image's colour space.
    """
    over = over_premultiplied if semantics.alpha == "premultiplied" else over_straight
    z = planar_depth(color, depth, camera, semantics)
    return over(color, z, background, background_depth)


def planar_depth(
    color: Float32Array, depth: Float32Array, camera: FrameCamera | None, semantics: Semantics
) -> Float32Array:
    """Return (H, W) float32: z in camera axes and scene units.

    It is +∞ where there is no surface [BUF-8, BUF-9].
    """
    known = (depth > 0) & (depth < np.inf) & (depth != semantics.depth_empty)
    surface = known & (color[..., 3] > 0)
    z: Float32Array = np.where(surface, depth, np.float32(np.inf))
    if semantics.depth_kind == "ray_distance" and camera is not None:
        z = (z / np.linalg.norm(rays(camera), axis=-1)).astype(np.float32)
    return z


def rays(camera: FrameCamera) -> NDArray[np.float64]:
    """Return (H, W, 3) float64: the direction of each pixel's ray in camera axes, z being 1.

    A point of the ray is planar depth times direction; pixel centres are at half-integers.
    """
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    return np.stack([*np.meshgrid(x, y), np.ones((camera.height, camera.width))], axis=-1)


def range_of(depths: Float32Array) -> tuple[float, float]:
    """Return the depths that false colours are to span: all but the outermost half per cent.

    They differ by a hundredth at the least, or one would see how depths were rounded.

    Args:
        depths: in scene units; 0 or +∞ where there is no surface.
    """
    known = depths[(depths > 0) & (depths < np.inf)]
    if not known.size:
        return 0.0, 1.0
    near, far = (float(end) for end in np.percentile(known, [0.5, 99.5]))
    return near, max(far, 1.01 * near)


def srgb(linear: Float32Array) -> Float32Array:
    """Return the sRGB encoding of linear light in [0, 1] (IEC 61966-2-1)."""
    encoded = np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055
    )
    return encoded.astype(np.float32)
