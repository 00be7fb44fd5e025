"""What does publishing an image cost a renderer, against copying the same bytes?

`bus.publish` flips the rows, clamps the colour, keeps NaN out, turns accumulated depth into depth,
tells covered from empty pixels and makes the image the newest. The floor, turn about in the same
run, is `numpy.copyto` of the bytes that end up in the slot, into the slot. Both ways are measured,
NumPy's and the compiled one, if Numba is installed, for every layout that renderers give, a third
of the pixels empty. A client has the memory open, as one that draws images does.

Times are the processor's for this thread, and the lower quartile of all rounds: what else runs on a
machine adds to them, and the very best is luck. Ratios are of these.

    python -m benchmarks host_publish [--size 1920x1080] [--rounds 40]

writes `benchmarks/results/host_publish.json` and `host_publish.png`.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import splatbus_server
from splatbus_server import publish

from benchmarks._pictures import pyplot, save
from benchmarks.round_trip import RESULTS, watched

GOALS = {"numpy": 3.0, "compiled": 1.3}
KINDS = ("linear", "inverse", "accumulated")


class Given(NamedTuple):
    """What a renderer gives; alpha is None where it is in the colour, or not given."""

    layout: str
    numbers: str
    depth_kind: str
    color: Any
    depth: Any
    alpha: Any


def images(width: int, height: int) -> Iterator[Given]:
    random = np.random.default_rng(1)
    rgba = random.uniform(-0.1, 1.1, (height, width, 4)).astype(np.float32)
    rgba[..., 3] = np.maximum(random.uniform(-0.5, 1.0, (height, width)), 0.0)
    depth = random.uniform(1.0, 9.0, (height, width)).astype(np.float32)
    for number in (np.float32, np.float16):
        pixels = rgba.astype(number)
        planes = np.ascontiguousarray(pixels.transpose(2, 0, 1))
        rgb = np.ascontiguousarray(pixels[..., :3])
        alpha = np.ascontiguousarray(planes[3])
        for layout, color, beside in (
            ("RGBA", pixels, None),
            ("RGB", rgb, None),
            ("RGB + alpha", rgb, alpha),
            ("RGBA planes", planes, None),
            ("RGB planes", planes[:3], None),
            ("RGB planes + alpha", planes[:3], alpha),
        ):
            for kind in KINDS:
                yield Given(layout, number.__name__, kind, color, depth.astype(number), beside)
    rgba[random.random((height, width)) < 1e-3] = np.nan
    yield Given("RGBA, some NaN", "float32", "linear", rgba, depth, None)


def timed(work: Callable[..., None], *arguments: Any, **named: Any) -> float:
    start = time.thread_time()
    work(*arguments, **named)
    return (time.thread_time() - start) * 1e3


def lower_quartile(times: list[float]) -> float:
    return sorted(times)[len(times) // 4]


def measure(width: int, height: int, rounds: int) -> list[dict[str, Any]]:
    rows = []
    random = np.random.default_rng(2)
    color = random.random((height, width, 4), np.float32)
    depth = random.random((height, width), np.float32)
    with splatbus_server.serve(width, height, readers=1, ipc_port=0, message_port=0) as bus:
        memory: Any = bus._exchange.memory
        ways = {"numpy": None, "compiled": publish._compiled()}
        if ways["compiled"] is None:
            del ways["compiled"]

        def copy() -> None:
            np.copyto(memory.color(0), color)
            np.copyto(memory.depth(0), depth)

        with watched(bus.address.ipc_port):
            view = None
            while view is None:
                view = bus.next_view(10.0)
            for given in images(width, height):
                times: dict[str, list[float]] = {"copyto": [], **{way: [] for way in ways}}
                for _ in range(rounds):
                    times["copyto"].append(timed(copy))
                    for way, module in ways.items():
                        memory.publisher._compiled = module
                        named = {"alpha": given.alpha, "depth_kind": given.depth_kind}
                        times[way].append(
                            timed(bus.publish, view, given.color, given.depth, **named)
                        )
                usual = {way: lower_quartile(column) for way, column in times.items()}
                row = {
                    **dict(zip(Given._fields[:3], given[:3], strict=True)),
                    **{f"{way}_ms": round(value, 3) for way, value in usual.items()},
                    **{f"{way}_ratio": round(usual[way] / usual["copyto"], 2) for way in ways},
                }
                print(", ".join(f"{key} {value}" for key, value in row.items()), flush=True)
                rows.append(row)
    return rows


def draw(rows: list[dict[str, Any]], ways: list[str], path: Any) -> None:
    """The worst kind of depth for each layout."""
    plt = pyplot()
    figure, axes = plt.subplots(1, 2, figsize=(11, 4), sharey=True, width_ratios=(7, 6))
    for axis, numbers in zip(axes, ("float32", "float16"), strict=True):
        chosen = [row for row in rows if row["numbers"] == numbers]
        layouts = list(dict.fromkeys(row["layout"] for row in chosen))
        for offset, way in enumerate(ways):
            worst = [
                max(row[f"{way}_ratio"] for row in chosen if row["layout"] == layout)
                for layout in layouts
            ]
            places = [place + 0.4 * (offset - 0.5) for place in range(len(layouts))]
            bars = axis.bar(places, worst, width=0.38, label=way, color=f"C{offset}")
            axis.bar_label(bars, fmt="%.3g", fontsize=8)
            axis.axhline(GOALS[way], color=f"C{offset}", linestyle=":", linewidth=1)
        labels = [layout.replace(" ", "\n") for layout in layouts]
        axis.set_xticks(range(len(layouts)), labels, fontsize=8)
        axis.set_title(numbers, fontsize=10)
    axes[0].set_ylabel("time / numpy.copyto of the same bytes")
    axes[0].legend(loc="upper left", fontsize=8)
    figure.tight_layout()
    save(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--rounds", type=int, default=40)
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    rows = measure(width, height, options.rounds)
    ways = [way for way in GOALS if f"{way}_ms" in rows[0]]
    report = {
        "command": f"python -m benchmarks host_publish --size {options.size}"
        f" --rounds {options.rounds}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": __import__("numba").__version__ if "compiled" in ways else None,
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
        "worst": {
            numbers: {
                way: max(row[f"{way}_ratio"] for row in rows if row["numbers"] == numbers)
                for way in ways
            }
            for numbers in ("float32", "float16")
        },
        "rows": rows,
    }
    draw(rows, ways, RESULTS / "host_publish.png")
    (RESULTS / "host_publish.json").write_text(json.dumps(report, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
