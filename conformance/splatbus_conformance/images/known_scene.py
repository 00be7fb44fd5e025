"""The scene of `conformance/SCENE.md`: what every pixel of an image of it must hold.

Written from that page alone, in double precision.
"""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.images.pinhole import STILL, Camera, ObjectPlacement, Reals

Whats = NDArray[np.int64]
Where = NDArray[np.bool_]
Numbers = NDArray[np.floating[Any]]

SPHERES = (
    ((0.0, 0.0, 4.0), 1.0, (0.9, 0.2, 0.15)),
    ((-1.6, 0.4, 3.2), 0.6, (0.2, 0.7, 0.25)),
    ((1.5, 0.55, 2.8), 0.45, (0.2, 0.35, 0.9)),
    ((0.8, -1.0, 4.6), 0.5, (0.95, 0.8, 0.2)),
    ((-2.2, -0.7, 5.5), 0.8, (0.7, 0.3, 0.8)),
    ((2.6, 0.2, 5.2), 0.8, (0.3, 0.8, 0.8)),
)
FLOOR_Y, FLOOR_EXTENT = 1.05, 8.0
EVEN, ODD = (0.85, 0.85, 0.8), (0.25, 0.25, 0.3)
LIGHT = np.array((-2.0, -6.0, -3.0)) / 7.0
BOBS, BALL = 1, 2
"""The sphere that moves with time, and the one that is an object of its own, counted from 0."""
RISE, QUARTER = 0.25, np.pi / 2.0

NOTHING, FLOOR = -1, 2 * len(SPHERES)
"""What a pixel shows: 2·k for the first solution on sphere k, 2·k + 1 for the second, then the two
colours of the square."""
EDGE = 1e-5
"""How close to an edge, a tie or a clipping plane nothing is compared; in units of d."""
COLOR_BUDGET = 1.0 / 255.0
DEPTH_BUDGET = 1e-6
"""Relative, beyond what lies within EDGE."""
KNOWN = 0.99
"""The share of pixels that are right, from which an image is taken to show the scene."""
_AROUND = ((0.0, 0.0), (-EDGE, -EDGE), (-EDGE, EDGE), (EDGE, -EDGE), (EDGE, EDGE))


class SceneState(NamedTuple):
    """Where the objects of the scene lie, and when."""

    default: ObjectPlacement = STILL
    ball: ObjectPlacement | None = None
    """None where all spheres belong to `default`."""
    time: float = 0.0

    def centers(self) -> Reals:
        """(spheres, 3), each in the axes of its object."""
        found = np.array([center for center, _, _ in SPHERES])
        found[BOBS, 1] -= RISE * (1.0 - np.cos(QUARTER * self.time))
        return found

    def parts(self) -> Iterator[tuple[ObjectPlacement, tuple[int, ...], bool]]:
        """Each object: where it is, its spheres, and whether it has the square."""
        everything = tuple(range(len(SPHERES)))
        if self.ball is None:
            yield self.default, everything, True
        else:
            yield self.default, tuple(n for n in everything if n != BALL), True
            yield self.ball, (BALL,), False


AT_REST = SceneState()


class ExactImage(NamedTuple):
    """What the pixels of an image must hold; rows top-down."""

    color: Reals
    """(h, w, 4), red, green, blue, alpha."""
    depth: Reals
    """(h, w), planar; +∞ where nothing is seen."""
    nearest: Reals
    """(h, w), the least depth around the pixel."""
    farthest: Reals
    """(h, w), the greatest."""
    what: Whats
    """(h, w), what is seen."""
    certain: Where
    """(h, w): no edge, tie or clipping plane is near."""

    def color_error(self, color: Numbers) -> Reals:
        """(h, w): how far off the worst of a pixel's four numbers is; 0 where uncertain."""
        error = np.abs(np.nan_to_num(color, nan=np.inf) - self.color).max(axis=-1)
        return np.where(self.certain, error, 0.0)

    def depth_error(self, depth: Numbers) -> Reals:
        """(h, w): how far planar depths, +∞ where empty, lie beyond the exact ones around a pixel,
        relative to them; 0 where uncertain.
        """
        with np.errstate(invalid="ignore"):
            error = np.maximum(1.0 - depth / self.nearest, depth / self.farthest - 1.0)
        empty = np.isinf(self.depth) & np.isinf(depth)
        error = np.where(np.isnan(error), np.inf, np.maximum(error, 0.0))
        error = np.where(np.isinf(self.depth) != np.isinf(depth), np.inf, error)
        return np.where(empty | ~self.certain, 0.0, error)

    def depth_is_right(self, depth: Numbers) -> Where:
        """(h, w): planar depths, +∞ where empty, are right; all that are uncertain are."""
        return self.depth_error(depth) <= DEPTH_BUDGET

    def agreement(self, color: Numbers, depth: Numbers) -> float:
        """The share of the certain pixels that are right."""
        right = (self.color_error(color) <= COLOR_BUDGET) & self.depth_is_right(depth)
        return float(right[self.certain].mean()) if self.certain.any() else 0.0


def render(camera: Camera, setting: SceneState = AT_REST) -> ExactImage:
    """What a camera sees of the scene."""
    rays = camera.rays()
    hits = [_hit(camera, rays + np.array((dx, dy, 0.0)), setting) for dx, dy in _AROUND]
    what, depth, certain = hits[0]
    for around, _, _ in hits[1:]:
        certain &= around == what
    depths = np.stack([z for _, z, _ in hits])
    color = np.zeros((*what.shape, 4))
    reached = np.where(np.isinf(depth), 0.0, depth)[..., None] * rays
    for placed, spheres, squared in setting.parts():
        origin, turned = _in_axes_of(placed, camera)
        _paint(color, what, origin + reached @ turned.T, setting, spheres, squared)
    return ExactImage(color, depth, depths.min(axis=0), depths.max(axis=0), what, certain)


def render_depth(camera: Camera) -> Reals:
    """The depth of `render`, of the scene at rest, at a fifth of the cost."""
    return _hit(camera, camera.rays(), AT_REST)[1]


def _in_axes_of(placed: ObjectPlacement, camera: Camera) -> tuple[Reals, Reals]:
    """The camera's centre in an object's axes and units, and the matrix that takes rays there: so
    the planar depths at which they meet the object stay those of the world.
    """
    pose, scale = placed
    return pose.sees(camera.pose.position) / scale, pose.rotation.T @ camera.pose.rotation / scale


def _hit(camera: Camera, rays: Reals, setting: SceneState) -> tuple[Whats, Reals, Where]:
    """What each ray (h, w, 3) meets first, at which planar depth, and whether that is certain."""
    shape, flat = rays.shape[:2], rays.reshape(-1, 3)
    what = np.full(len(flat), NOTHING)
    first, second = np.full(len(flat), np.inf), np.full(len(flat), np.inf)
    clear = np.full(len(flat), True)
    for candidate, at, z in _candidates(camera, flat, setting):
        for plane in (camera.near, camera.far):
            clear[at] &= ~(np.abs(z - plane) <= EDGE * plane)
        z = np.where((z >= camera.near) & (z <= camera.far), z, np.inf)
        former = first[at]
        nearer = z < former
        second[at] = np.where(nearer, former, np.minimum(second[at], z))
        what[at] = np.where(nearer, candidate, what[at])
        first[at] = np.minimum(z, former)
    with np.errstate(invalid="ignore"):
        clear &= ~(second - first <= EDGE * first)
    return what.reshape(shape), first.reshape(shape), clear.reshape(shape)


class _Met(NamedTuple):
    """Those of the rays that meet something."""

    what: Whats | int
    at: Whats
    """Their places among all."""
    z: Reals
    """At which planar depths; of a meeting behind the camera, a negative one."""


def _candidates(camera: Camera, rays: Reals, setting: SceneState) -> Iterator[_Met]:
    """What could be seen by rays (n, 3)."""
    for placed, spheres, squared in setting.parts():
        origin, turned = _in_axes_of(placed, camera)
        inside = rays @ turned.T
        yield from _met_spheres(origin, inside, setting, spheres)
        if squared:
            yield _met_square(origin, inside)


def _met_spheres(
    origin: Reals, rays: Reals, setting: SceneState, spheres: Iterable[int]
) -> Iterator[_Met]:
    lengths, centers = np.einsum("ij,ij->i", rays, rays), setting.centers()
    for number in spheres:
        e, radius = centers[number] - origin, SPHERES[number][1]
        along = rays @ e
        discriminant = along * along - lengths * (e @ e - radius * radius)
        at = np.flatnonzero(discriminant >= 0.0)
        root, b, a = np.sqrt(discriminant[at]), along[at], lengths[at]
        yield _Met(2 * number, at, (b - root) / a)
        yield _Met(2 * number + 1, at, (b + root) / a)


def _met_square(origin: Reals, rays: Reals) -> _Met:
    with np.errstate(divide="ignore", invalid="ignore"):
        z = (FLOOR_Y - origin[1]) / rays[:, 1]
        x, across = origin[0] + z * rays[:, 0], origin[2] + z * rays[:, 2]
        at = np.flatnonzero((np.abs(x) <= FLOOR_EXTENT) & (np.abs(across) <= FLOOR_EXTENT))
    odd = (np.floor(x[at]) + np.floor(across[at])) % 2
    return _Met(FLOOR + odd.astype(np.int64), at, z[at])


def _paint(
    color: Reals,
    what: Whats,
    points: Reals,
    setting: SceneState,
    spheres: Iterable[int],
    squared: bool,
) -> None:
    """Fill in (h, w, 4) where an object is seen, at points (h, w, 3) in its axes."""
    centers = setting.centers()
    for number in spheres:
        seen, (_, radius, albedo) = what // 2 == number, SPHERES[number]
        cosine = (points[seen] - centers[number]) @ LIGHT / radius
        color[seen, :3] = np.array(albedo) * (0.6 + 0.4 * cosine)[:, None]
        color[seen, 3] = 1.0
    for candidate, albedo in ((FLOOR, EVEN), (FLOOR + 1, ODD)) if squared else ():
        color[what == candidate] = (*(np.array(albedo) * (0.6 - 0.4 * LIGHT[1])), 1.0)


def surface(what: Whats, points: Reals) -> tuple[Reals, Reals]:
    """How far points (n, 3) in the axes of the scene, at rest and at time 0, lie outside of what
    (n,) is seen there, and the outward normals (n, 3). Points that show nothing are not allowed.
    """
    distance, normal = np.empty(len(what)), np.empty((len(what), 3))
    for number, (center, radius, _) in enumerate(SPHERES):
        here = what // 2 == number
        outward = points[here] - center
        length = np.linalg.norm(outward, axis=-1)
        distance[here], normal[here] = length - radius, outward / length[:, None]
    here = what >= FLOOR
    distance[here], normal[here] = FLOOR_Y - points[here, 1], (0.0, -1.0, 0.0)
    return distance, normal
