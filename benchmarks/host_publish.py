"""What does publishing an image cost a renderer, against copying the same bytes?

`bus.publish` flips the rows, clamps the colour, keeps NaN out, turns accumulated depth into depth,
tells covered from empty pixels and makes the image the newest. The floor, turn about in the same
run, is `numpy.copyto` of the bytes that end up in the slot, into the slot. Both ways are measured,
NumPy's and the compiled one, if Numba is installed, for every layout that renderers give, a third
of the pixels empty. A client has the memory open, as one that draws images does.

Times are the processor's for this thread, and the lower quartile of all rounds: what else runs on a
machine adds to them, and the very best is luck. Ratios are of these.

    python -m benchmarks host_publish [--size 1920x1080] [--rounds 40]
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from splatbus_server import publish

from benchmarks import _shared

GOALS = {"numpy": 3.0, "compiled": 1.3}
NUMBERS = ("float32", "float16")


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
    for numbers in NUMBERS:
        pixels = rgba.astype(numbers)
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
            for kind in ("linear", "inverse", "accumulated"):
                yield Given(layout, numbers, kind, color, depth.astype(numbers), beside)
    rgba[random.random((height, width)) < 1e-3] = np.nan
    yield Given("RGBA, some NaN", "float32", "linear", rgba, depth, None)


def thread_ms(work: _shared.Work) -> float:
    """Milliseconds that this thread takes."""
    start = time.thread_time()
    work()
    return (time.thread_time() - start) * 1e3


def measure(size: tuple[int, int], rounds: int) -> list[dict[str, Any]]:
    rows, (width, height) = [], size
    random = np.random.default_rng(2)
    color = random.random((height, width, 4), np.float32)
    depth = random.random((height, width), np.float32)
    modules = {"numpy": None, "compiled": publish._compiled()}
    ways = [way for way in modules if way == "numpy" or modules[way]]
    with _shared.seen(width, height) as (bus, view):
        memory: Any = bus._exchange.memory

        def copy() -> None:
            np.copyto(memory.color(0), color)
            np.copyto(memory.depth(0), depth)

        def published(given: Given, way: str) -> None:
            memory.publisher._compiled = modules[way]
            named = {"alpha": given.alpha, "depth_kind": given.depth_kind}
            bus.publish(view, given.color, given.depth, **named)

        for given in images(width, height):
            works = [partial(published, given, way) for way in ways]
            times = _shared.beside(copy, works, rounds, thread_ms)
            least = _shared.quartiles([each.floor for each in times])[0]
            row = dict(zip(Given._fields[:3], given[:3], strict=True)) | {"copyto_ms": least}
            for way, each in zip(ways, times, strict=True):
                taken = _shared.quartiles(each.taken)[0]
                row |= {f"{way}_ms": taken, f"{way}_ratio": round(taken / least, 2)}
            rows.append(_shared.told(row))
    return rows


def main() -> None:
    options = _shared.options(__doc__, size="1920x1080", rounds=40)
    rows = measure(options.size, options.rounds)
    ways = [way for way in GOALS if f"{way}_ms" in rows[0]]
    shown, worst = [], {}
    for numbers in NUMBERS:
        chosen = [row for row in rows if row["numbers"] == numbers]
        layouts = list(dict.fromkeys(row["layout"] for row in chosen))
        series = {
            way: [max(r[f"{way}_ratio"] for r in chosen if r["layout"] == it) for it in layouts]
            for way in ways
        }
        title = f"{numbers}: times numpy.copyto, the worst kind of depth"
        groups = [layout.replace(" ", "\n") for layout in layouts]
        shown.append(_shared.Bars(title, groups, series, [GOALS[way] for way in ways]))
        worst[numbers] = {way: max(each) for way, each in series.items()}
    _shared.write("host_publish", {"worst": worst, "rows": rows})
    _shared.draw_bars("host_publish", shown)


if __name__ == "__main__":
    main()
