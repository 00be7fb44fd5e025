"""Camera poses as a person writes them."""

import argparse
import math
import operator

from splatbus_wire.poses import Pose, Vector


def parse_pose(text: str) -> Pose:
    """Return the pose spelled as `x,y,z,qx,qy,qz,qw`; ValueError if it is none."""
    x, y, z, i, j, k, w = _numbers(text, 7)
    return Pose((x, y, z), (i, j, k, w))


def parse_look_at(text: str) -> Pose:
    """Return the pose of `look_at` spelled as `ex,ey,ez,tx,ty,tz`.

    Raises:
        ValueError: these are not six numbers.
        ArgumentTypeError: both points are the same.
    """
    ex, ey, ez, tx, ty, tz = _numbers(text, 6)
    try:
        return look_at((ex, ey, ez), (tx, ty, tz))
    except ValueError as same:
        raise argparse.ArgumentTypeError(f"{text!r}: {same}; give two points") from None


def look_at(eye: Vector, target: Vector) -> Pose:
    """Return the pose of an upright camera at `eye` that sees `target` in its centre.

    A turn by ψ about y (down) after one by φ about x, which take +z to the direction of view:
    (0, sin ψ/2, 0, cos ψ/2) · (sin φ/2, 0, 0, cos φ/2) [CNV-1, CNV-3].

    Raises:
        ValueError: eye and target coincide.
    """
    dx, dy, dz = (t - e for t, e in zip(target, eye))
    if not math.hypot(dx, dy, dz) > 0:
        raise ValueError("the eye and the point to look at are the same")
    half_turn = math.atan2(dx, dz) / 2
    half_tilt = math.atan2(-dy, math.hypot(dx, dz)) / 2
    sin_turn, cos_turn = math.sin(half_turn), math.cos(half_turn)
    sin_tilt, cos_tilt = math.sin(half_tilt), math.cos(half_tilt)
    return Pose(
        eye, (cos_turn * sin_tilt, sin_turn * cos_tilt, -sin_turn * sin_tilt, cos_turn * cos_tilt)
    )


def same_view(a: Pose, b: Pose) -> bool:
    """Whether two poses differ by no more than a server's rounding; q and −q are the same."""
    apart = math.dist(a.position, b.position)
    cosine = sum(map(operator.mul, a.rotation, b.rotation))
    cosine /= math.hypot(*a.rotation) * math.hypot(*b.rotation)
    return apart <= 1e-6 * max(1.0, math.hypot(*a.position)) and abs(cosine) >= 1 - 1e-9


def _numbers(text: str, count: int) -> list[float]:
    numbers = [float(number) for number in text.split(",")]
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{text!r} is not {count} finite numbers with commas between them")
    return numbers
