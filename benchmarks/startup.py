"""How long from starting a server to the first image that a client has read?

Each round starts `splatbus-server` (320×240), waits for its ready line, connects, says hello, maps
the memory, and copies the colour and depth of the first frame. The floor is a Python process that
imports NumPy and prints a line. The last figure is a client that finds the server running: from
connect to the copy of its first frame.

    python -m benchmarks startup [--rounds 10]

writes `benchmarks/results/startup.json` and `startup.png`.
"""

from __future__ import annotations

import argparse
import json
import mmap
import os
import platform
import socket
import statistics
import time
from pathlib import Path
from typing import Any

from benchmarks.round_trip import HELLO, RESULTS, packet, process, server


def receive(client: socket.socket, buffer: bytearray) -> dict[str, Any]:
    while len(buffer) < 4 or len(buffer) < 4 + int.from_bytes(buffer[:4], "little"):
        data = client.recv(65536)
        assert data
        buffer += data
    end = 4 + int.from_bytes(buffer[:4], "little")
    message: dict[str, Any] = json.loads(buffer[4:end])
    del buffer[:end]
    return message


def read_first_frame(ipc_port: int) -> int:
    """Bytes of colour and depth that were copied."""
    buffer = bytearray()
    with socket.create_connection(("127.0.0.1", ipc_port), timeout=10) as client:
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.sendall(packet(HELLO))
        assert receive(client, buffer)["type"] == "welcome"
        init = receive(client, buffer)
        with (Path("/dev/shm") / init["memory"]["name"]).open("rb") as file:
            memory = mmap.mmap(file.fileno(), init["memory"]["bytes"], access=mmap.ACCESS_READ)
        client.sendall(packet({"type": "opened", "generation": init["generation"]}))
        frame = receive(client, buffer)
        pixels, ring = init["meta"]["w"] * init["meta"]["h"], init["ring"]
        copied = 0
        for what, size in ("color", 16), ("depth", 4):
            start = ring[f"{what}Offset"] + frame["slot"] * ring[f"{what}Stride"]
            copied += len(memory[start : start + size * pixels])
        return copied


def measure() -> dict[str, float]:
    """Milliseconds of one round."""
    start = time.perf_counter()
    with process("-c", "import numpy; print()"):
        floor = time.perf_counter()
    start_server = time.perf_counter()
    with server(()) as (ipc_port, _):
        ready = time.perf_counter()
        read_first_frame(ipc_port)
        first = time.perf_counter()
        read_first_frame(ipc_port)
        second = time.perf_counter()
    return {
        "python_and_numpy_floor": (floor - start) * 1e3,
        "start_to_ready": (ready - start_server) * 1e3,
        "start_to_first_frame_read": (first - start_server) * 1e3,
        "connect_to_first_frame_read": (second - first) * 1e3,
    }


def draw(milliseconds: dict[str, dict[str, float]], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(8, 2.5))
    names = [name.replace("_", " ") for name in reversed(milliseconds)]
    bars = axis.barh(names, [times["median"] for times in reversed(milliseconds.values())])
    axis.bar_label(bars, fmt="%.4g ms", fontsize=8)
    axis.set_xlabel("median (ms)")
    axis.margins(x=0.12)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=10)
    options = parser.parse_args()
    rounds = [measure() for _ in range(options.rounds)]
    milliseconds = {
        name: {
            "median": round(statistics.median(times), 2),
            "min": round(min(times), 2),
            "max": round(max(times), 2),
        }
        for name in rounds[0]
        if (times := [r[name] for r in rounds])
    }
    ratio = statistics.median(
        r["start_to_first_frame_read"] / r["python_and_numpy_floor"] for r in rounds
    )
    report = {
        "command": f"python -m benchmarks startup --rounds {options.rounds}",
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
        "size": [320, 240],
        "milliseconds": milliseconds,
        "start_to_first_frame_read_over_floor": round(ratio, 2),
    }
    (RESULTS / "startup.json").write_text(json.dumps(report, indent=1) + "\n", "utf-8")
    draw(milliseconds, RESULTS / "startup.png")
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
