"""What a frame costs the clients for engines, beside the client in Python and a copy of the bytes.

Each runs in a process of its own beside a server in another, which publishes as fast as images are
taken. `processor`: of all threads of the client, from one frame to the next, with nothing read.
`arrival`, of C++ alone: from a frame's arrival to the moment at which its copy may begin.
`pose`: from a pose that is sent to its image, of 16×12 pixels. `copy`: colour and depth of a 1080p
image into memory of the client's own; its floor, the same bytes from there to other such memory.

    python -m benchmarks engine_clients [--rounds 5]

Clients take turns, so that a disturbance of the machine touches all alike.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _shared, cuda_gl
from benchmarks._shared import Bars

CSHARP = _shared.ROOT / "reference_client" / "csharp"
GOAL_US, GOAL_PART = 20.0, 5.0
"""Of the C++ client: processor time from arrival to copy; and of a frame, as part of Python's."""
SMALL, LARGE = (16, 12), (1920, 1080)
WORK = {
    "frames": (SMALL, 5000),
    "arrivals": (SMALL, 5000),
    "poses": (SMALL, 1000),
    "copies": (LARGE, 60),
}
WARM_UP = 20


def compiled(folder: Path) -> dict[str, list[str]]:
    """The command of each client's program."""
    cpp, csharp = folder / "measure", folder / "measure.exe"
    cuda_gl.compiled("measure", cpp)
    parts = ("SplatBus.Client", "SplatBus.Measure~")
    found = (each for part in parts for each in (CSHARP / part).rglob("*.cs"))
    sources = [each for each in found if "obj~" not in each.parts]
    options = ["-unsafe", "-optimize", "-r:System.Numerics.dll", f"-out:{csharp}"]
    subprocess.run(["mcs", *options, *sources], check=True)
    here = [sys.executable, "-m", "benchmarks.engine_clients", "--as-client"]
    return {"Python": here, "C#": ["mono", str(csharp)], "C++": [str(cpp)]}


def client(what: str, count: int) -> dict[str, float]:
    """The Python client, as the others measure themselves."""
    import splatbus_client
    from splatbus_client import Pose

    with splatbus_client.connect() as session:

        def frames(many: int) -> None:
            for _ in range(many):
                session.next_frame(20.0).release()

        def pose(number: int) -> None:
            tag, shown = f"m{number}", None
            session.send_camera(Pose((0.001 * number, 0, -4), (0.0, 0.0, 0.0, 1.0)), tag=tag)
            while shown != tag:
                with session.next_frame(20.0) as frame:
                    shown = frame.camera.tag

        frames(WARM_UP)
        if what == "frames":
            return {"processor_us": 1e3 * _shared.processor_ms(lambda: frames(count)) / count}
        if what == "poses":
            took = [_shared.wall_ms(partial(pose, number)) for number in range(count)]
            p50, p99 = (1e3 * np.quantile(took, (0.5, 0.99))).tolist()
            return {"p50_us": p50, "p99_us": p99}
        return copies(session, count)


def copies(session: Any, count: int) -> dict[str, float]:
    with session.next_frame(20.0) as frame:
        own, other = (
            [np.zeros_like(each) for each in (frame.color, frame.depth)] for _ in range(2)
        )

    def copied(to: Any, planes: Any) -> None:
        for target, plane in zip(to, planes, strict=True):
            np.copyto(target, plane)

    took, floor = [], []
    for _ in range(count):
        with session.next_frame(20.0) as frame:
            planes = frame.color, frame.depth
            took.append(1e3 * _shared.wall_ms(partial(copied, own, planes)))
            floor.append(1e3 * _shared.wall_ms(partial(copied, other, own)))
    return {"copy_us": float(np.median(took)), "floor_us": float(np.median(floor))}


def measure(rounds: int) -> list[dict[str, Any]]:
    """A row for each client: the median of all rounds."""
    found: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    with tempfile.TemporaryDirectory() as scratch:
        commands = compiled(Path(scratch))
        for _ in range(rounds):
            for what, (size, count) in WORK.items():
                for name in ("C++",) if what == "arrivals" else commands:
                    with cuda_gl.serving("host", size, "always") as ports:
                        line = [*commands[name], what, str(count)]
                        told = subprocess.check_output(
                            line, env=cuda_gl.where(ports), cwd=_shared.ROOT, timeout=300
                        )
                    took = json.loads(told)
                    _shared.told({"client": name, "work": what, **took})
                    for quantity, value in took.items():
                        found[name][quantity].append(value)
    return [
        {"client": name, **{each: round(float(np.median(them)), 1) for each, them in of.items()}}
        for name, of in found.items()
    ]


def draw(rows: list[dict[str, Any]]) -> None:
    names = [row["client"] for row in rows]
    each = {key: [row[key] for row in rows] for key in ("processor_us", "p50_us", "p99_us")}
    arrivals = {"from arrival to copy": [row.get("arrival_us", 0.0) for row in rows]}
    copies = {"copy": [row["copy_us"] / row["floor_us"] for row in rows]}
    frames = {"of a frame": each.pop("processor_us")} | arrivals
    shown = [
        Bars("processor time, µs", names, frames, [GOAL_US]),
        Bars("from a pose to its image, µs", names, each),
        Bars("copy of a 1080p image, times the floor", names, copies, [1.0]),
    ]
    _shared.draw_bars("engine_clients", shown)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks engine_clients")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--as-client", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.as_client:
        print(json.dumps(client(given.as_client[0], int(given.as_client[1]))))
        return
    rows = measure(given.rounds)
    took = {row["client"]: row["processor_us"] for row in rows}
    report = {
        "goals": {"cpp_arrival_us": GOAL_US, "python_to_cpp": GOAL_PART},
        "python_to_cpp": round(took["Python"] / took["C++"], 1),
        "rows": rows,
    }
    _shared.write("engine_clients", report)
    draw(rows)


if __name__ == "__main__":
    main()
