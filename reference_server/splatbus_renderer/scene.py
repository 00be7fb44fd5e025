"""A scene in closed form: the colour and depth of every pixel are known exactly.

Axes are those of the wire (OpenCV: x right, y down, z forward), for the world as for the camera
[CNV-1]. Pixel centres lie at half-integers: (0.5, 0.5) is the centre of the top-left pixel.
Everything here is plain float64 arithmetic on scalars; ``raycast`` draws the same scene fast.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
Rgba = tuple[float, float, float, float]

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
EMPTY: tuple[Rgba, float] = ((0.0, 0.0, 0.0, 0.0), math.inf)
AMBIENT, DIFFUSE = 0.6, 0.4


def dot(a: Vector, b: Vector) -> float:
    """The inner product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    """The vector from b to a."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def transpose(m: Matrix) -> Matrix:
    """The transpose, which for a rotation is the inverse."""
    (a, b, c), (d, e, f), (g, h, i) = m
    return ((a, d, g), (b, e, h), (c, f, i))


def rotate(m: Matrix, v: Vector) -> Vector:
    """The matrix-vector product m·v."""
    return (dot(m[0], v), dot(m[1], v), dot(m[2], v))


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """The matrix product a·b."""
    columns = transpose(b)
    return (rotate(columns, a[0]), rotate(columns, a[1]), rotate(columns, a[2]))


@dataclass(frozen=True)
class Sphere:
    """A sphere in the axes of the scene, in scene units; albedo is RGB in [0, 1]."""

    center: Vector
    radius: float
    albedo: Vector


@dataclass(frozen=True)
class Floor:
    """A checkered square in the plane y = height, centred on the y axis.

    It covers |x| ≤ extent and |z| ≤ extent. The check of a point is even where
    floor(x/check) + floor(z/check) is. It is seen from above and from below alike.
    """

    height: float
    extent: float
    check: float
    even: Vector
    odd: Vector


@dataclass(frozen=True)
class ObjectPose:
    """Where the scene lies: X_world = scale · rotation · X_scene + position [CNV-2]."""

    position: Vector = (0.0, 0.0, 0.0)
    rotation: Matrix = IDENTITY
    scale: float = 1.0


@dataclass(frozen=True)
class Scene:
    """What there is to see: spheres, a floor, and the unit vector towards a distant light.

    Attributes:
        spheres: in the axes of the scene, as floor and light.
        floor: or None.
        light: is fixed to the scene, and turns with it.
        pose: of all that.
        beside: more to see, each with a pose of its own.
    """

    spheres: tuple[Sphere, ...]
    floor: Floor | None
    light: Vector
    pose: ObjectPose = ObjectPose()
    beside: tuple[Scene, ...] = ()

    def in_world_units(self) -> Scene:
        """The same, with the scale in its lengths instead of its pose."""
        s = self.pose.scale
        if s == 1.0:
            return self
        spheres = tuple(
            replace(each, center=_times(s, each.center), radius=s * each.radius)
            for each in self.spheres
        )
        floor = self.floor and replace(
            self.floor,
            height=s * self.floor.height,
            extent=s * self.floor.extent,
            check=s * self.floor.check,
        )
        return replace(self, spheres=spheres, floor=floor, pose=replace(self.pose, scale=1.0))


@dataclass(frozen=True)
class Camera:
    """A pinhole: camera-to-world pose [CNV-1], focal lengths and principal point in pixels.

    Surfaces whose planar depth lies outside [near, far] (world units) are not seen.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    position: Vector = (0.0, 0.0, 0.0)
    rotation: Matrix = IDENTITY
    near: float = 0.01
    far: float = 100.0

    def in_axes_of(self, pose: ObjectPose) -> Camera:
        """The same view from the object's own axes and units.

        Moving the camera against the object costs one matrix however much the object holds, and
        keeps whatever depends on direction (light, spherical harmonics) fixed to the object.
        Planar depths come out in units of the object: world depth is ``pose.scale`` times that.
        """
        to_object = transpose(pose.rotation)
        x, y, z = rotate(to_object, subtract(self.position, pose.position))
        return replace(
            self,
            position=(x / pose.scale, y / pose.scale, z / pose.scale),
            rotation=multiply(to_object, self.rotation),
            near=self.near / pose.scale,
            far=self.far / pose.scale,
        )


def default_camera(width: int, height: int) -> Camera:
    """A camera at the origin that looks along +z with a vertical field of view of 60 degrees."""
    focal = height / (2.0 * math.tan(math.radians(30.0)))
    return Camera(width, height, focal, focal, width / 2.0, height / 2.0)


def default_scene() -> Scene:
    """Six spheres of different size and colour over a floor: no two views of it look alike."""
    light = (-2.0 / 7.0, -6.0 / 7.0, -3.0 / 7.0)
    spheres = (
        Sphere((0.0, 0.0, 4.0), 1.0, (0.9, 0.2, 0.15)),
        Sphere((-1.6, 0.4, 3.2), 0.6, (0.2, 0.7, 0.25)),
        Sphere((1.5, 0.55, 2.8), 0.45, (0.2, 0.35, 0.9)),
        Sphere((0.8, -1.0, 4.6), 0.5, (0.95, 0.8, 0.2)),
        Sphere((-2.2, -0.7, 5.5), 0.8, (0.7, 0.3, 0.8)),
        Sphere((2.6, 0.2, 5.2), 0.8, (0.3, 0.8, 0.8)),
    )
    # At this height no line between checks passes through a pixel's centre in the default view.
    floor = Floor(1.05, 8.0, 1.0, (0.85, 0.85, 0.8), (0.25, 0.25, 0.3))
    return Scene(spheres, floor, light)


def exact_pixel(scene: Scene, camera: Camera, u: float, v: float) -> tuple[Rgba, float]:
    """Colour and planar depth where the ray through image point (u, v) first meets the scene.

    The ray is X(z) = c + z·R·d with d = ((u − cx)/fx, (v − cy)/fy, 1), so its parameter *is* the
    planar depth. It meets a sphere (centre s, radius r) where, with w = R·d and e = s − c,

        z = (w·e ± √((w·e)² − (w·w)(e·e − r²))) / (w·w),

    and the plane y = h where z = (h − c_y) / w_y; the least z in [near, far] is seen. Its colour is
    albedo · (0.6 + 0.4 n·l), with n the outward normal (up for the floor) and l towards the light.

    Args:
        scene: what is seen, with its pose in the world.
        camera: from where; its pose is in world axes.
        u: pixels from the left edge of the image.
        v: pixels from its top edge.

    Returns:
        Straight RGBA in [0, 1] and depth in world units; (0, 0, 0, 0) and +inf where nothing is.
    """
    local = camera.in_axes_of(scene.pose)
    origin = local.position
    ray = rotate(local.rotation, ((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0))

    depth, color = math.inf, EMPTY[0]
    for sphere in scene.spheres:
        for z in _sphere_depths(sphere, origin, ray):
            if local.near <= z <= local.far and z < depth:
                outward = subtract(_point(origin, ray, z), sphere.center)
                depth = z
                color = _shade(sphere.albedo, dot(outward, scene.light) / sphere.radius)
    floor = scene.floor
    if floor is not None and ray[1] != 0.0:
        z = (floor.height - origin[1]) / ray[1]
        x, _, y = _point(origin, ray, z)
        if local.near <= z <= local.far and z < depth and max(abs(x), abs(y)) <= floor.extent:
            even = (math.floor(x / floor.check) + math.floor(y / floor.check)) % 2 == 0
            depth = z
            color = _shade(floor.even if even else floor.odd, -scene.light[1])
    seen = [(color, depth * scene.pose.scale)]
    seen += [exact_pixel(other, camera, u, v) for other in scene.beside]
    return min(seen, key=lambda pixel: pixel[1])


def _times(factor: float, v: Vector) -> Vector:
    return (factor * v[0], factor * v[1], factor * v[2])


def _sphere_depths(sphere: Sphere, origin: Vector, ray: Vector) -> Iterator[float]:
    """Both planar depths at which the ray meets the sphere, nearest first; none for a miss."""
    to_center = subtract(sphere.center, origin)
    a = dot(ray, ray)
    b = dot(ray, to_center)
    discriminant = b * b - a * (dot(to_center, to_center) - sphere.radius**2)
    if discriminant >= 0.0:
        root = math.sqrt(discriminant)
        yield (b - root) / a
        yield (b + root) / a


def _point(origin: Vector, ray: Vector, z: float) -> Vector:
    return (origin[0] + z * ray[0], origin[1] + z * ray[1], origin[2] + z * ray[2])


def _shade(albedo: Vector, cosine: float) -> Rgba:
    brightness = AMBIENT + DIFFUSE * cosine
    return (albedo[0] * brightness, albedo[1] * brightness, albedo[2] * brightness, 1.0)
