"""How long does a request take, against an echo of the same bytes?

The command `splatbus-server` answers `get_viewport_size`, and so does a blocking echo, each in a
process of its own: while nothing is rendered, while the demo scene turns at 60 images a second,
and while it is rendered without a pause (320×240; a client has the memory open, or nothing would
be rendered). While the server renders, the echo is asked beside it, so that both have the same
neighbour. Conditions take turns, so that a disturbance of the machine touches all alike.

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
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

RESULTS = Path(__file__).parent / "results"
READY = re.compile(r"IPC port (\d+), message port (\d+)")
GOAL = 3.0
STATES = {
    "idle": None,
    "60 images a second": ("--turntable", "30", "--fps", "60"),
    "without a pause": ("--turntable", "30", "--fps", "100000"),
}
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
    with process("-m", "splatbus_server.cli", *ports, *options) as line:
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


def measure(options: tuple[str, ...] | None, seconds: float) -> tuple[list[float], list[float]]:
    """Round trips of the echo and of the server."""
    with server(options or ()) as (ipc_port, message_port), process(__file__, "--echo") as echo:
        if options is None:
            time.sleep(0.3)
            return round_trips(int(echo), seconds), round_trips(message_port, seconds)
        with watched(ipc_port):
            time.sleep(0.3)
            return round_trips(int(echo), seconds), round_trips(message_port, seconds)


def summary(times: list[float]) -> dict[str, float]:
    p50, p99 = (round(float(p), 4) for p in np.percentile(times, [50, 99]))
    return {"p50_ms": p50, "p99_ms": p99, "requests": len(times)}


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(8, 4))
    for offset, (who, percentile) in enumerate(
        (w, p) for w in ("echo", "server") for p in ("p50_ms", "p99_ms")
    ):
        places = [state + 0.2 * (offset - 1.5) for state in range(len(rows))]
        heights = [row[who][percentile] for row in rows]
        bars = axis.bar(places, heights, width=0.19, label=f"{who}, {percentile[:3]}")
        axis.bar_label(bars, fmt="%.2g", fontsize=7)
    axis.set_xticks(
        range(len(rows)), [f"{row['rendering']}\np50 ×{row['ratio_p50']}" for row in rows]
    )
    axis.set_yscale("log")
    axis.set_ylabel("round trip of get_viewport_size (ms)")
    axis.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--echo", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.echo:
        serve_echo()
        return
    floors: dict[str, list[float]] = defaultdict(list)
    times: dict[str, list[float]] = defaultdict(list)
    for _ in range(options.rounds):
        for state, arguments in STATES.items():
            floor, ours = measure(arguments, options.seconds)
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
