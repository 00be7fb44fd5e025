"""Where does single precision break down? Far cameras, long chains, depths, faint pixels, 8K.

Five parts, each a module of `benchmarks/stressing/`, which says what is measured and against what:
`far` (cameras up to 10⁹ units from the origin), `drift` (a million poses composed), `depths`
(depth from 1e-6 to 1e9, alpha from 1 to 1e-7, subnormals), `big_images` (a ring of 8K images, 4 GB
of shared memory), `pose_sets` (the numbers that break careless arithmetic).

    python -m benchmarks stress [--poses 10000] [--steps 1000000] [--parts far,drift,…]

writes `benchmarks/results/stress.json`, and `stress_far.png`, `stress_drift.png`,
`stress_depths.png`. What follows for renderers is in `reference_server/NUMERICS.md`.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.stressing import big_images, depths, drift, far, pose_sets

RESULTS = Path(__file__).parent / "results"
DISTANCES = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 6.4e6, 1e8, 1e9]
PARTS = ("far", "drift", "depths", "big_images", "pose_sets")


def far_away(poses: int, steps: int) -> Any:
    rows = far.measure(DISTANCES, poses)
    far.draw(rows, RESULTS / "stress_far.png")
    for row in rows:
        if row["distance"] in (1.0, 1e4, 1e6):
            print(
                f"{row['way']}, at {row['distance']:g}: {row['worst_px']:.2g} px,"
                f" centre {row['worst_centre']:.2g}"
            )
    chosen = [far.deployed_at_its_worst(distance, poses) for distance in (1e4, 1e6)]
    searched = [far.relative_at_its_worst(d, poses, 2 * poses) for d in (1.0, 1e6)]
    print(*chosen, *searched, sep="\n")
    return {"rows": rows, "deployed_at_its_worst": chosen, "relative_at_its_worst": searched}


def drifting(poses: int, steps: int) -> Any:
    rows = drift.measure(steps)
    drift.draw(rows, RESULTS / "stress_drift.png")
    refused = drift.steps_until_refused(10 * steps)
    for row in rows:
        if row["steps"] == steps:
            same = "one step again and again" if row["same_step"] else "random steps"
            print(
                f"{row['way']}, {steps:,} times {same}: {row['angle']:.2g} rad,"
                f" {row['off_rotation']:.2g} from a rotation, {row['position']:.2g} units"
            )
    print(f"one float32 step again and again: refused by POS-3 after {refused}")
    return {"rows": rows, "refused_after": refused}


def deep_and_faint(poses: int, steps: int) -> Any:
    by_depth = [row for alpha in (1.0, 0.5) for row in depths.by_depth(alpha)]
    by_alpha = depths.by_alpha()
    depths.draw(by_depth, by_alpha, RESULTS / "stress_depths.png")
    worst = {
        name: max(row["relative_error"] for row in by_depth if row["way"] == name)
        for name in depths.WAYS
    }
    subnormal = depths.subnormals()
    print(worst, *subnormal, sep="\n")
    return {"worst_depth_error": worst, "by_alpha": by_alpha, "subnormals": subnormal}


def big(poses: int, steps: int) -> Any:
    rows = [big_images.measure(name, 4, 9, 20_000) for name in big_images.SIZES]
    print(*rows, sep="\n")
    return {"rows": rows, "offsets": big_images.largest_offsets()}


def poses_of_the_sets(poses: int, steps: int) -> Any:
    rows = pose_sets.measure(poses // 20, poses // 10)
    for row in rows:
        print(row["set"], {kind: row[kind]["u"] for kind in ("R", "RtR", "t", "centre")})
    answers = pose_sets.decided()
    print(*answers.items(), sep="\n")
    return {"taken": rows, "decided": answers}


def spelled(value: Any) -> Any:
    """The value with "inf" for infinity, which JSON has no number for."""
    if isinstance(value, dict):
        return {name: spelled(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [spelled(each) for each in value]
    return "inf" if value == math.inf else value


MEASURE = dict(
    zip(PARTS, (far_away, drifting, deep_and_faint, big, poses_of_the_sets), strict=True)
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--parts", default=",".join(PARTS))
    options = parser.parse_args()
    path = RESULTS / "stress.json"
    report = json.loads(path.read_text("utf-8")) if path.exists() else {}
    command = f"python -m benchmarks stress --poses {options.poses} --steps {options.steps}"
    for part in options.parts.split(","):
        print(f"-- {part}", flush=True)
        report[part] = {
            "command": f"{command} --parts {part}",
            "python": platform.python_version(),
            "numpy": np.__version__,
            "system": f"{platform.system()} {platform.machine()}",
            "found": MEASURE[part](options.poses, options.steps),
        }
    ordered = {part: report[part] for part in PARTS if part in report}
    path.write_text(json.dumps(spelled(ordered), indent=1, allow_nan=False) + "\n", "utf-8")


if __name__ == "__main__":
    main()
