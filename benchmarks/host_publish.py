"""What does publishing an image cost a renderer, against copying the same bytes?

`bus.publish` flips the rows, clamps the colour, keeps NaN out, tells covered from empty pixels and
makes the image the newest. The floor, turn about in the same run, is `numpy.copyto` of the bytes
that end up in the slot, into memory that is mapped already. A client has the memory open and holds
an image, as one that draws it does.

    python -m benchmarks host_publish [--size 1920x1080] [--rounds 60]

writes `benchmarks/results/host_publish.json` and `host_publish.png`.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import splatbus_server

from benchmarks.round_trip import RESULTS, watched


def images(width: int, height: int) -> dict[str, tuple[Any, Any, str]]:
    """Colour, depth and its kind, of what renderers give."""
    random = np.random.default_rng(1)
    rgba = random.random((height, width, 4), np.float32)
    depth = 1.0 + random.random((height, width), np.float32)
    rgb = np.ascontiguousarray(rgba[..., :3])
    planes = np.ascontiguousarray(rgb.transpose(2, 0, 1))
    return {
        "RGBA, depth": (rgba, depth, "linear"),
        "RGB, depth": (rgb, depth, "linear"),
        "RGB in planes, inverse depth, as 3DGS": (planes, 1.0 / depth, "inverse"),
    }


def timed(work: Callable[..., None], *arguments: Any, **named: Any) -> float:
    start = time.perf_counter()
    work(*arguments, **named)
    return (time.perf_counter() - start) * 1e3


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(8, 3.5))
    for offset, name in enumerate(("copyto_ms", "publish_ms")):
        places = [row + 0.4 * (offset - 0.5) for row in range(len(rows))]
        label = name.removesuffix("_ms")
        bars = axis.bar(places, [row[name] for row in rows], width=0.38, label=label)
        axis.bar_label(bars, fmt="%.3g", fontsize=8)
    labels = [f"{row['image']}\n×{row['ratio']}" for row in rows]
    axis.set_xticks(range(len(rows)), labels, fontsize=8)
    axis.set_ylabel("median (ms)")
    axis.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--rounds", type=int, default=60)
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    rows = []
    with splatbus_server.serve(width, height, readers=1, ipc_port=0, message_port=0) as bus:
        view = None
        with watched(bus.address.ipc_port):
            while view is None:
                view = bus.next_view(10.0)
            for name, (color, depth, kind) in images(width, height).items():
                source = np.ones((height, width, 5), np.float32)
                target = np.ones_like(source)
                times = []
                for _ in range(options.rounds):
                    floor = timed(np.copyto, target, source)
                    ours = timed(bus.publish, view, color, depth, depth_kind=kind)
                    times.append((ours, floor))
                ours, floor = (statistics.median(column) for column in zip(*times, strict=True))
                ratio = statistics.median(a / b for a, b in times)
                rows.append(
                    {
                        "image": name,
                        "publish_ms": round(ours, 3),
                        "copyto_ms": round(floor, 3),
                        "ratio": round(ratio, 2),
                    }
                )
                print(f"{name}: {ours:.2f} ms, copyto {floor:.2f} ms, {ratio:.2f} times")
    report = {
        "command": f"python -m benchmarks host_publish --size {options.size}"
        f" --rounds {options.rounds}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
        "rows": rows,
    }
    draw(rows, RESULTS / "host_publish.png")
    (RESULTS / "host_publish.json").write_text(json.dumps(report, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
