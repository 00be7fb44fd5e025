"""What a frame costs the clients for engines, beside the client in Python and a copy of the bytes.

Each runs in a process of its own beside a server in another, which publishes as fast as images are
taken. `processor`: of all threads of the client, from one frame to the next, with nothing read.
`arrival`, of C++ alone: from a frame's arrival to the moment at which its copy may begin.
`pose`: from a pose that is sent to its image, of 16×12 pixels. `copy`: colour and depth of a 1080p
image into memory of the client's own; its floor, the same bytes from there to other such memory.

    python -m benchmarks engine_clients

writes `benchmarks/results/engine_clients.json` and `engine_clients.png`. Clients take turns, so
that a disturbance of the machine touches all alike.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import select
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._pictures import pyplot, save

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
CLIENTS = ROOT / "reference_client"
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
    line = ["g++", "-std=c++17", "-O2", f"-I{CLIENTS / 'cpp' / 'include'}", "-pthread"]
    subprocess.run([*line, CLIENTS / "cpp/programs/measure.cpp", "-o", cpp], check=True)
    parts = ("SplatBus.Client", "SplatBus.Measure~")
    found = (each for part in parts for each in (CLIENTS / "csharp" / part).rglob("*.cs"))
    sources = [each for each in found if "obj~" not in each.parts]
    options = ["-unsafe", "-optimize", "-r:System.Numerics.dll", f"-out:{csharp}"]
    subprocess.run(["mcs", *options, *sources], check=True)
    here = [sys.executable, "-m", "benchmarks.engine_clients", "--as-client"]
    return {"Python": here, "C#": ["mono", str(csharp)], "C++": [str(cpp)]}


def serve(width: int, height: int) -> None:
    """A server until its input ends: prints its ports, and publishes one image on and on."""
    import splatbus_server

    color = np.full((height, width, 4), 0.5, np.float32)
    depth = np.full((height, width), 2.0, np.float32)
    with splatbus_server.serve(width, height, ipc_port=0, message_port=0) as bus:
        print(bus.address.ipc_port, bus.address.message_port, flush=True)
        while not select.select([sys.stdin], [], [], 0)[0]:
            if view := bus.next_view(0.05, contents_changed=True):
                bus.publish(view, color, depth)


@contextmanager
def server(size: tuple[int, int]) -> Iterator[dict[str, str]]:
    """The environment of a client of such a server."""
    line = [sys.executable, "-m", "benchmarks.engine_clients", "--as-server", *map(str, size)]
    with subprocess.Popen(
        line, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin
        assert process.stdout
        ipc, message = process.stdout.readline().split()
        yield os.environ | {"SPLATBUS_IPC_PORT": ipc, "SPLATBUS_MSG_PORT": message}
        process.stdin.close()


def client(what: str, count: int) -> dict[str, float]:
    """The Python client, as the others measure themselves."""
    import splatbus_client
    from splatbus_client import Pose

    with splatbus_client.connect() as session:
        for _ in range(WARM_UP):
            session.next_frame(20.0).release()
        if what == "frames":
            before = time.process_time()
            for _ in range(count):
                session.next_frame(20.0).release()
            return {"processor_us": 1e6 * (time.process_time() - before) / count}
        if what == "poses":
            took = []
            for number in range(count):
                began, tag, shown = time.perf_counter(), f"m{number}", None
                pose = Pose((0.001 * number, 0.0, -4.0), (0.0, 0.0, 0.0, 1.0))
                session.send_camera(pose, tag=tag)
                while shown != tag:
                    with session.next_frame(20.0) as frame:
                        shown = frame.camera.tag
                took.append(1e6 * (time.perf_counter() - began))
            p50, p99 = np.quantile(took, (0.5, 0.99)).tolist()
            return {"p50_us": p50, "p99_us": p99}
        return copies(session, count)


def copies(session: Any, count: int) -> dict[str, float]:
    took, floor, own, other = [], [], None, None
    for _ in range(count):
        with session.next_frame(20.0) as frame:
            planes = frame.color, frame.depth
            if own is None or other is None:
                own, other = ([np.zeros_like(each) for each in planes] for _ in range(2))
            began = time.perf_counter()
            for to, plane in zip(own, planes, strict=True):
                np.copyto(to, plane)
            took.append(1e6 * (time.perf_counter() - began))
            began = time.perf_counter()
            for to, plane in zip(other, own, strict=True):
                np.copyto(to, plane)
            floor.append(1e6 * (time.perf_counter() - began))
    return {"copy_us": float(np.median(took)), "floor_us": float(np.median(floor))}


def measure(rounds: int) -> list[dict[str, Any]]:
    """A row for each client: the median of all rounds."""
    found: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    with tempfile.TemporaryDirectory() as scratch:
        commands = compiled(Path(scratch))
        for number in range(rounds):
            for what, (size, count) in WORK.items():
                for name, command in commands.items():
                    if what == "arrivals" and name != "C++":
                        continue
                    with server(size) as where:
                        line = [*command, what, str(count)]
                        done = subprocess.run(
                            line, cwd=ROOT, env=where, capture_output=True, text=True, timeout=300
                        )
                    assert done.returncode == 0, done.stderr
                    told = json.loads(done.stdout)
                    print(f"round {number + 1}, {name}, {what}: {told}", flush=True)
                    for quantity, value in told.items():
                        found[name][quantity].append(value)
    return [
        {
            "client": name,
            **{each: round(float(np.median(values)), 1) for each, values in of.items()},
        }
        for name, of in found.items()
    ]


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    plt = pyplot()
    names = [row["client"] for row in rows]
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
    arrival = next(row["arrival_us"] for row in rows if row["client"] == "C++")
    heights = [*(row["processor_us"] for row in rows), arrival]
    left.bar_label(left.bar([*names, "C++, to\nthe copy"], heights), fmt="%.0f")
    left.axhline(GOAL_US, linestyle=":", color="black")
    left.set_title("processor time of a frame, µs")
    middle.bar(names, [row["p99_us"] for row in rows], color="tab:gray", label="p99")
    middle.bar_label(middle.bar(names, [row["p50_us"] for row in rows], label="p50"), fmt="%.0f")
    middle.set_title("from a pose to its image, µs")
    middle.legend()
    bars = right.bar(names, [row["copy_us"] / row["floor_us"] for row in rows])
    right.bar_label(bars, fmt="%.2f")
    right.axhline(1.0, linestyle=":", color="black")
    right.set_title("copy of a 1080p image, times the floor")
    save(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks engine_clients")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--as-server", nargs=2, type=int, help=argparse.SUPPRESS)
    parser.add_argument("--as-client", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.as_server:
        serve(*given.as_server)
    elif given.as_client:
        print(json.dumps(client(given.as_client[0], int(given.as_client[1]))))
    else:
        store(given.rounds)


def store(rounds: int) -> None:
    rows = measure(rounds)
    by_name = {row["client"]: row for row in rows}
    cpp, python = by_name["C++"]["processor_us"], by_name["Python"]["processor_us"]
    result = {
        "command": f"python -m benchmarks engine_clients --rounds {rounds}",
        "machine": platform.platform(),
        "cores": os.cpu_count(),
        "goals": {"cpp_arrival_us": GOAL_US, "python_to_cpp": GOAL_PART},
        "python_to_cpp": round(python / cpp, 1),
        "rows": rows,
    }
    RESULTS.joinpath("engine_clients.json").write_text(json.dumps(result, indent=1) + "\n", "utf-8")
    draw(rows, RESULTS / "engine_clients.png")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
