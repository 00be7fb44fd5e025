"""Two images of one static scene, each with a depth and a camera: do they show the same surfaces?

Each covered pixel of one is taken to the world and seen from the camera of the other, whose depth
there must be the point's. What the numbers could have been taken for by mistake is a *reading*: the
images tell which one they fit.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.images.pinhole import Camera, Reals, Rigid, rigid

CLOSENESS = 1e-4
"""How far numbers of the same pose may be apart; those of a position relative to the largest."""
CLOSE = 0.02
"""Relative error of depth within which two images agree at a point. Surfaces that are interpolated
between pixels, and splats that no depth describes sharply, stay within it; what the readings do to
a camera that moved a tenth of its distance does not."""
SMOOTH = 1.15
"""How much the depths of four neighbouring pixels may differ: beyond it there is an edge."""
MOST_POINTS = 6000
LEAST_LANDED = 0.25
"""Of the points, so many count at least: a reading that sees nothing at all explains nothing."""
LEAST_POINTS = 50
"""Points from which an image tells anything; fewer agree by chance."""
FITS = 0.75
"""The share of points that agree, from which a reading explains the images."""
APART = 0.25
"""How much more must agree with one reading than with another to tell them apart."""
SOFT, CLEAR = 0.2, 4.0
"""What tells as much of soft splats, whose depths agree at few points by any reading: which share
agrees, and how many times more than by another reading."""


class DepthView(NamedTuple):
    """An image: what its frame says of the camera, and its depth."""

    camera: Camera
    position: Sequence[float]
    """As named on the wire."""
    rotation: Sequence[float]
    """x, y, z, w as named on the wire."""
    depth: Reals
    """(h, w), rows top-down, planar, +∞ where empty."""


class ViewPair(NamedTuple):
    """Two images, and how the scene moved between them: Rigid() where it did not."""

    before: DepthView
    after: DepthView
    moved: Rigid = Rigid()


class Misreading(NamedTuple):
    """What the numbers of a frame may have been taken for."""

    code: str
    words: str
    """Completes "the images fit …"."""
    pose: Callable[[DepthView], Rigid] = lambda view: view.camera.pose
    depth: Callable[[DepthView], Reals] = lambda view: view.depth
    still: bool = False
    """The second image was rendered with the camera of the first."""
    scene: Callable[[Rigid], Rigid] = lambda moved: moved


def agreement(pair: ViewPair, reading: Misreading) -> float:
    """The share of points at which the second image holds the depth that the first one promises.

    Points that leave the image, or land beside an edge of it, do not count; if few are left, as
    many are taken to disagree as LEAST_LANDED and LEAST_POINTS have it.
    """
    points, landing = _projected(pair, reading)
    return len(landing.agree) / max(landing.counted, LEAST_LANDED * points, LEAST_POINTS)


def same_rows(before: Reals, after: Reals, pair: ViewPair, reading: Misreading) -> bool:
    """Whether what else two images hold (h, w), brightness say, lies as this reading of their
    depths has it, rather than as it is stored.
    """
    _, landing = _projected(pair, reading)
    row, column = landing.row[landing.agree], landing.column[landing.agree]
    off = []
    for read in (reading.depth, AS_SPECIFIED.depth):
        some, others = (
            read(view._replace(depth=values))
            for view, values in zip(pair[:2], (before, after), strict=True)
        )
        begun = some.ravel()[landing.begun[landing.agree]]
        off.append(float(np.abs(begun - others[row, column]).mean()))
    return off[0] <= off[1]


class _Landing(NamedTuple):
    """Where points of one image come to lie in the other."""

    begun: NDArray[np.int64]
    """From which pixels they come, of those that land inside."""
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    counted: int
    """How many land within smooth depth or nothing."""
    agree: NDArray[np.int64]
    """Which of these land at their own depth."""


def _projected(pair: ViewPair, reading: Misreading) -> tuple[int, _Landing]:
    before, after, moved = pair
    depth = reading.depth(before)
    seen = np.flatnonzero(np.isfinite(depth) & (depth > 0))
    seen = seen[:: max(1, len(seen) // MOST_POINTS)]
    rows, columns = np.divmod(seen, depth.shape[1])
    points = depth[rows, columns, None] * before.camera.rays_at(columns, rows)
    world = reading.scene(moved).place(reading.pose(before).place(points))
    arrived = reading.pose(before if reading.still else after).sees(world)
    return len(points), _land(seen, arrived, after.camera, reading.depth(after))


def _land(begun: NDArray[np.int64], points: Reals, camera: Camera, depth: Reals) -> _Landing:
    """Points (n, 3) in camera axes, and where they land."""
    ahead = np.isfinite(points).all(axis=-1) & (points[:, 2] > 0)
    begun, points = begun[ahead], points[ahead]
    with np.errstate(over="ignore"):
        u = camera.fx * points[:, 0] / points[:, 2] + camera.cx - 0.5
        v = camera.fy * points[:, 1] / points[:, 2] + camera.cy - 0.5
    inside = (u >= 0) & (v >= 0) & (u < camera.width - 1) & (v < camera.height - 1)
    u, v, z = u[inside], v[inside], points[inside, 2]
    column, row = u.astype(np.int64), v.astype(np.int64)
    around = np.stack([depth[row + i, column + j] for i in (0, 1) for j in (0, 1)])
    with np.errstate(divide="ignore"):
        corners = np.where(around > 0, 1.0 / around, 0.0)
    nothing = ~corners.any(axis=0)
    smooth = (corners > 0).all(axis=0) & (corners.max(axis=0) <= SMOOTH * corners.min(axis=0))
    x, y = u - column, v - row
    # 1/z of a plane is linear in the image: between pixels it is right where z would not be.
    between = np.stack(((1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y))
    agrees = smooth & (np.abs(z * (between * corners).sum(axis=0) - 1.0) <= CLOSE)
    counted = int((smooth | nothing).sum())
    return _Landing(begun[inside], row, column, counted, np.flatnonzero(agrees))


def explain(pairs: Iterable[ViewPair], readings: Sequence[Misreading]) -> NDArray[np.float64]:
    """For each reading, the share of points that agree in the pair that fits it worst."""
    shares = [[agreement(pair, reading) for reading in readings] for pair in pairs]
    worst: NDArray[np.float64] = np.array(shares).reshape(-1, len(readings)).min(axis=0)
    return worst


def tells(share: float, other: float) -> bool:
    """Whether a reading explains images, by which this share of the points agree, and not one by
    which that other share does.
    """
    return (share >= FITS and share - other >= APART) or share >= max(SOFT, CLEAR * other)


AS_SPECIFIED = Misreading("as-specified", "what the frames say")


def _posed(change: Callable[[Rigid], Rigid]) -> Callable[[DepthView], Rigid]:
    return lambda view: change(view.camera.pose)


def _turned(*order: tuple[int, float]) -> Callable[[DepthView], Rigid]:
    """A pose whose quaternion has its members at other places, with other signs."""
    return lambda view: rigid(view.position, [sign * view.rotation[at] for at, sign in order])


def _axes(world: Sequence[float], camera: Sequence[float]) -> Callable[[DepthView], Rigid]:
    """A pose in axes with other signs."""
    w, c = np.array(world), np.array(camera)
    return _posed(lambda pose: Rigid(w[:, None] * pose.rotation * c, w * pose.position))


def _scaled(factor: float) -> Misreading:
    return Misreading(
        "depths-scaled",
        f"depths of which {1 / factor:g} make a scene unit",
        depth=lambda view: view.depth * factor,
    )


def _planar(view: DepthView) -> Reals:
    """Planar depth, if what was stored is the distance along the ray."""
    planar: Reals = view.depth / np.linalg.norm(view.camera.rays(), axis=-1)
    return planar


def _inverse(view: DepthView) -> Reals:
    with np.errstate(divide="ignore"):
        depth: Reals = np.where(np.isfinite(view.depth), 1.0 / view.depth, np.inf)
    return depth


def _of_z_buffer(view: DepthView, *, reverse: bool) -> Reals:
    """Planar depth, if what was stored is what a GPU tests against, from 0 at near to 1 at far."""
    near, far = view.camera.near, view.camera.far
    stored = 1.0 - view.depth if reverse else view.depth
    drawn = np.isfinite(stored) & (stored > 0) & (stored < 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth: Reals = np.where(drawn, near * far / (far - stored * (far - near)), np.inf)
    return depth


QUATERNIONS = (
    Misreading(
        "rotation-read-w-first",
        "a camera whose rotation was read as w, x, y, z",
        _turned((1, 1.0), (2, 1.0), (3, 1.0), (0, 1.0)),
    ),
    Misreading(
        "rotation-sent-w-first",
        "a camera whose rotation was taken for x, y, z, w when it was w, x, y, z",
        _turned((3, 1.0), (0, 1.0), (1, 1.0), (2, 1.0)),
    ),
    Misreading(
        "rotation-inverted",
        "a camera whose rotation is the inverse, as of a JPL quaternion",
        _turned((0, -1.0), (1, -1.0), (2, -1.0), (3, 1.0)),
    ),
)
POSES = (
    Misreading(
        "world-to-camera", "a pose that was taken for world-to-camera", _posed(Rigid.inverse)
    ),
    Misreading(
        "axes-of-opengl",
        "a camera in OpenGL's axes, with y up and looking along −z",
        _axes((1, 1, 1), (1, -1, -1)),
    ),
    Misreading("axes-of-unity", "a pose in Unity's axes with y up", _axes((1, -1, 1), (1, -1, 1))),
)
MIRRORED = Misreading("rows-top-down", "rows stored top-down", depth=lambda view: view.depth[::-1])
"""Of a scene that nobody knows, images with these rows and a pose in Unity's axes are the same."""
ROWS = (
    MIRRORED,
    Misreading(
        "columns-from-the-right",
        "columns stored from right to left",
        depth=lambda view: view.depth[:, ::-1],
    ),
    Misreading(
        "images-turned", "images turned by 180 degrees", depth=lambda view: view.depth[::-1, ::-1]
    ),
)
Z_BUFFERS = (
    Misreading(
        "z-buffer",
        "values of a z-buffer, from 0 at near to 1 at far",
        depth=partial(_of_z_buffer, reverse=False),
    ),
    Misreading(
        "z-buffer-reversed",
        "values of a z-buffer, from 1 at near to 0 at far",
        depth=partial(_of_z_buffer, reverse=True),
    ),
)
DEPTHS = (
    *Z_BUFFERS,
    Misreading("ray-distances", "distances along the ray instead of planar depths", depth=_planar),
    Misreading("inverse-depths", "inverse depths", depth=_inverse),
    *(_scaled(factor) for factor in (1e-3, 1e-2, 0.1, 0.3048, 0.5, 2.0, 10.0, 100.0, 1e3)),
)
MOMENTS = (
    Misreading(
        "former-camera",
        "the camera before, which is not the one that their frame names",
        still=True,
    ),
    Misreading(
        "position-not-applied",
        "a camera whose position is not applied",
        _posed(lambda pose: Rigid(pose.rotation)),
    ),
    Misreading(
        "rotation-not-applied",
        "a camera whose rotation is not applied",
        _posed(lambda pose: Rigid(position=pose.position)),
    ),
)
SCENES = (
    Misreading("scene-unmoved", "a scene that did not move at all", scene=lambda moved: Rigid()),
    Misreading("scene-moved-back", "a scene moved by the inverse of the pose", scene=Rigid.inverse),
    Misreading(
        "scene-not-turned",
        "a scene that was moved, but not turned",
        scene=lambda moved: Rigid(position=moved.position),
    ),
    Misreading(
        "scene-not-moved",
        "a scene that was turned, but not moved",
        scene=lambda moved: Rigid(moved.rotation),
    ),
)
EVERY = (AS_SPECIFIED, *QUATERNIONS, *POSES, *ROWS, *DEPTHS, *MOMENTS)


def named(pose: Rigid, sent: Pose) -> Misreading | None:
    """As what of the pose that was sent a frame names another one; None if as nothing known."""
    plain = DepthView(_NOWHERE._replace(pose=rigid(*sent)), *sent, _NOTHING)
    for reading in (AS_SPECIFIED, *QUATERNIONS, *POSES):
        meant = reading.pose(plain)
        near = CLOSENESS * max(1.0, float(np.abs(meant.position).max()))
        if np.allclose(pose.position, meant.position, rtol=0, atol=near) and np.allclose(
            pose.rotation, meant.rotation, rtol=0, atol=CLOSENESS
        ):
            return reading
    return None


_NOTHING = np.empty((0, 0))
_NOWHERE = Camera(Rigid(), 1.0, 1.0, 0.0, 0.0, 1, 1, 0.01, 100.0)
