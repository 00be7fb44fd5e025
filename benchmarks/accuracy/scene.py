"""The closed-form scene of the reference server, at several sizes and precisions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from mpmath import mp, mpf
from splatbus_conformance.images import known_scene
from splatbus_conformance.images.pinhole import Camera as OracleCamera
from splatbus_conformance.images.pinhole import Rigid
from splatbus_renderer.raycast import Raycaster
from splatbus_renderer.scene import (
    AMBIENT,
    DIFFUSE,
    Camera,
    default_camera,
    default_scene,
    exact_pixel,
)
from splatbus_wire.rotations import rotation_matrix

from benchmarks.accuracy.images import Floats
from benchmarks.accuracy.study import Measure, Part, Study, Variant, Worst

SMALL = (320, 240)
SIZES = (SMALL, (960, 540), (1920, 1080))
SCENE = default_scene()


def views(width: int, height: int) -> list[Camera]:
    """From the origin; from aside; from close to a sphere; along the floor; from far away."""
    camera = default_camera(width, height)
    poses = (
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        ((2.0, -1.5, 0.5), (0.15, -0.25, 0.05, 0.95)),
        ((0.0, 0.0, 2.98), (0.0, 0.05, 0.0, 1.0)),
        ((-0.5, 1.02, 0.0), (0.0, 0.02, 0.3, 0.95)),
        ((10.0, -8.0, -30.0), (-0.1, -0.15, 0.02, 0.98)),
    )
    made = []
    for position, q in poses:
        R = rotation_matrix(q)
        made.append(replace(camera, position=position, rotation=(R[:3], R[3:6], R[6:])))
    return made


class Default:
    """The reference server's raycaster, made once for each size."""

    def __init__(self) -> None:
        self.made: dict[tuple[int, int], Raycaster] = {}

    def __call__(self, camera: Camera) -> Floats:
        size = camera.width, camera.height
        if size not in self.made:
            self.made[size] = Raycaster(*size)
        return self.made[size].render(SCENE, camera).color


class InBands:
    """The same, a band of rows at a time, so that what it computes with stays in the cache."""

    def __init__(self, pixels: int) -> None:
        self.pixels = pixels
        self.raycaster = Default()
        self.color = np.empty((1, 1, 4), np.float32)

    def __call__(self, camera: Camera) -> Floats:
        if self.color.shape[:2] != (camera.height, camera.width):
            self.color = np.empty((camera.height, camera.width, 4), np.float32)
        rows = max(1, self.pixels // camera.width)
        for top in range(0, camera.height, rows):
            height = min(rows, camera.height - top)
            band = replace(camera, height=height, cy=camera.cy - top)
            self.color[top : top + height] = self.raycaster(band)
        return self.color


def every_ray(dtype: Any) -> Callable[[Camera], Any]:
    """Every sphere at every pixel, all in one precision: what one writes first."""

    def compute(camera: Camera) -> Any:
        x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
        y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
        local = np.stack([*np.meshgrid(x, y), np.ones((camera.height, camera.width))], axis=-1)
        rays = local.astype(dtype) @ np.array(camera.rotation, dtype).T
        origin = np.array(camera.position, dtype)
        light = np.array(SCENE.light, dtype)
        color = np.zeros((camera.height, camera.width, 4), dtype)
        depth = np.full(rays.shape[:2], np.inf, dtype)
        a = (rays * rays).sum(axis=-1)
        with np.errstate(all="ignore"):
            for sphere in SCENE.spheres:
                e = np.array(sphere.center, dtype) - origin
                b = rays @ e
                root = np.sqrt(b * b - a * (e @ e - dtype(sphere.radius) ** 2))
                for z in ((b - root) / a, (b + root) / a):
                    seen = (z >= camera.near) & (z <= camera.far) & (z < depth)
                    cosine = (z[..., None] * rays - e) @ light / dtype(sphere.radius)
                    brightness = dtype(AMBIENT) + dtype(DIFFUSE) * cosine
                    shaded = brightness[..., None] * np.array(sphere.albedo, dtype)
                    depth = np.where(seen, z, depth)
                    color[..., :3] = np.where(seen[..., None], shaded, color[..., :3])
                    color[..., 3] = np.where(seen, dtype(1), color[..., 3])
            floor = SCENE.floor
            assert floor is not None
            z = (dtype(floor.height) - origin[1]) / rays[..., 1]
            across, along = origin[0] + z * rays[..., 0], origin[2] + z * rays[..., 2]
            seen = (z >= camera.near) & (z <= camera.far) & (z < depth)
            seen &= np.maximum(np.abs(across), np.abs(along)) <= floor.extent
            odd = (np.floor(across) + np.floor(along)) % 2 == 1
            brightness = AMBIENT - DIFFUSE * SCENE.light[1]
            for albedo, where in ((floor.even, seen), (floor.odd, seen & odd)):
                color[where] = np.array([*(c * brightness for c in albedo), 1.0], dtype)
        return color

    return compute


def enlarged(camera: Camera) -> Floats:
    """Half the width and height, each pixel four times."""
    small = replace(
        camera,
        width=camera.width // 2,
        height=camera.height // 2,
        fx=camera.fx / 2,
        fy=camera.fy / 2,
        cx=camera.cx / 2,
        cy=camera.cy / 2,
    )
    return HALF(small).repeat(2, axis=0).repeat(2, axis=1)


def plain_python(camera: Camera) -> Any:
    color = np.empty((camera.height, camera.width, 4))
    for row in range(camera.height):
        for column in range(camera.width):
            color[row, column], _ = exact_pixel(SCENE, camera, column + 0.5, row + 0.5)
    return color


HALF = Default()
VARIANTS = (
    Variant("default: lines in float64, pixels in float32", Default(), "default"),
    Variant("default, in bands of 2¹⁵ pixels", InBands(1 << 15)),
    Variant("default, in bands of 2¹⁷ pixels", InBands(1 << 17)),
    Variant("every ray, float32", every_ray(np.float32)),
    Variant("every ray, float64", every_ray(np.float64)),
    Variant("half the size, enlarged", enlarged),
)
ONLY_SMALL = (Variant("plain Python, float64", plain_python),)


def oracle_camera(camera: Camera) -> OracleCamera:
    pose = Rigid(np.array(camera.rotation), np.array(camera.position))
    return OracleCamera(
        pose, camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height,
        camera.near, camera.far,
    )  # fmt: skip


class Truth(NamedTuple):
    """A view, and what its pixels show."""

    camera: Camera
    exact: known_scene.ExactImage


@cache
def truths(width: int, height: int) -> list[Truth]:
    return [
        Truth(camera, known_scene.render(oracle_camera(camera))) for camera in views(width, height)
    ]


def worst(variant: Variant, width: int, height: int) -> Worst:
    """The worst pixel of each view in float64, and the worst of those against 50 digits."""
    found = []
    for number, (camera, exact) in enumerate(truths(width, height)):
        drawn = np.array(variant.compute(camera), np.float64)
        error = exact.color_error(drawn)
        row, column = map(int, np.unravel_index(int(error.argmax()), error.shape))
        right = digits_50(camera, int(exact.what[row, column]), column + 0.5, row + 0.5)
        off = max(abs(mpf(float(a)) - b) for a, b in zip(drawn[row, column], right, strict=True))
        found.append((float(off), {"view": number, "row": row, "column": column}))
    return Worst(*max(found, key=lambda pair: pair[0]))


def digits_50(camera: Camera, what: int, u: float, v: float) -> list[Any]:
    """The colour of one pixel, where it is known what it shows."""
    if what == known_scene.NOTHING:
        return [mpf(0)] * 4
    with mp.workdps(50):
        local = [(mpf(u) - camera.cx) / camera.fx, (mpf(v) - camera.cy) / camera.fy, mpf(1)]
        ray = [sum(mpf(r) * d for r, d in zip(row, local, strict=True)) for row in camera.rotation]
        light = [mpf(-2) / 7, mpf(-6) / 7, mpf(-3) / 7]
        if what >= known_scene.FLOOR:
            albedo = known_scene.EVEN if what == known_scene.FLOOR else known_scene.ODD
            cosine = -light[1]
        else:
            center, radius, albedo = known_scene.SPHERES[what // 2]
            e = [mpf(s) - mpf(c) for s, c in zip(center, camera.position, strict=True)]
            a = sum(d * d for d in ray)
            b = sum(d * s for d, s in zip(ray, e, strict=True))
            root = mp.sqrt(b * b - a * (sum(s * s for s in e) - mpf(radius) ** 2))
            z = (b + (root if what % 2 else -root)) / a
            cosine = sum((z * d - s) * n for d, s, n in zip(ray, e, light, strict=True)) / mpf(
                radius
            )
        brightness = mpf("0.6") + mpf("0.4") * cosine
        return [mpf(c) * brightness for c in albedo] + [mpf(1)]


def part(width: int, height: int) -> Part:
    camera = default_camera(width, height)
    target = np.empty((height, width, 4), np.float32)
    source = np.ones_like(target)
    return Part(
        title=f"{width}×{height}",
        item="pixel",
        items=width * height,
        floor_title="numpy.copyto of the colours",
        floor=lambda: np.copyto(target, source),
        run=lambda compute: lambda: compute(camera),
        worst=lambda variant, known: [worst(variant, width, height)],
        variants=VARIANTS + (ONLY_SMALL if (width, height) == SMALL else ()),
        measures=(Measure("Colour, edges left out", "of full brightness", 1 / 255, "ACC-13"),),
    )


def study() -> Study:
    return Study("The closed-form scene", [part(*size) for size in SIZES], rounds=7)
