"""How far the pose that a client sent, or understood, is from the right one; and why, if it is far.

Expected poses are the oracle's, in exact arithmetic (spec 1.0 chapter 7, ACC-1, ACC-7).
"""

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Literal, NamedTuple

import numpy as np

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.images.pinhole import MIN_NORM, rotation_matrix
from splatbus_conformance.oracle import (
    ENGINES,
    Engine,
    angle_between,
    error_in_u,
    exact,
    to_single,
    ulps,
)
from splatbus_conformance.oracle.rotations import view_translation
from splatbus_conformance.oracle.rounding import DOUBLE, SINGLE
from splatbus_conformance.trials.testee.adapter import Greeting
from splatbus_conformance.wire.json_values import finites, is_number
from splatbus_conformance.wire.messages import Json

Kind = Literal["camera_pose", "point_cloud_pose"]
Exact = tuple[Fraction, ...]
BUDGET_U = 4.0
"""Of ACC-7, for quaternions."""
SINGLE_IN_DOUBLE = 2.0**29
"""u of single precision, in u of double."""
FAR = 1e-3
"""Radians, and part of a distance: no loss of digits goes so far, any wrong mapping does."""
_SAME = tuple(tuple(Fraction(i == j) for j in range(3)) for i in range(3))
OPENCV = Engine(_SAME, _SAME, 1)


class PoseError(NamedTuple):
    """How far one pose is from the right one."""

    position: float
    """The worst number, in ULP of the precision that the engine holds."""
    rotation: float
    """The worst number, in u = 2⁻⁵³, of q or −q, or of either at unit length."""
    angle: float
    """Radians between the rotations."""
    distance: float
    """‖p − p'‖ / ‖p‖."""
    pixels: float
    """How far a point 1 unit ahead moves on an image of the run's size, at most; fx = w."""
    away: float
    """‖p‖, the camera's distance from the origin in scene units."""

    @property
    def far(self) -> bool:
        """It is another pose, not the same one with fewer digits."""
        return not (self.angle <= FAR and self.distance <= FAR)

    @property
    def away_by(self) -> str:
        """How far, in words."""
        return f"{self.angle:.3g} rad and {self.distance:.3g} of its distance"


def engine_of(greeting: Greeting, kind: Kind) -> Engine:
    """The row of the table in section 7.2 that this client's cameras, or objects, go by."""
    names = {
        ("blender", "camera_pose"): "blender_camera",
        ("blender", "point_cloud_pose"): "blender_object",
        ("opengl_camera", "point_cloud_pose"): "opencv",
    }
    row = ENGINES.get(names.get((greeting.axes, kind), greeting.axes), OPENCV)
    units = Fraction(greeting.units_per_metre)
    return row._replace(scale=int(units) if units.denominator == 1 else units)


def rotation_budget(greeting: Greeting, kind: Kind) -> float:
    """In u: that of ACC-7, in u of single precision where the engine reckons in that and has to.

    A mapping that moves and negates numbers needs no arithmetic.
    """
    engine = engine_of(greeting, kind)
    reckons = engine.world != engine.camera
    return BUDGET_U * SINGLE_IN_DOUBLE if greeting.single and reckons else BUDGET_U


def read_pose(message: Json) -> Pose | None:
    """The pose in a message of a client; None where it has none to reckon with (POS-1, POS-3)."""
    parts = []
    for name, members in (("position", "xyz"), ("rotation", "xyzw")):
        held = message.get(name)
        numbers = [held.get(member) for member in members] if isinstance(held, dict) else [None]
        if not all(map(is_number, numbers)):
            return None
        parts.append(tuple(float(number or 0) for number in numbers))
    return Pose(*parts) if MIN_NORM < math.hypot(*parts[1]) < 1 / MIN_NORM else None


def pose_in(reply: Json) -> Pose | None:
    """The pose in a reply of a server; None where it has none that can be read."""
    position, rotation = finites(reply.get("position"), 3), finites(reply.get("rotation"), 4)
    return Pose(position, rotation) if position and rotation and any(rotation) else None


def off(
    got: Pose, position: Exact, rotation: Exact, *, single: bool, size: tuple[int, int]
) -> PoseError:
    """How far `got` is from an exact pose.

    Args:
        got: what the client sent, or understood.
        position: the right one.
        rotation: the right one, of any norm near 1.
        single: the client holds numbers in single precision.
        size: width and height of the images in pixels.
    """
    form = SINGLE if single else DOUBLE
    told = [to_single(Fraction(n)) if single else n for n in got.position]
    right = [Fraction(to_single(n)) if single else n for n in position]
    ulp = max(0.0 if a == b else ulps(a, b, form) for a, b in zip(told, right, strict=True))
    difference = [a - b for a, b in zip(exact(got.position), position, strict=True)]
    length = math.hypot(*map(float, position))
    distance = math.hypot(*map(float, difference)) / (length or 1.0)
    return PoseError(
        ulp,
        _error_of_rotation(got.rotation, rotation, single),
        angle_between(got.rotation, rotation),
        distance,
        _pixels(got, rotation, difference, *size),
        length,
    )


def misread(
    got: Pose, wire: Pose, engine: Engine, *, single: bool, size: tuple[int, int]
) -> PoseError:
    """How far what a client took a pose on the wire for is from that in its axes; as `off`."""
    right = engine.position_from_wire(wire.position), engine.quaternion_from_wire(wire.rotation)
    return off(got, *right, single=single, size=size)


def _error_of_rotation(got: Sequence[float], right: Exact, single: bool) -> float:
    """In u; a client may have brought q to unit length, or send −q, which is the same rotation."""
    if single and any(
        all(to_single(Fraction(a)) == to_single(s * b) for a, b in zip(got, right, strict=True))
        for s in (1, -1)
    ):
        return 0.0
    norm = Fraction(math.hypot(*map(float, right)))
    candidates = [right] if norm == 1 else [right, tuple(number / norm for number in right)]
    return min(
        error_in_u(got, tuple(sign * number for number in candidate))
        for candidate in candidates
        for sign in (1, -1)
    )


def _pixels(
    got: Pose, rotation: Exact, difference: Sequence[Fraction], width: int, height: int
) -> float:
    """With X = R·Xc + c seen as R'ᵀ·(X − c'), for the corners of the image, one unit ahead."""
    x, y = 0.5, 0.5 * height / width
    corners = np.array([(i, j, 1.0) for i in (-x, x) for j in (-y, y)])
    moved = np.array([float(n) for n in difference])
    world = corners @ rotation_matrix([float(n) for n in rotation]).T - moved
    seen = world @ rotation_matrix(got.rotation)
    if (seen[:, 2] <= 0).any():
        return math.inf
    off = seen[:, :2] / seen[:, 2:] - corners[:, :2]
    return width * float(np.linalg.norm(off, axis=-1).max())


# Why a pose is far from the right one


ORDER = "its quaternion's members are in another order, or signed otherwise"
Direction = Literal["out", "in"]
"""From the engine to the wire, or from the wire to the engine."""


def why(
    given: Pose, got: Pose, engine: Engine, direction: Direction = "out", *, right: bool = False
) -> str:
    """What would explain the pose that came, of the mistakes that are often made; else nothing.

    Args:
        given: what was to be converted.
        got: what came of it.
        engine: the right row of the table.
        direction: in which it was to be converted.
        right: that it is as it should be explains it too.
    """
    fine = [("it is right", *_converted(given, engine, direction))] if right else []
    for words, position, rotation in (*fine, *_mistakes(given, engine, direction)):
        length = math.hypot(*map(float, position)) or 1.0
        apart = math.dist(got.position, [float(number) for number in position])
        if apart <= FAR * length and angle_between(got.rotation, rotation) <= FAR:
            return words
    p, q = _converted(given, engine, direction)
    times = math.hypot(*got.position) / (math.hypot(*map(float, p)) or 1.0)
    scaled = [times * float(number) for number in p]
    if math.dist(got.position, scaled) <= FAR * math.hypot(*scaled):
        turned = "" if angle_between(got.rotation, q) <= FAR else ", and its rotation is another"
        if abs(times - 1.0) > FAR:
            return f"its position is {times:.4g} times what it should be{turned}"
    return ""


def _mistakes(
    given: Pose, engine: Engine, direction: Direction
) -> Iterator[tuple[str, Exact, Exact]]:
    p, q = _converted(given, engine, direction)
    x, y, z, w = q
    for order in ((w, x, y, z), (y, z, w, x), (-x, -y, -z, w), (w, z, y, x)):
        yield ORDER, p, order
    i, j, k, r = given.rotation
    for given_order in ((r, i, j, k), (j, k, r, i)):
        yield ORDER, p, _converted(given._replace(rotation=given_order), engine, direction)[1]
    yield "it is world-to-camera", view_translation(p, q), (-x, -y, -z, w)
    as_it_is = exact(given.position), exact(given.rotation)
    yield f"it is in the {'engine' if direction == 'out' else 'wire'}'s axes", *as_it_is
    yield "only its position was converted", p, as_it_is[1]
    yield "only its rotation was converted", as_it_is[0], q
    metres = engine.scale if direction == "out" else 1 / Fraction(engine.scale)
    units = "the engine's units" if direction == "out" else "scene units"
    yield f"its position is in {units}", tuple(metres * n for n in p), q
    other_way: Direction = "in" if direction == "out" else "out"
    yield (
        "it was converted in the other direction of the table",
        *_converted(given, engine, other_way),
    )
    for name, other in ENGINES.items():
        yield f"it was converted by the row {name}", *_converted(given, other, direction)
    for name, other in ENGINES.items():
        words = f"it was converted by the row {name}, in the other direction"
        yield words, *_converted(given, other, other_way)


def _converted(pose: Pose, engine: Engine, direction: Direction) -> tuple[Exact, Exact]:
    if direction == "out":
        return engine.position_to_wire(pose.position), engine.quaternion_to_wire(pose.rotation)
    return engine.position_from_wire(pose.position), engine.quaternion_from_wire(pose.rotation)
