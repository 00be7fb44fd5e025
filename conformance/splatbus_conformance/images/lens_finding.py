"""The lens of an image of the closed-form scene whose camera is known, where nobody tells the lens.

1.0 says nothing of focal lengths and principal point: every covered pixel gives a point that has to
lie on the surface it shows, and the lens is what brings them there, by least squares.
"""

import itertools
import math

import numpy as np

from splatbus_conformance.images.known_scene import (
    BALL,
    BOBS,
    NOTHING,
    render,
    render_depth,
    surface,
)
from splatbus_conformance.images.pinhole import Camera, Reals, Rigid

CLIPPING = 1e-3, 1e3
"""Planes between which all of the scene lies, from wherever it is looked at."""
ANGLES = np.geomspace(0.3, 4.0, 24)
"""Focal lengths that are tried first, by the height of the image."""
ASIDE = (0.0, -0.15, 0.15)
"""Principal points that are tried first, from the middle of the image, by its size."""
MOST_PIXELS = 3000
"""Of a larger image only every so many-th row and column is looked at."""
RIGHT = 1e-4
"""How far points lie from surfaces, at most and mostly, where the lens is the right one."""
ALIKE = 0.05
"""Relative error of depth up to which a pixel speaks for a lens that is tried."""
ROUNDS = 12
MOST_STEP = 5.0
OUTLIER = 6.0
LEAST_POINTS = 200
SMALLEST = 1e-7


def find_lens(pose: Rigid, depth: Reals) -> Camera | None:
    """The camera that an image of the scene at rest was rendered with; None if it shows too little.

    Args:
        pose: where the camera was put.
        depth: (h, w), planar, +∞ where empty; rows top-down.
    """
    height, width = depth.shape
    stride = math.ceil(math.sqrt(height * width / MOST_PIXELS))
    some = depth[::stride, ::stride]
    for right, down in itertools.product(ASIDE, ASIDE):
        middle = (0.5 + right) * width, (0.5 + down) * height
        tried = [Camera(pose, f, f, *middle, width, height, *CLIPPING) for f in height * ANGLES]
        camera: Camera | None = max(tried, key=lambda it: _share(_every(it, stride, some), some))
        for _ in range(ROUNDS):
            camera = camera and _fitted(camera, stride, some)
        if camera is not None and _miss(_every(camera, stride, some), some) <= RIGHT:
            return camera
    return None


def _every(camera: Camera, stride: int, depth: Reals) -> Camera:
    """The camera of every so many-th row and column."""
    height, width = depth.shape
    return camera._replace(
        fx=camera.fx / stride,
        fy=camera.fy / stride,
        cx=(camera.cx - 0.5) / stride + 0.5,
        cy=(camera.cy - 0.5) / stride + 0.5,
        width=width,
        height=height,
    )


def _share(camera: Camera, depth: Reals) -> float:
    exact = render_depth(camera)
    seen = np.isfinite(exact) & np.isfinite(depth)
    return float((np.abs(depth[seen] / exact[seen] - 1.0) <= ALIKE).sum())


def _miss(camera: Camera, depth: Reals) -> float:
    """The median of how far depths are off, relative, where both or either see something."""
    exact = render_depth(camera)
    seen = np.isfinite(exact) | np.isfinite(depth)
    with np.errstate(invalid="ignore"):
        off = np.nan_to_num(np.abs(depth[seen] / exact[seen] - 1.0), nan=np.inf)
    return float(np.median(off)) if seen.any() else math.inf


def _fitted(whole: Camera, stride: int, depth: Reals) -> Camera | None:
    """One step of Gauss and Newton."""
    camera = _every(whole, stride, depth)
    exact = render(camera)
    seen = np.isfinite(depth) & (exact.what != NOTHING) & exact.certain
    seen &= ~np.isin(exact.what // 2, (BALL, BOBS))
    if seen.sum() < LEAST_POINTS:
        return None
    rays, z = camera.rays()[seen], depth[seen]
    points = camera.pose.place(z[:, None] * rays)
    distance, normal = surface(exact.what[seen], points)
    across, down = (normal @ camera.pose.rotation)[:, :2].T * z
    moves = np.stack(
        (-across * rays[:, 0], -down * rays[:, 1], -across, -down), axis=-1
    )  # of ln fx, ln fy, cx / fx, cy / fy
    left = np.abs(distance)
    kept = left <= OUTLIER * max(float(np.median(left)), SMALLEST)
    square = moves[kept].T @ moves[kept]
    if kept.sum() < LEAST_POINTS or np.linalg.cond(square) > 1e12:
        return None
    step = np.linalg.solve(square, -moves[kept].T @ distance[kept])
    wide, high, right, low = np.clip(step, -MOST_STEP, MOST_STEP)
    fx, fy = whole.fx * float(np.exp(wide)), whole.fy * float(np.exp(high))
    return whole._replace(
        fx=fx, fy=fy, cx=whole.cx + float(right) * fx, cy=whole.cy + float(low) * fy
    )
