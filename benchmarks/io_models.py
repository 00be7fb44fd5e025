"""Which way of doing socket I/O answers a request soonest beside a busy render loop?

One small length-prefixed JSON server, three models over the same ``answer`` function: a blocking
thread per connection, one ``selectors`` thread, asyncio in a thread. A blocking client in another
process measures the round trip while the server's main thread sleeps, while it renders in NumPy
(which lets go of the interpreter lock in every call), and while it renders in plain Python (which
never does: the worst case).
The floor, in the same run, is a blocking echo of the same bytes in a process of its own.

    python -m benchmarks.io_models [--seconds 1.5] [--rounds 3]

writes ``benchmarks/results/io_models.json`` and ``io_models.png``.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import platform
import selectors
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

RESULTS = Path(__file__).parent / "results"
REQUEST = json.dumps({"type": "get_viewport_size"}).encode()
HEADER = struct.Struct("<I")
FLOOR = "echo (floor)"
RENDER_SECONDS = 0.008
# (what the server's main thread does, switch interval in ms); 5 ms is Python's default
STATES = [
    ("idle", 5.0),
    ("numpy", 5.0),
    ("numpy", 0.5),
    ("python", 5.0),
    ("python", 0.5),
]


def framed(payload: bytes) -> bytes:
    return HEADER.pack(len(payload)) + payload


def answer(payload: bytes) -> bytes:
    message = json.loads(payload)
    assert message["type"] == "get_viewport_size"
    return framed(json.dumps({"viewport_size": [320, 240]}).encode())


def split(buffer: bytearray) -> Iterator[bytes]:
    """Takes whole payloads off the front of the buffer."""
    while len(buffer) >= HEADER.size:
        end = HEADER.size + HEADER.unpack_from(buffer)[0]
        if len(buffer) < end:
            return
        payload = bytes(buffer[HEADER.size : end])
        del buffer[:end]
        yield payload


def serve_threads(listener: socket.socket) -> None:
    def serve(connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        buffer = bytearray()
        while data := connection.recv(65536):
            buffer += data
            for payload in split(buffer):
                connection.sendall(answer(payload))

    while True:
        connection, _ = listener.accept()
        threading.Thread(target=serve, args=(connection,), daemon=True).start()


def serve_selectors(listener: socket.socket) -> None:
    selector = selectors.DefaultSelector()
    selector.register(listener, selectors.EVENT_READ)
    while True:
        for key, _ in selector.select():
            if key.fileobj is listener:
                connection, _ = listener.accept()
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                connection.setblocking(False)
                selector.register(connection, selectors.EVENT_READ, bytearray())
                continue
            connection = key.fileobj  # type: ignore[assignment]
            data = connection.recv(65536)
            if not data:
                selector.unregister(connection)
                connection.close()
                continue
            key.data.extend(data)
            for payload in split(key.data):
                connection.sendall(answer(payload))


def serve_asyncio(listener: socket.socket) -> None:
    class Replies(asyncio.Protocol):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            assert isinstance(transport, asyncio.Transport)
            self.transport = transport  # asyncio sets TCP_NODELAY by itself
            self.buffer = bytearray()

        def data_received(self, data: bytes) -> None:
            self.buffer += data
            for payload in split(self.buffer):
                self.transport.write(answer(payload))

    async def main() -> None:
        server = await asyncio.get_running_loop().create_server(Replies, sock=listener)
        await server.serve_forever()

    asyncio.run(main())


def serve_echo(listener: socket.socket) -> None:
    connection, _ = listener.accept()
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    while data := connection.recv(65536):
        connection.sendall(data)


MODELS: dict[str, Callable[[socket.socket], None]] = {
    "thread per connection": serve_threads,
    "selectors": serve_selectors,
    "asyncio": serve_asyncio,
    "echo": serve_echo,
}


def numpy_work() -> Callable[[], None]:
    depth = np.ones((240, 320), np.float32)
    scratch = np.empty_like(depth)

    def work() -> None:
        np.multiply(depth, 1.0001, out=scratch)
        np.sqrt(scratch, out=scratch)
        np.maximum(scratch, 0.5, out=scratch)

    return work


def python_work() -> Callable[[], None]:
    def work() -> None:
        total = 0
        for i in range(1000):
            total += i * i

    return work


def render_forever(work: Callable[[], None], frame_times: list[float]) -> None:
    """Repeats the work back to back, in iterations that take about 8 ms when undisturbed."""
    repeats = 0
    start = time.perf_counter()
    while time.perf_counter() - start < 0.5:
        work()
        repeats += 1
    repeats = max(1, round(repeats * RENDER_SECONDS / 0.5))
    while True:
        start = time.perf_counter()
        for _ in range(repeats):
            work()
        frame_times.append(time.perf_counter() - start)


def server_process(model: str, beside: str, switch_interval_ms: float) -> None:
    """Prints its port, serves until stdin closes, then prints its median frame time in ms."""
    sys.setswitchinterval(switch_interval_ms / 1e3)
    listener = socket.create_server(("127.0.0.1", 0))
    threading.Thread(target=MODELS[model], args=(listener,), daemon=True).start()
    frame_times: list[float] = []

    def leave_on_eof() -> None:
        sys.stdin.read()
        print(float(np.median(frame_times)) * 1e3 if frame_times else "nan", flush=True)
        os._exit(0)

    print(listener.getsockname()[1], flush=True)
    if beside != "idle":
        threading.Thread(target=leave_on_eof, daemon=True).start()
        render_forever(numpy_work() if beside == "numpy" else python_work(), frame_times)
    leave_on_eof()


@contextmanager
def server(model: str, beside: str, switch_interval_ms: float) -> Iterator[tuple[int, Any]]:
    command = [sys.executable, "-m", "benchmarks.io_models", "--serve", model]
    command += ["--beside", beside, "--switch-interval-ms", str(switch_interval_ms)]
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert child.stdin
    assert child.stdout
    try:
        yield int(child.stdout.readline()), child
    finally:
        child.kill()
        child.wait()


def round_trips(port: int, seconds: float) -> list[float]:
    """Round trip times in ms of back-to-back requests."""
    request = framed(REQUEST)
    times: list[float] = []
    with socket.create_connection(("127.0.0.1", port), timeout=10) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        end = time.perf_counter() + seconds
        while (start := time.perf_counter()) < end:
            connection.sendall(request)
            connection.recv(65536)
            times.append((time.perf_counter() - start) * 1e3)
    return times


def measure(
    model: str, beside: str, switch_interval_ms: float, seconds: float
) -> tuple[list[float], float]:
    """Round trips in ms, and the render loop's median frame time in ms (NaN when idle)."""
    with server(model, beside, switch_interval_ms) as (port, child):
        time.sleep(0.1 if beside == "idle" else 0.8)
        times = round_trips(port, seconds)
        frame_ms, _ = child.communicate("", timeout=10)
    return times, float(frame_ms)


def measure_floor(beside: str, seconds: float) -> list[float]:
    """A bare echo, where asked beside another process that renders and that nobody calls."""
    if beside == "idle":
        return measure("echo", "idle", 5.0, seconds)[0]
    with server("selectors", beside, 5.0):
        time.sleep(0.8)
        return measure("echo", "idle", 5.0, seconds)[0]


def summary(times: list[float]) -> dict[str, float | int]:
    p50, p99 = (round(float(p), 4) for p in np.percentile(times, [50, 99]))
    return {"p50_ms": p50, "p99_ms": p99, "requests": len(times)}


def run(seconds: float, rounds: int) -> list[dict[str, Any]]:
    """Every condition once a round, so that a disturbance of the machine touches all alike."""
    conditions = [(FLOOR, beside, 5.0) for beside in dict.fromkeys(b for b, _ in STATES)]
    conditions += [(model, *state) for model in MODELS if model != "echo" for state in STATES]
    times: dict[Any, list[float]] = {condition: [] for condition in conditions}
    frames: dict[Any, list[float]] = {condition: [] for condition in conditions}
    for _ in range(rounds):
        for condition in conditions:
            model, beside, _ = condition
            if model == FLOOR:
                times[condition] += measure_floor(beside, seconds)
                continue
            trips, frame_ms = measure(*condition, seconds)
            times[condition] += trips
            frames[condition].append(frame_ms)
    rows = []
    for condition in conditions:
        row = dict(zip(("model", "beside", "switch_interval_ms"), condition, strict=True))
        row |= summary(times[condition])
        if condition[1] != "idle" and frames[condition]:
            row["frame_ms"] = round(float(np.median(frames[condition])), 3)
        rows.append(row)
    return rows


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    models = list(dict.fromkeys(row["model"] for row in rows))
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), sharey=True)
    for axis, statistic in zip(axes, ("p50_ms", "p99_ms"), strict=True):
        for offset, state in enumerate(STATES):
            found = {
                row["model"]: row[statistic]
                for row in rows
                if (row["beside"], row["switch_interval_ms"]) == state
            }
            places = [m + 0.17 * (offset - 2) for m, name in enumerate(models) if name in found]
            label = "{}, switch interval {:g} ms".format(*state)
            bars = axis.bar(places, found.values(), width=0.16, label=label)
            axis.bar_label(bars, fmt="%.2g", fontsize=6)
        axis.set_xticks(range(len(models)), models, fontsize=7)
        axis.set_yscale("log")
        axis.set_title(f"round trip, {statistic[:3]} (ms)")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=3, loc="lower center", fontsize=7)
    figure.tight_layout(rect=(0, 0.1, 1, 1))
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=1.5)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--serve", choices=MODELS, help=argparse.SUPPRESS)
    parser.add_argument("--switch-interval-ms", type=float, default=5.0, help=argparse.SUPPRESS)
    parser.add_argument("--beside", default="idle", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        server_process(options.serve, options.beside, options.switch_interval_ms)
    rows = run(options.seconds, options.rounds)
    report = {
        "command": f"python -m benchmarks.io_models --seconds {options.seconds}"
        f" --rounds {options.rounds}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
        "rows": rows,
    }
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "io_models.json").write_text(json.dumps(report, indent=1) + "\n")
    draw(rows, RESULTS / "io_models.png")
    for row in rows:
        print(row)


if __name__ == "__main__":
    main()
