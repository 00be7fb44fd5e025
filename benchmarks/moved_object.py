"""One object of the scene moves: move the camera against it, or transform its N Gaussians?

Time against N: the one matrix; positions and rotations of all Gaussians (float32, as matrix
products, into memory that is there already); those and the spherical harmonics, whose coefficients
lie band by band, which suits the processor. Error of the colour against the angle: what is left
when positions and rotations are transformed and the harmonics are not, for random coefficients of a
standard deviation of 0.1, and the two right ways. And a picture of it.

    python -m benchmarks moved_object [--largest 10000000] [--rounds 7] [--gaussians 20000]

writes `benchmarks/results/moved_object.json`, `moved_object_time.png`, `moved_object_colour.png`
and `moved_object.png`. The recipe for renderers is in `reference_server/NUMERICS.md`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from splatbus_server.control import Poses
from splatbus_server.view import View, field_of_view
from splatbus_splats.drawing import harmonics
from splatbus_wire.messages import Placement
from splatbus_wire.poses import Pose

from benchmarks._pictures import pyplot, save
from benchmarks.splats import drawing, turning
from benchmarks.splats.drawing import Gaussians

RESULTS = Path(__file__).parent / "results"
LARGEST_WITH_HARMONICS = 1_000_000
"""Beyond, coefficients before and after would take gigabytes."""
BLOCK = 8192
ONE, ALL, ALL_AND_HARMONICS, RELATIVE = (
    "one matrix: `view.object_to_camera`",
    "N positions and rotations (wrong colours)",
    "N positions, rotations and harmonics",
    "one matrix, and N positions camera-relative",
)
WIDTH, HEIGHT = 360, 300
DEVIATION = 0.1

Floats = NDArray[Any]


def quaternion(axis: Any, degrees: float) -> tuple[float, float, float, float]:
    half = math.radians(degrees) / 2
    x, y, z = np.array(axis) / np.linalg.norm(axis) * math.sin(half)
    return float(x), float(y), float(z), math.cos(half)


def view_of(points: Pose, camera: Pose = Pose((0.0, 0.0, -3.3), (0.0, 0.0, 0.0, 1.0))) -> View:  # noqa: B008 - it is immutable
    return View(
        Poses(camera, {"default": Placement("default", points)}),
        field_of_view(WIDTH, HEIGHT),
        WIDTH,
        HEIGHT,
        frozenset(("color",)),
        1,
    )


MOVED = Pose((0.3, -0.2, 0.5), quaternion((1, 2, 0.5), 70))


def seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def times(count: int, rounds: int) -> list[dict[str, Any]]:
    """Median time of each way for this many Gaussians, and of a copy of what they are."""
    random = np.random.default_rng(1)
    means = random.normal(size=(count, 3)).astype(np.float32)
    rotations = random.normal(size=(count, 4)).astype(np.float32)
    new_means, new_rotations = np.empty_like(means), np.empty_like(rotations)
    R, p = drawing.matrix(np.array(MOVED.rotation)), np.array(MOVED.position, np.float32)
    R32 = R.T.astype(np.float32).copy()
    left = drawing.times_matrix(np.array(MOVED.rotation)).T.astype(np.float32).copy()

    def transform() -> None:
        for start in range(0, count, BLOCK):  # what stays in the processor's cache
            rows = slice(start, start + BLOCK)
            np.matmul(means[rows], R32, out=new_means[rows])
            np.add(new_means[rows], p, out=new_means[rows])
            np.matmul(rotations[rows], left, out=new_rotations[rows])

    def copy() -> None:
        np.copyto(new_means, means)
        np.copyto(new_rotations, rotations)

    ways: dict[str, Callable[[], Any]] = {
        ONE: lambda: view_of(MOVED).object_to_camera.astype(np.float32),
        RELATIVE: lambda: view_of(MOVED).camera_relative(means, out=new_means),
        ALL: transform,
        "copy of positions and rotations": copy,
    }
    if count <= LARGEST_WITH_HARMONICS:
        coefficients = np.full((16, 3, count), 0.1, np.float32)

        def everything() -> None:
            transform()
            turning.turned(coefficients, R)

        ways[ALL_AND_HARMONICS] = everything
    for work in ways.values():
        work()  # touches the memory
    measured: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(rounds):
        for name, work in ways.items():
            measured[name].append(seconds(work))
    return [
        {"way": name, "gaussians": count, "ms": statistics.median(found) * 1e3}
        for name, found in measured.items()
    ]


def random_gaussians(count: int, degree: int, dtype: type = np.float64, seed: int = 1) -> Gaussians:
    """In a ball of radius 1, with random harmonics up to a degree."""
    random = np.random.default_rng(seed)
    means = random.normal(size=(count, 3))
    means *= (random.random((count, 1)) ** (1 / 3)) / np.linalg.norm(means, axis=1, keepdims=True)
    coefficients = random.normal(0, DEVIATION, (16, 3, count))
    coefficients[harmonics.BANDS[degree].stop :] = 0
    rotations = np.tile((0.0, 0.0, 0.0, 1.0), (count, 1))
    scales = np.full((count, 3), 0.05)
    parts = (means, rotations, scales, np.ones(count), coefficients)
    return Gaussians(*(part.astype(dtype) for part in parts))


def colour_errors(count: int, degree: int, pose: Pose) -> dict[str, Floats]:
    """|error| of each Gaussian's worst channel, in /255, by each way in single precision."""
    exact = random_gaussians(count, degree)
    single = random_gaussians(count, degree, np.float32)
    view = view_of(pose)
    right = drawing.shown_colours(exact.coefficients, exact.means - view.eye())
    world = drawing.moved(single, np.array(pose.position), np.array(pose.rotation))
    from_camera = world.means - np.array(view.poses.camera.position, np.float32)
    R = drawing.matrix(np.array(pose.rotation))
    points, _ = view.camera_relative(single.means)
    found = {
        ALL: drawing.shown_colours(single.coefficients, from_camera),
        ALL_AND_HARMONICS: drawing.shown_colours(
            turning.turned(single.coefficients, R), from_camera
        ),
        ONE: drawing.shown_colours(single.coefficients, points),
    }
    return {way: np.abs(seen - right).max(axis=1) * 255 for way, seen in found.items()}


def colours_by_angle(count: int, angles: list[float], axes: int) -> list[dict[str, Any]]:
    random = np.random.default_rng(3)
    directions = random.normal(size=(axes, 3))
    rows = []
    for degree in (1, 2, 3):
        for angle in angles:
            found = [
                colour_errors(count // axes, degree, Pose(MOVED.position, quaternion(axis, angle)))
                for axis in directions
            ]
            for way in found[0]:
                errors = np.concatenate([each[way] for each in found])
                median, high = np.percentile(errors, [50, 99])
                rows.append(
                    {
                        "way": way,
                        "degree": degree,
                        "angle": angle,
                        "median_255": float(median),
                        "p99_255": float(high),
                        "worst_255": float(errors.max()),
                    }
                )
    return rows


def pictures(count: int) -> dict[str, Floats]:
    """The torus before, and after it has moved: right, wrong, and right in the dear way."""
    torus = drawing.shiny_torus(count)
    tilted = Pose((0.0, 0.0, 0.0), quaternion((1, 0, 0), 35))
    after = Pose((0.15, 0.1, 0.3), quaternion((1.0, 0.55, 0.3), 75))

    def by_camera(pose: Pose) -> Floats:
        view = view_of(pose)
        matrix = view.object_to_camera
        return drawing.draw(torus, matrix, view.eye(), view.intrinsics.fx, WIDTH, HEIGHT)

    def by_gaussians(gaussians: Gaussians) -> Floats:
        view = view_of(Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
        eye = np.array(view.eye())
        return drawing.draw(gaussians, view.world_to_camera, eye, view.intrinsics.fx, WIDTH, HEIGHT)

    world = drawing.moved(torus, np.array(after.position), np.array(after.rotation))
    R = drawing.matrix(np.array(after.rotation))
    turned = world._replace(coefficients=turning.turned(torus.coefficients, R))
    return {
        "before": by_camera(tilted),
        "moved: the camera moved against it": by_camera(after),
        "moved: positions and rotations": by_gaussians(world),
        "moved: those and harmonics": by_gaussians(turned),
    }


def draw_times(rows: list[dict[str, Any]], path: Path) -> None:
    plt = pyplot()
    figure, axes = plt.subplots(figsize=(8, 4.6), layout="constrained")
    for way in dict.fromkeys(row["way"] for row in rows):
        line = [row for row in rows if row["way"] == way]
        style = ":" if way.startswith("copy") else "-"
        label = way.replace("`", "")
        axes.plot(
            [row["gaussians"] for row in line],
            [row["ms"] for row in line],
            marker="o",
            linestyle=style,
            label=label,
        )
    axes.set(xscale="log", yscale="log", xlabel="Gaussians in the object", ylabel="median (ms)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    save(figure, path)


def draw_colours(rows: list[dict[str, Any]], path: Path) -> None:
    plt = pyplot()
    figure, panels = plt.subplots(1, 3, figsize=(12, 4.2), layout="constrained", sharey=True)
    for degree, axes in zip((1, 2, 3), panels, strict=True):
        for colour, way in zip(("crimson", "C1", "C0"), (ALL, ALL_AND_HARMONICS, ONE), strict=True):
            line = [row for row in rows if row["degree"] == degree and row["way"] == way]
            angles = [row["angle"] for row in line]
            for style, member in (("-", "median_255"), ("--", "p99_255"), (":", "worst_255")):
                values = [max(row[member], 1e-6) for row in line]
                label = f"{way.replace('`', '')}, {member.removesuffix('_255')}"
                axes.plot(angles, values, color=colour, linestyle=style, label=label)
        axes.axhline(1, color="grey", linewidth=0.8)
        axes.set(xscale="log", yscale="log", xlabel="angle that the object is turned by (degrees)")
        axes.set_title(f"harmonics up to degree {degree}", fontsize=10)
        axes.grid(alpha=0.3)
    panels[0].set_ylabel(f"error of a Gaussian's colour (/255), σ = {DEVIATION}")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8
    )
    save(figure, path)


def draw_pictures(images: dict[str, Floats], path: Path) -> dict[str, Any]:
    """Returns the worst and the median error of a pixel that shows the object, in /255."""
    plt = pyplot()
    right = images["moved: the camera moved against it"]
    covered = right.sum(axis=2) > 0
    figure, panels = plt.subplots(1, 5, figsize=(17, 3.4), layout="constrained")
    found: dict[str, Any] = {}
    for axes, (title, image) in zip(panels, images.items(), strict=False):
        axes.imshow(np.clip(image, 0, 1))
        if title.startswith(("moved: positions", "moved: those")):
            errors = np.abs(image - right).max(axis=2)[covered] * 255
            found[title] = {
                "worst_255": float(errors.max()),
                "median_255": float(np.median(errors)),
                "share_above_1": float((errors > 1).mean()),
            }
            title += f"\noff by up to {errors.max():.3g}/255, median {np.median(errors):.2g}"
        axes.set_title(title, fontsize=9)
    wrong = np.abs(images["moved: positions and rotations"] - right).max(axis=2) * 255
    shown = panels[4].imshow(wrong, cmap="inferno")
    panels[4].set_title("error of positions and rotations alone (/255)", fontsize=9)
    figure.colorbar(shown, ax=panels[4])
    for axes in panels:
        axes.set_axis_off()
    save(figure, path)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=10_000_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--gaussians", type=int, default=20_000)
    options = parser.parse_args()
    counts = [n for n in (10**e for e in range(2, 9)) if n <= options.largest]
    by_count = [row for count in counts for row in times(count, options.rounds)]
    draw_times(by_count, RESULTS / "moved_object_time.png")
    for row in by_count:
        print(f"{row['gaussians']:,} Gaussians, {row['way']}: {row['ms']:.3g} ms")
    angles = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 60.0, 90.0, 120.0, 180.0]
    by_angle = colours_by_angle(options.gaussians, angles, 8)
    draw_colours(by_angle, RESULTS / "moved_object_colour.png")
    for row in by_angle:
        if row["angle"] in (1.0, 30.0, 90.0, 180.0):
            print({name: f"{v:.3g}" if isinstance(v, float) else v for name, v in row.items()})
    of_pixels = draw_pictures(pictures(6000), RESULTS / "moved_object.png")
    print(of_pixels)
    report = {
        "command": f"python -m benchmarks moved_object --largest {options.largest}"
        f" --rounds {options.rounds} --gaussians {options.gaussians}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
        "coefficient_deviation": DEVIATION,
        "times": by_count,
        "colours": by_angle,
        "picture": of_pixels,
    }
    (RESULTS / "moved_object.json").write_text(json.dumps(report, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
