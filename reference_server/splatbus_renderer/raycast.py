"""Draws the closed-form scene with NumPy: float64 per row, column and object; float32 per pixel.

With planar depth as the parameter of a ray (see ``scene.exact_pixel``), nearly every quantity of a
pixel is a polynomial in its image coordinates x and y without a mixed term: a number per column
plus a number per row. Those are computed in float64 and cast once [ACC-6]; a pixel costs one sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_renderer.scene import (
    AMBIENT,
    DIFFUSE,
    Camera,
    Floor,
    Scene,
    Sphere,
    Vector,
    dot,
    rotate,
    subtract,
    transpose,
)

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Line = NDArray[np.float64]


class Render(NamedTuple):
    """Rows top-down; the arrays belong to the raycaster and hold until its next render.

    Attributes:
        color: (height, width, 4) float32, straight RGBA in [0, 1]; 0 where nothing is seen.
        depth: (height, width) float32, planar z in world units, +inf where nothing is seen;
            None if not asked for.
    """

    color: Image
    depth: Image | None


@dataclass(frozen=True)
class _Box:
    """A rectangle of pixels, with its image coordinates x = (u − cx)/fx and y = (v − cy)/fy."""

    rows: slice
    columns: slice
    x: Line
    y: Line


class Raycaster:
    """Renders views of one size into buffers that it keeps."""

    def __init__(self, width: int, height: int) -> None:
        self._color = np.empty((height, width, 4), np.float32)
        self._depth = np.empty((height, width), np.float32)
        self._planes = np.empty((4, height * width), np.float32)
        self._masks = np.empty((2, height * width), np.bool_)

    def render(self, scene: Scene, camera: Camera, want_depth: bool = True) -> Render:
        """Draws the scene as the camera sees it.

        Args:
            scene: what is seen, with its pose in the world.
            camera: of this raycaster's width and height, in world axes.
            want_depth: the depths are kept in any case, to tell what hides what; they are handed
                out only if wanted.

        Raises:
            ValueError: the camera has another size.
        """
        height, width = self._depth.shape
        if (camera.width, camera.height) != (width, height):
            raise ValueError(
                f"the camera is {camera.width}×{camera.height}, the raycaster {width}×{height}"
            )
        self._color.fill(0.0)
        self._depth.fill(np.inf)
        with np.errstate(all="ignore"):  # a ray that misses computes NaN, on purpose
            for part in (scene, *scene.beside):
                self._draw(part, camera)
        return Render(self._color, self._depth if want_depth else None)

    def _draw(self, scene: Scene, camera: Camera) -> None:
        """Draws what has one pose, in units of the world, so that depths can be compared."""
        scene = scene.in_world_units()
        local = camera.in_axes_of(scene.pose)
        for sphere in scene.spheres:
            self._draw_sphere(sphere, local, scene.light)
        if scene.floor is not None:
            self._draw_floor(scene.floor, local, scene.light)

    def _draw_sphere(self, sphere: Sphere, camera: Camera, light: Vector) -> None:
        to_camera = transpose(camera.rotation)
        center = rotate(to_camera, subtract(sphere.center, camera.position))
        box = _sphere_box(center, sphere.radius, camera)
        if box is None:
            return
        root, b, inverse_a, z = self._scratch(box)

        # The discriminant, about the middle of the box: no term is large where the sum is small.
        x0, y0 = box.x[len(box.x) // 2], box.y[len(box.y) // 2]
        dx, dy = box.x - x0, box.y - y0
        cx, cy, cz = center
        power = dot(center, center) - sphere.radius**2
        b0 = cx * x0 + cy * y0 + cz
        constant = b0 * b0 - (x0 * x0 + y0 * y0 + 1.0) * power
        along_x = constant + dx * (2.0 * (b0 * cx - x0 * power) + dx * (cx * cx - power))
        along_y = dy * (2.0 * (b0 * cy - y0 * power) + dy * (cy * cy - power))
        np.multiply(_column(dy), _row(2.0 * cx * cy * dx), out=root)
        root += _row(along_x)
        root += _column(along_y)
        np.sqrt(root, out=root)

        np.add(_row(box.x * cx + cz), _column(box.y * cy), out=b)
        np.add(_row(box.x**2 + 1.0), _column(box.y**2), out=inverse_a)
        np.reciprocal(inverse_a, out=inverse_a)
        np.subtract(b, root, out=z)
        z *= inverse_a
        crosses_near = cz - sphere.radius < camera.near
        if crosses_near:
            leaving = np.add(b, root, out=root)
            leaving *= inverse_a
            np.copyto(z, leaving, where=z < np.float32(camera.near))
        seen = self._nearer(box, z)
        if crosses_near or cz + sphere.radius > camera.far:
            self._keep_between(camera.near, z, camera.far, seen)

        # n·l = (z·d − center)·l / radius, with the light l in camera axes
        lx, ly, lz = rotate(to_camera, light)
        scale = DIFFUSE / sphere.radius
        brightness = np.add(_row((box.x * lx + lz) * scale), _column(box.y * (ly * scale)), out=b)
        brightness *= z
        brightness += np.float32(AMBIENT - dot(center, (lx, ly, lz)) * scale)

        np.copyto(self._depth[box.rows, box.columns], z, where=seen)
        color = self._color[box.rows, box.columns]
        for channel, albedo in enumerate(sphere.albedo):
            np.multiply(brightness, np.float32(albedo), out=color[..., channel], where=seen)
        np.copyto(color[..., 3], np.float32(1.0), where=seen)

    def _draw_floor(self, floor: Floor, camera: Camera, light: Vector) -> None:
        box = _floor_box(floor, camera)
        if box is None:
            return
        z, checks, along, scratch = self._scratch(box)
        across_axis, down_axis, along_axis = camera.rotation
        np.add(_row(box.x * down_axis[0] + down_axis[2]), _column(box.y * down_axis[1]), out=z)
        np.divide(np.float32(floor.height - camera.position[1]), z, out=z)
        seen = self._nearer(box, z)
        self._keep_between(camera.near, z, camera.far, seen)

        limit = floor.extent / floor.check
        for place, axis, start in (
            (checks, across_axis, camera.position[0]),
            (along, along_axis, camera.position[2]),
        ):
            x_part = (box.x * axis[0] + axis[2]) / floor.check
            np.add(_row(x_part), _column(box.y * (axis[1] / floor.check)), out=place)
            place *= z
            place += np.float32(start / floor.check)
            self._keep_between(-limit, place, limit, seen)
            np.floor(place, out=place)
        checks += along
        checks *= np.float32(0.5)
        odd = np.not_equal(checks, np.floor(checks, out=scratch), out=self._mask(1, z))
        odd &= seen

        np.copyto(self._depth[box.rows, box.columns], z, where=seen)
        color = self._color[box.rows, box.columns]
        brightness = AMBIENT - DIFFUSE * light[1]
        for albedo, where in ((floor.even, seen), (floor.odd, odd)):
            rgba = np.array((*(a * brightness for a in albedo), 1.0), np.float32)
            np.copyto(color, rgba, where=where[..., None])

    def _nearer(self, box: _Box, z: Image) -> Mask:
        """Where z hides what was drawn so far; NaN hides nothing."""
        return np.less(z, self._depth[box.rows, box.columns], out=self._mask(0, z))

    def _keep_between(self, low: float, value: Image, high: float, seen: Mask) -> None:
        within = self._mask(1, value)
        seen &= np.greater_equal(value, np.float32(low), out=within)
        seen &= np.less_equal(value, np.float32(high), out=within)

    def _scratch(self, box: _Box) -> tuple[Image, Image, Image, Image]:
        shape = (len(box.y), len(box.x))
        a, b, c, d = (plane[: shape[0] * shape[1]].reshape(shape) for plane in self._planes)
        return a, b, c, d

    def _mask(self, index: int, like: Image) -> Mask:
        return self._masks[index, : like.size].reshape(like.shape)


def _row(values: Line) -> Image:
    return values.astype(np.float32)


def _column(values: Line) -> Image:
    return values.astype(np.float32)[:, None]


def _box(camera: Camera, x: tuple[float, float], y: tuple[float, float]) -> _Box | None:
    """The pixels whose centres may lie in the given ranges of image coordinates, if any."""
    columns = _pixels(x, camera.fx, camera.cx, camera.width)
    rows = _pixels(y, camera.fy, camera.cy, camera.height)
    if columns.start >= columns.stop or rows.start >= rows.stop:
        return None
    centers_x = (np.arange(columns.start, columns.stop) + 0.5 - camera.cx) / camera.fx
    centers_y = (np.arange(rows.start, rows.stop) + 0.5 - camera.cy) / camera.fy
    return _Box(rows, columns, centers_x, centers_y)


def _pixels(interval: tuple[float, float], focal: float, principal: float, size: int) -> slice:
    low, high = (min(max(end * focal + principal, -1.0), size + 1.0) for end in interval)
    return slice(max(math.floor(low - 0.5), 0), min(math.ceil(high + 0.5), size))


def _sphere_box(center: Vector, radius: float, camera: Camera) -> _Box | None:
    """The tight screen rectangle of a sphere given in camera axes; None if it is out of view."""
    x, y, z = center
    if z + radius < camera.near or z - radius > camera.far:
        return None
    return _box(
        camera,
        _tangents(x, z, radius, -camera.cx / camera.fx, (camera.width - camera.cx) / camera.fx),
        _tangents(y, z, radius, -camera.cy / camera.fy, (camera.height - camera.cy) / camera.fy),
    )


def _tangents(x: float, z: float, radius: float, low: float, high: float) -> tuple[float, float]:
    """The slopes x/z of the tangents from the origin to a circle in the x-z plane.

    Mara and McGuire 2013, "2D Polyhedral Bounds of a Clipped, Perspective-Projected 3D Sphere".
    A circle that reaches behind the eye has none: then [low, high], or nothing if outside both.
    """
    if z > radius:
        k = (z - radius) * (z + radius)
        spread = radius * math.sqrt(x * x + k)
        return (x * z - spread) / k, (x * z + spread) / k
    if x - high * z > radius * math.hypot(1.0, high) or low * z - x > radius * math.hypot(1.0, low):
        return math.inf, -math.inf
    return low, high


def _floor_box(floor: Floor, camera: Camera) -> _Box | None:
    """The screen rectangle of the part of the floor beyond the near plane; None if out of view."""
    to_camera = transpose(camera.rotation)
    e, h = floor.extent, floor.height
    corners = [
        rotate(to_camera, subtract(corner, camera.position))
        for corner in ((-e, h, -e), (e, h, -e), (e, h, e), (-e, h, e))
    ]
    visible = []
    for (ax, ay, az), (bx, by, bz) in zip(corners, corners[1:] + corners[:1]):
        if az >= camera.near:
            visible.append((ax / az, ay / az))
        if (az >= camera.near) != (bz >= camera.near):
            t = (camera.near - az) / (bz - az)
            x, y = ax + t * (bx - ax), ay + t * (by - ay)
            visible.append((x / camera.near, y / camera.near))
    if not visible:
        return None
    xs, ys = zip(*visible)
    return _box(camera, (min(xs), max(xs)), (min(ys), max(ys)))
