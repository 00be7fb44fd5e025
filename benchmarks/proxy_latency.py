"""What does `splatbus-conformance proxy` add to a message?

A client asks the command `splatbus-server` for `get_viewport_size`, again and again: directly,
through the relay alone (the process that passes bytes on, with nothing kept), and through the
whole proxy, which records, shows and judges. While nothing else happens, while 60 frames and 1,000
poses a second pass beside, and with 10,000 poses a second. What passes beside takes the same way
as the requests, so that all the work a proxy makes for the machine is counted. Ways take turns, so
that a disturbance of the machine touches all alike.

A round trip crosses the proxy twice, so half of what it takes longer at the median is what one
message takes longer. The goal is 100 µs.

    python -m benchmarks proxy_latency [--seconds 1.0] [--rounds 5]

writes `benchmarks/results/proxy_latency.json` and `proxy_latency.png`.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import socket
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import product
from pathlib import Path
from typing import Any

from benchmarks._pictures import pyplot, save
from benchmarks.round_trip import IDENTITY, RESULTS, packet, process, round_trips, server, watched

GOAL_US = 100.0
SIXTY = ("--turntable", "30", "--fps", "60")
POSES = {
    "quiet": 0,
    "60 frames, 1,000 poses a second": 1_000,
    "60 frames, 10,000 poses a second": 10_000,
}
WAYS = ("direct", "relay alone", "proxy")
BATCH_SECONDS = 0.001
SETTLE_SECONDS = 0.5
HOST = "127.0.0.1"


def send_poses(port: int, per_second: int) -> None:
    """Prints a line, then sends poses, each another one, until it is ended."""
    with socket.create_connection((HOST, port)) as connection:
        print("ready", flush=True)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        due, x = time.perf_counter(), 0.0
        while True:
            batch = b""
            for _ in range(round(per_second * BATCH_SECONDS)):
                x = (x + 1e-6) % 1.0
                position = {"x": x, "y": 0.0, "z": -2.0}
                batch += packet({"type": "camera_pose", "position": position, "rotation": IDENTITY})
            connection.sendall(batch)  # a reader that is too slow is felt here
            due += BATCH_SECONDS
            time.sleep(max(0.0, due - time.perf_counter()))


def free_ports() -> tuple[int, int]:
    listeners = [socket.create_server((HOST, 0)) for _ in range(2)]
    ipc, message = (listener.getsockname()[1] for listener in listeners)
    for listener in listeners:
        listener.close()
    return ipc, message


@contextmanager
def passed_on(way: str, to: tuple[int, int], folder: Path) -> Iterator[tuple[int, int]]:
    """The ports that lead to the server in this way."""
    if way == "direct":
        yield to
        return
    ports = free_ports()
    ends = [f"{HOST}:{ipc},{message}" for ipc, message in (ports, to)]
    if way == "relay alone":
        command = ("splatbus_conformance.observe.relay_process", os.devnull, *ends)
    else:
        record = f"--record={folder / 'session.jsonl'}"
        where = (f"--listen={ends[0]}", f"--to={ends[1]}", record)
        command = ("splatbus_conformance", "proxy", *where)
    with subprocess.Popen(
        [sys.executable, "-m", *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        env=os.environ | {"FORCE_COLOR": "1"},  # draw as on a terminal
    ) as running:
        try:
            wait_for(ports[0])
            yield ports
        finally:
            assert running.stdin
            running.stdin.close()
            running.terminate()


def wait_for(port: int) -> None:
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        try:
            socket.create_connection((HOST, port)).close()
        except ConnectionRefusedError:
            time.sleep(0.02)
        else:
            return
    raise TimeoutError(port)


def measure(state: str, way: str, seconds: float) -> list[float]:
    """Milliseconds of each round trip."""
    poses = POSES[state]
    with ExitStack() as running:
        folder = Path(running.enter_context(tempfile.TemporaryDirectory()))
        to = running.enter_context(server(SIXTY if poses else ()))
        ipc, message = running.enter_context(passed_on(way, to, folder))
        if poses:
            running.enter_context(watched(ipc))
            module = ("-m", "benchmarks.proxy_latency")
            send = (*module, "--send-poses", str(message), "--per-second", str(poses))
            running.enter_context(process(*send))
        time.sleep(SETTLE_SECONDS)
        return round_trips(message, seconds)


def summary(rounds: list[list[float]]) -> dict[str, float]:
    """Of each percentile the middle one of all rounds, so that a disturbed round counts little."""
    import numpy as np

    each = np.percentile(np.array([np.percentile(it, [50, 99]) for it in rounds]), 50, axis=0)
    p50, p99 = (round(float(p) * 1e3, 1) for p in each)
    return {"p50_us": p50, "p99_us": p99, "requests": sum(map(len, rounds))}


def rows_of(times: dict[tuple[str, str], list[list[float]]]) -> list[dict[str, Any]]:
    rows = []
    for state in POSES:
        trips = {way: summary(times[state, way]) for way in WAYS}
        for way in WAYS:
            row: dict[str, Any] = {"beside": state, "way": way, "round_trip": trips[way]}
            if way != "direct":
                for percentile in ("p50_us", "p99_us"):
                    more = trips[way][percentile] - trips["direct"][percentile]
                    row[f"added_to_a_message_{percentile}"] = round(more / 2, 1)
            rows.append(row)
            print(row)
    return rows


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    plt = pyplot()
    figure, axes = plt.subplots(1, 2, figsize=(10, 4))
    for axis, percentile in zip(axes, ("p50_us", "p99_us"), strict=True):
        for place, way in enumerate(WAYS[1:]):
            heights = [r[f"added_to_a_message_{percentile}"] for r in rows if r["way"] == way]
            places = [state + 0.36 * (place - 0.5) for state in range(len(heights))]
            bars = axis.bar(places, heights, width=0.34, label=way)
            axis.bar_label(bars, fmt="%.0f", fontsize=8)
        axis.set_xticks(range(len(POSES)), [s.replace(", ", "\n") for s in POSES], fontsize=8)
        axis.set_title(f"{percentile[:3]} of a round trip", fontsize=10)
    axes[0].axhline(GOAL_US, color="black", linestyle=":", label="goal")
    axes[0].set_ylabel("added to a message, one way (µs)")
    axes[0].legend(fontsize=8)
    figure.tight_layout()
    save(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--send-poses", type=int, metavar="PORT", help=argparse.SUPPRESS)
    parser.add_argument("--per-second", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.send_poses:
        send_poses(options.send_poses, options.per_second)
        return
    times: dict[tuple[str, str], list[list[float]]] = defaultdict(list)
    for _ in range(options.rounds):
        for state, way in product(POSES, WAYS):
            times[state, way].append(measure(state, way, options.seconds))
    rows = rows_of(times)
    report = {
        "command": f"python -m benchmarks proxy_latency --seconds {options.seconds}"
        f" --rounds {options.rounds}",
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
        "goal_us": GOAL_US,
        "rows": rows,
    }
    (RESULTS / "proxy_latency.json").write_text(json.dumps(report, indent=1) + "\n", "utf-8")
    draw(rows, RESULTS / "proxy_latency.png")


if __name__ == "__main__":
    main()
