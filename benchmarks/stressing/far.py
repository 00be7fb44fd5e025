"""Cameras far from the origin: how far off are points 1 to 10 units ahead, by each way to see them?

Poses are random, and one point lies ahead of each, inside a picture of 1920×1080 with a vertical
field of view of 60 degrees. Positions are doubles; every way but the exact one ends in single
precision. Errors are the worst of all poses: of the point in the picture, in pixels (its camera
coordinates are projected in double precision), and of the camera's centre, in scene units.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack
from splatbus_wire.intrinsics import Pinhole
from splatbus_wire.poses import Pose, as_array, camera_centre, view_matrix, world_matrix
from splatbus_wire.relative import object_to_camera, relative_view, two_floats

from benchmarks._pictures import pyplot, save

WIDTH, HEIGHT = 1920, 1080
FOCAL = HEIGHT / (2.0 * math.tan(math.radians(30.0)))
NEAR, FAR = 0.01, 100.0
PROJECTION = np.array(
    (
        (2 * FOCAL / WIDTH, 0, 0, 0),
        (0, 2 * FOCAL / HEIGHT, 0, 0),
        (0, 0, FAR / (FAR - NEAR), -FAR * NEAR / (FAR - NEAR)),
        (0, 0, 1, 0),
    ),
    np.float32,
)
PINHOLE = Pinhole(FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2, WIDTH, HEIGHT)
AROUND_CAMERA = 100.0
"""How near the scene's `origin`, or that of a tile, is to the camera, in units."""

Reals = NDArray[np.float64]
Singles = NDArray[np.float32]


def situations(distance: float, count: int, seed: int = 1) -> list[tuple[Pose, Reals, Reals]]:
    """Camera poses at a distance from the origin, a point ahead of each, and an origin nearby."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        q = random.normal(size=4)
        centre = random.normal(size=3)
        centre *= distance / np.linalg.norm(centre)
        pose = Pose(tuple(centre), tuple(q / np.linalg.norm(q)))
        z = random.uniform(1.0, 10.0)
        ray = random.uniform(-0.5, 0.5, 2) * (WIDTH, HEIGHT) / FOCAL
        point = as_array(world_matrix(pose))[:3, :3] @ (*(ray * z), z) + centre
        nearby = centre + random.uniform(-1, 1, 3) * AROUND_CAMERA / math.sqrt(3)
        found.append((pose, point, nearby))
    return found


def pixels(in_camera: list[Any]) -> Reals:
    """(N, 2) in double precision; infinitely far away where a point got behind the camera."""
    found = PINHOLE.project(np.array(in_camera, np.float64))
    return np.nan_to_num(found, nan=np.inf)


def exact(pose: Pose, point: Reals) -> Reals:
    turn = as_array(view_matrix(pose))[:3, :3]
    return np.asarray(turn @ (point - pose.position))


def apply(view: NDArray[Any], point: Reals) -> Singles:
    """As a renderer does: everything in single precision."""
    matrix, x = view.astype(np.float32), point.astype(np.float32)
    return np.asarray(matrix[:3, :3] @ x + matrix[:3, 3])


def deployed(pose: Pose, point: Reals, nearby: Reals) -> tuple[Reals, Reals]:
    """As 3DGS does: general inverses, single precision, a projection, another general inverse.

    getWorld2View2 inverts to find the view, which is rounded, transposed, and multiplied by the
    projection; the camera's centre is the last row of the transposed view's inverse. Elimination
    with partial pivoting starts with the column (r, r, r, t): where t is hardly larger than the
    rest, but another of its components is 10⁶, the rotation drowns.
    """
    view = np.linalg.inv(as_array(world_matrix(pose)))
    view = np.linalg.inv(np.linalg.inv(view)).astype(np.float32)
    transposed = np.ascontiguousarray(view.T)
    _, _, inverse, _ = lapack.sgesv(transposed, np.eye(4, dtype=np.float32))
    x, y, _, w = np.append(point, 1.0).astype(np.float32) @ (transposed @ PROJECTION.T)
    if w <= 0:
        return np.array((0.0, 0.0, -1.0)), inverse[3, :3].astype(np.float64)
    u, v = (x / (w + np.float32(1e-7)), y / (w + np.float32(1e-7)))
    slopes = np.array((u * WIDTH / (2 * FOCAL), v * HEIGHT / (2 * FOCAL), 1.0))
    return slopes, inverse[3, :3].astype(np.float64)


def rounded_once(pose: Pose, point: Reals, nearby: Reals) -> tuple[Singles, Reals]:
    centre = np.array(camera_centre(view_matrix(pose))).astype(np.float32)
    return apply(as_array(view_matrix(pose)), point), centre.astype(np.float64)


def single_points(pose: Pose, point: Reals, nearby: Reals) -> tuple[Singles, Reals]:
    return camera_relative(pose, point.astype(np.float32).astype(np.float64), nearby)


def camera_relative(pose: Pose, point: Reals, nearby: Reals) -> tuple[Singles, Reals]:
    points, matrix = relative_view(point[None], pose)
    return apply(matrix, points[0].astype(np.float64)), np.array(camera_centre(view_matrix(pose)))


def in_two_floats(pose: Pose, point: Reals, nearby: Reals) -> tuple[Singles, Reals]:
    """Point and centre as two single-precision numbers each, subtracted in single precision."""
    (high, low), (x, rest) = two_floats(pose.position), two_floats(tuple(point.tolist()))
    moved = (x - high) + (rest - low)
    return apply(relative_view(point[None], pose).matrix, moved.astype(np.float64)), (
        high.astype(np.float64) + low
    )


def tile(pose: Pose, point: Reals, nearby: Reals) -> tuple[Singles, Reals]:
    x, y, z = nearby
    view = as_array(object_to_camera(pose, origin=(x, y, z)))
    return apply(view, point - nearby), np.array(camera_centre(view_matrix(pose)))


def with_origin(way: Way) -> Way:
    """What is on the wire is counted from an origin nearby."""

    def counted(pose: Pose, point: Reals, nearby: Reals) -> tuple[NDArray[Any], Reals]:
        x, y, z = pose.position - nearby
        seen, centre = way(Pose((x, y, z), pose.rotation), point - nearby, nearby)
        return seen, centre + nearby

    return counted


Way = Callable[[Pose, Reals, Reals], tuple[NDArray[Any], Reals]]
"""From pose, point and nearby origin to the point in camera axes and the camera's centre."""
WAYS: dict[str, Way] = {
    "deployed: general inverses, float32": deployed,
    "view matrix rounded once": rounded_once,
    "camera-relative, float32 points": single_points,
    "deployed, with `origin`": with_origin(deployed),
    "view matrix rounded once, with `origin`": with_origin(rounded_once),
    "one matrix a tile": tile,
    "camera-relative, two floats a number": in_two_floats,
    "camera-relative": camera_relative,
}


def deployed_at_its_worst(distance: float, count: int, seed: int = 1) -> dict[str, Any]:
    """The camera's centre by `deployed` where the first component of −Rᵀ·c is small on purpose."""
    random = np.random.default_rng(seed)
    worst: dict[str, Any] = {"distance": distance, "centre": 0.0}
    for _ in range(count):
        q = random.normal(size=4)
        q /= np.linalg.norm(q)
        turn = as_array(world_matrix(Pose((0.0, 0.0, 0.0), tuple(q))))[:3, :3]
        others = random.normal(size=2)
        others *= distance / np.linalg.norm(others)
        x, y, z = -(turn @ (random.uniform(-2.0, 2.0), *others))
        pose = Pose((float(x), float(y), float(z)), tuple(q))
        _, centre = deployed(pose, np.array(pose.position), np.zeros(3))
        if (error := float(np.linalg.norm(centre - pose.position))) > worst["centre"]:
            worst |= {"centre": error, "position": pose.position, "rotation": pose.rotation}
    return worst


def relative_at_its_worst(
    distance: float, draws: int, climbs: int, seed: int = 1
) -> dict[str, Any]:
    """The largest error of `camera_relative` in pixels: of random situations, then by climbing."""

    def error(pose: Pose, point: Reals) -> float:
        seen, _ = camera_relative(pose, point, point)
        right = exact(pose, point)
        (u, v), found = pixels([right])[0], pixels([seen])[0]
        inside = 0 <= u <= WIDTH and 0 <= v <= HEIGHT and 1 <= right[2] <= 10
        return float(np.hypot(*(found - (u, v)))) if inside else 0.0

    random = np.random.default_rng(seed)
    worst, pose, point = max(
        ((error(pose, point), pose, point) for pose, point, _ in situations(distance, draws)),
        key=lambda found: found[0],
    )
    for _ in range(climbs):
        step = 10.0 ** random.uniform(-9, -1)
        x, y, z, w = np.array(pose.rotation) + step * random.normal(size=4)
        norm = math.hypot(x, y, z, w)
        near = Pose(pose.position, (x / norm, y / norm, z / norm, w / norm))
        moved = point + step * random.normal(size=3) * 10
        if (climbed := error(near, moved)) > worst:
            worst, pose, point = climbed, near, moved
    return {
        "distance": distance,
        "px": worst,
        "position": pose.position,
        "rotation": pose.rotation,
        "point": point.tolist(),
    }


def measure(distances: list[float], count: int) -> list[dict[str, Any]]:
    """A row for each way and distance: worst error in pixels and of the centre."""
    rows = []
    for distance in distances:
        found = situations(distance, count)
        right = pixels([exact(pose, point) for pose, point, _ in found])
        for name, way in WAYS.items():
            seen = [way(*situation) for situation in found]
            errors = np.hypot(*(pixels([x for x, _ in seen]) - right).T)
            centres = [
                float(np.linalg.norm(centre - pose.position))
                for (_, centre), (pose, _, _) in zip(seen, found, strict=True)
            ]
            rows.append(
                {
                    "way": name,
                    "distance": distance,
                    "worst_px": float(errors.max()),
                    "worst_centre": max(centres),
                }
            )
    return rows


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    plt = pyplot()
    figure, panels = plt.subplots(1, 2, figsize=(12, 5), layout="constrained")
    for axes, member, label in (
        (panels[0], "worst_px", "worst error of a point 1–10 units ahead (pixels, 1920×1080)"),
        (panels[1], "worst_centre", "worst error of the camera's centre (units)"),
    ):
        for number, name in enumerate(WAYS):
            line = [row for row in rows if row["way"] == name]
            values = [min(row[member], 1e12) for row in line]
            axes.plot(
                [row["distance"] for row in line],
                values,
                marker="osDv^<>P"[number],
                markersize=5 if number > 3 else 8,
                linewidth=1.5 if number > 3 else 3,
                linestyle="--" if "origin" in name else "-",
                color="crimson" if name.startswith("deployed") else None,
                label=name.replace("`", ""),
            )
        axes.set(xscale="log", yscale="log", xlabel="camera's distance from the origin (units)")
        axes.set_title(label, fontsize=10)
        axes.grid(alpha=0.3)
    panels[0].axhline(0.5, color="grey", linestyle=":")
    panels[0].text(1, 0.6, "half a pixel", fontsize=8, color="grey")
    panels[0].set_ylim(1e-5, 1e5)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    save(figure, path)
