"""What all benchmarks share: other processes, times beside a floor, results and pictures."""

from __future__ import annotations

import argparse
import gc
import json
import os
import platform
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
Work = Callable[[], object]
Child = subprocess.Popen[str]


def processor_ms(work: Work) -> float:
    """Milliseconds that all threads of this process take."""
    begin = time.process_time()
    work()
    return 1e3 * (time.process_time() - begin)


def wall_ms(work: Work) -> float:
    """Milliseconds that pass."""
    begin = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - begin)


class Beside(NamedTuple):
    """What work and its floor took in each round, in the same unit."""

    taken: list[float]
    floor: list[float]

    def ratio(self) -> list[float]:
        """Lower quartile, median and upper quartile of the rounds' ratios."""
        return quartiles(np.divide(self.taken, self.floor))


def beside(
    floor: Work, works: Sequence[Work], rounds: int, timed: Callable[[Work], float] = processor_ms
) -> list[Beside]:
    """Times of all works; the floor runs just before each, so that both see the same machine."""
    found = [Beside([], []) for _ in works]
    for work in (floor, *works):
        work()
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for work, times in zip(works, found, strict=True):
                times.floor.append(timed(floor))
                times.taken.append(timed(work))
    finally:
        gc.enable()
    return found


def quartiles(values: Any) -> list[float]:
    """Lower quartile, median, upper quartile."""
    return [float(each) for each in np.quantile(values, (0.25, 0.5, 0.75))]


def percentiles(times: Sequence[float]) -> dict[str, float]:
    """Of milliseconds the middle one, the 99th of a hundred, and how many there are."""
    p50, p99 = (round(float(each), 4) for each in np.percentile(times, (50, 99)))
    return {"p50_ms": p50, "p99_ms": p99, "times": len(times)}


def trips(rows: Sequence[Any], who: Sequence[str]) -> dict[str, list[float]]:
    """Of rows of percentiles, in milliseconds, what is drawn."""
    return {
        f"{each}, {percentile[:3]}": [row[each][percentile] for row in rows]
        for each in who
        for percentile in ("p50_ms", "p99_ms")
    }


@contextmanager
def python(*arguments: object, log: int | None = subprocess.DEVNULL) -> Iterator[Child]:
    """Python with these arguments in a process of its own, which is told to end at last."""
    command, pipe = [sys.executable, *map(str, arguments)], subprocess.PIPE
    with subprocess.Popen(
        command, cwd=ROOT, text=True, stdin=pipe, stdout=pipe, stderr=log
    ) as process:
        try:
            yield process
        finally:
            process.terminate()


def calling(module: str, function: str, *arguments: Any) -> AbstractContextManager[Child]:
    """A function of ours in a process of its own; a server of it leaves no memory behind."""
    ends = "import signal, sys; signal.signal(signal.SIGTERM, lambda *_: sys.exit())"
    called = f"from benchmarks.{module} import {function}; {function}(*{arguments!r})"
    return python("-c", f"{ends}; {called}", log=None)


def heard(process: Child) -> str:
    """The next line that a process prints."""
    assert process.stdout
    return process.stdout.readline()


def ports(server: Child) -> tuple[int, int]:
    """Where a command listens that has just begun: its IPC and its message port."""
    match = re.search(r"IPC port (\d+), message port (\d+)", heard(server))
    assert match
    return int(match[1]), int(match[2])


def packet(message: dict[str, Any] | bytes) -> bytes:
    """A message behind its length."""
    payload = message if isinstance(message, bytes) else json.dumps(message).encode()
    return len(payload).to_bytes(4, "little") + payload


def hello(*capabilities: str, token: str = "") -> bytes:
    """As a client of 1.1 says it."""
    said: dict[str, Any] = {"type": "hello", "versions": ["1.1"], "capabilities": capabilities}
    said |= {"client": {"name": "benchmark", "version": "1"}}
    return packet(said | ({"token": token} if token else {}))


@contextmanager
def watched(ipc_port: int, memory: str = "host_shm") -> Iterator[None]:
    """A client that has the memory open, and so lets the server render; it never reads."""
    with socket.create_connection(("127.0.0.1", ipc_port), timeout=10) as client:
        client.sendall(hello(memory, "frames"))
        received = b""
        while b"welcome" not in received:
            received += client.recv(65536)
        client.sendall(packet({"type": "opened", "generation": 1}))
        yield


@contextmanager
def seen(width: int, height: int, memory: Any = "host_shm", **options: Any) -> Iterator[Any]:
    """A server in this process, and what a client that has its memory open asks it for."""
    import splatbus_server

    options |= {"memory": memory, "ipc_port": 0, "message_port": 0, "readers": 1}
    with (
        splatbus_server.serve(width, height, **options) as bus,
        watched(bus.address.ipc_port, memory),
    ):
        view = bus.next_view(10.0)
        assert view is not None
        while "legacy" in view.wants:  # as long as the client has not said hello
            view = bus.next_view(0.1, contents_changed=True) or view
        yield bus, view


def size(text: str) -> tuple[int, int]:
    """Width and height of an image, as `1920x1080`."""
    width, height = map(int, text.split("x"))
    return width, height


def options(about: str | None, **defaults: Any) -> argparse.Namespace:
    """What the command was given: an option for each of these, a size for `size`."""
    parser = argparse.ArgumentParser(
        description=about, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default in defaults.items():
        kind = size if name == "size" else type(default)
        parser.add_argument(f"--{name}", type=kind, default=default)
    return parser.parse_args()


def write(program: str, report: Mapping[str, Any], name: str = "") -> None:
    """`results/NAME.json`, or that of the program, with the command and what it ran on."""
    about = {
        "command": " ".join(["python -m benchmarks", program, *sys.argv[1:]]),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
    }
    text = json.dumps(about | dict(report), indent=1, ensure_ascii=False, allow_nan=False)
    (RESULTS / f"{name or program}.json").write_text(text + "\n", "utf-8")


def told(row: dict[str, Any]) -> dict[str, Any]:
    """The row, once it is printed."""
    print(", ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    return row


def panels(*shape: int, **options: Any) -> tuple[Any, Any]:
    """A figure and its axes, of matplotlib; what only measures goes without it."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt.subplots(*shape, layout="constrained", **options)


def save(figure: Any, name: str) -> None:
    """`results/NAME.png`, with a palette, since a plot then takes a third of the bytes."""
    from PIL import Image

    drawn = BytesIO()
    figure.savefig(drawn, dpi=100)
    few = Image.open(drawn).convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=1)
    few.save(RESULTS / f"{name}.png", optimize=True)


class Bars(NamedTuple):
    """One panel: groups of bars, one of each series in each group, and lines for goals."""

    title: str
    groups: Sequence[str]
    series: Mapping[str, Sequence[float]]
    goals: Sequence[float] = ()


def draw_bars(name: str, shown: Sequence[Bars], scale: str = "linear") -> None:
    """`results/NAME.png` of panels side by side, each bar with its number."""
    figure, axes = panels(1, len(shown), figsize=(1.5 + 4.5 * len(shown), 4.2), squeeze=False)
    for axis, panel in zip(axes[0], shown, strict=True):
        width = 0.8 / len(panel.series)
        for number, (label, heights) in enumerate(panel.series.items()):
            places = np.arange(len(heights)) + width * (number - (len(panel.series) - 1) / 2)
            bars = axis.bar(places, heights, 0.95 * width, label=label)
            axis.bar_label(bars, fmt="%.3g", fontsize=7)
        for goal in panel.goals:
            axis.axhline(goal, color="black", linestyle=":", label=f"goal {goal:g}")
        axis.set_xticks(range(len(panel.groups)), panel.groups, fontsize=8)
        axis.set(title=panel.title, yscale=scale)
        axis.legend(fontsize=8)
    save(figure, name)
