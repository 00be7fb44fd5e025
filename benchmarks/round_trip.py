"""How long does a request take, against an echo of the same bytes?

The command `splatbus-server` answers `get_viewport_size`, and so does a blocking echo, each in a
process of its own: while nothing is rendered, while the demo scene turns at 60 images a second,
while another client sends 10,000 poses a second besides, and while it is rendered without a pause
(320×240; a client has the memory open, or nothing would be rendered). The echo is asked beside all
that, so that both have the same neighbours. Conditions take turns, so that a disturbance of the
machine touches all alike.

    python -m benchmarks round_trip [--seconds 1.0] [--rounds 5]

writes `benchmarks/results/round_trip.json` and `round_trip.png`.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import socket
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._pictures import pyplot, save

RESULTS = Path(__file__).parent / "results"
READY = re.compile(r"IPC port (\d+), message port (\d+)")
GOAL = 3.0
SIXTY = ("--turntable", "30", "--fps", "60")
STATES = {
    "idle": None,
    "60 images a second": SIXTY,
    "60 images, 10,000 poses a second": SIXTY,
    "without a pause": ("--turntable", "30", "--fps", "100000"),
}
FLOODED = "60 images, 10,000 poses a second"
BATCH_POSES, BATCH_SECONDS = 10, 0.001
HELLO = {
    "type": "hello",
    "versions": ["1.1"],
    "client": {"name": "benchmark", "version": "1"},
    "capabilities": ["host_shm", "frames"],
}


def packet(message: dict[str, Any]) -> bytes:
    payload = json.dumps(message, separators=(",", ":")).encode()
    return len(payload).to_bytes(4, "little") + payload


REQUEST = packet({"type": "get_viewport_size"})
IDENTITY = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


def flood(port: int) -> None:
    """Prints a line, then sends poses, each another one, until it is ended."""
    with socket.create_connection(("127.0.0.1", port)) as connection:
        print("ready", flush=True)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        due, x = time.perf_counter(), 0.0
        while True:
            batch = b""
            for _ in range(BATCH_POSES):
                x = (x + 1e-6) % 1.0
                position = {"x": x, "y": 0.0, "z": -2.0}
                batch += packet({"type": "camera_pose", "position": position, "rotation": IDENTITY})
            connection.sendall(batch)  # a server that is too slow is felt here
            due += BATCH_SECONDS
            time.sleep(max(0.0, due - time.perf_counter()))


def serve_echo() -> None:
    """Prints its port, then sends back what one connection sends, until it ends."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        print(listener.getsockname()[1], flush=True)
        connection, _ = listener.accept()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while data := connection.recv(65536):
            connection.sendall(data)


@contextmanager
def process(*command: str) -> Iterator[str]:
    """Runs Python; gives the first line that it prints."""
    with subprocess.Popen(
        [sys.executable, *command], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as child:
        assert child.stdout
        try:
            yield child.stdout.readline()
        finally:
            child.terminate()


@contextmanager
def server(options: tuple[str, ...]) -> Iterator[tuple[int, int]]:
    """The ports of a running server."""
    ports = ("--ipc-port", "0", "--msg-port", "0")
    with process("-m", "splatbus_renderer.cli", *ports, *options) as line:
        match = READY.search(line)
        assert match, line
        yield int(match[1]), int(match[2])


@contextmanager
def watched(ipc_port: int) -> Iterator[None]:
    """A client that has opened the memory, and so lets the server render."""
    with socket.create_connection(("127.0.0.1", ipc_port), timeout=10) as client:
        client.sendall(packet(HELLO))
        received = b""
        while b"generation" not in received:
            received += client.recv(65536)
        client.sendall(packet({"type": "opened", "generation": 1}))
        yield


def round_trips(port: int, seconds: float) -> list[float]:
    """Milliseconds of each of as many requests as fit, one after the other."""
    times = []
    with socket.create_connection(("127.0.0.1", port), timeout=10) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        end = time.perf_counter() + seconds
        while (start := time.perf_counter()) < end:
            connection.sendall(REQUEST)
            connection.recv(65536)
            times.append((time.perf_counter() - start) * 1e3)
    return times


def measure(state: str, seconds: float) -> tuple[list[float], list[float]]:
    """Round trips of the echo and of the server."""
    options = STATES[state]
    with ExitStack() as running:
        ipc_port, message_port = running.enter_context(server(options or ()))
        echo = int(running.enter_context(process(__file__, "--echo")))
        if options is not None:
            running.enter_context(watched(ipc_port))
        if state == FLOODED:
            running.enter_context(process(__file__, "--flood", str(message_port)))
        time.sleep(0.3)
        return round_trips(echo, seconds), round_trips(message_port, seconds)


def summary(times: list[float]) -> dict[str, float]:
    p50, p99 = (round(float(p), 4) for p in np.percentile(times, [50, 99]))
    return {"p50_ms": p50, "p99_ms": p99, "requests": len(times)}


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(8, 4))
    for offset, (who, percentile) in enumerate(
        (w, p) for w in ("echo", "server") for p in ("p50_ms", "p99_ms")
    ):
        places = [state + 0.2 * (offset - 1.5) for state in range(len(rows))]
        heights = [row[who][percentile] for row in rows]
        bars = axis.bar(places, heights, width=0.19, label=f"{who}, {percentile[:3]}")
        axis.bar_label(bars, fmt="%.2g", fontsize=7)
    axis.set_xticks(
        range(len(rows)),
        [f"{row['rendering'].replace(', ', chr(10))}\np50 ×{row['ratio_p50']}" for row in rows],
    )
    axis.set_yscale("log")
    axis.set_ylabel("round trip of get_viewport_size (ms)")
    axis.legend(fontsize=7)
    figure.tight_layout()
    save(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--echo", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--flood", type=int, metavar="PORT", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.echo:
        serve_echo()
        return
    if options.flood:
        flood(options.flood)
        return
    floors: dict[str, list[float]] = defaultdict(list)
    times: dict[str, list[float]] = defaultdict(list)
    for _ in range(options.rounds):
        for state in STATES:
            floor, ours = measure(state, options.seconds)
            floors[state] += floor
            times[state] += ours
    rows = []
    for state in STATES:
        echo, answers = summary(floors[state]), summary(times[state])
        ratio = round(answers["p50_ms"] / echo["p50_ms"], 2)
        rows.append({"rendering": state, "echo": echo, "server": answers, "ratio_p50": ratio})
        print(f"{state}: server {answers}, echo {echo}, p50 {ratio} times (goal {GOAL})")
    report = {
        "command": f"python -m benchmarks round_trip --seconds {options.seconds}"
        f" --rounds {options.rounds}",
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
        "goal_ratio_p50": GOAL,
        "rows": rows,
    }
    (RESULTS / "round_trip.json").write_text(json.dumps(report, indent=1) + "\n", "utf-8")
    draw(rows, RESULTS / "round_trip.png")


if __name__ == "__main__":
    main()
