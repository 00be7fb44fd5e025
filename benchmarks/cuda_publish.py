"""What does publishing an image on a GPU cost, against a device-to-device copy of its bytes?

Three figures for each layout of the source and each size, all of a server with a client that has
the memory open and holds an image:

- `gpu`: the kernel alone, in a queue that is never empty, and, as `gpu_with_event`, with the record
  of the slot's event behind it, against a copy with one like it;
- `wall`: from the call of `bus.publish` until the GPU is done with it, one after the other;
- `loop`: time per call of many in a row, as in a render loop that never waits.

The floor, turn about in the same run, is `cuMemcpyDtoDAsync` of the bytes that end up in the slot
(20 a pixel), in the same ways, without an event in `wall` and `loop`. Sources and targets rotate,
so that no cache holds them.

    python -m benchmarks cuda_publish [--rounds 15]
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from itertools import count as numbers
from typing import Any

from benchmarks import _cuda, _shared
from benchmarks._cuda import Device, api
from benchmarks._shared import Bars, Work

GPU_GOAL, WALL_GOAL = 1.05, 1.15
QUEUED = 40


def sources(width: int, height: int, count: int) -> dict[str, list[tuple[Any, dict[str, Any]]]]:
    """Of each layout, some images: colour, and what else `publish` is given."""
    import torch  # type: ignore[import-not-found,unused-ignore]

    def image(*shape: int) -> Any:
        return torch.rand(*shape, device="cuda")

    found: dict[str, list[tuple[Any, dict[str, Any]]]] = {}
    for _ in range(count):
        rgba, depth = image(height, width, 4), image(height, width) + 0.5
        alpha, planes = image(height, width), rgba.permute(2, 0, 1).contiguous()
        inverse = {"depth": depth, "alpha": alpha, "depth_kind": "inverse"}
        accumulated = {"depth": rgba[..., 3], "alpha": alpha, "depth_kind": "accumulated"}
        for layout, color, others in (
            ("RGBA", rgba, {"depth": depth}),
            ("RGB", rgba[..., :3].contiguous(), {"depth": depth}),
            ("planes RGBA", planes, {"depth": depth}),
            ("planes RGB, 1/z, alpha", planes[:3], inverse),
            ("RGBD in one, alpha (gsplat)", rgba[..., :3], accumulated),
            ("RGBA, float16", rgba.half(), {"depth": depth.half()}),
        ):
            found.setdefault(layout, []).append((color, others))
    return found


def gpu_us(work: Work) -> float:
    """Microseconds on the GPU of one piece of work among many that wait in its queue."""
    import torch  # type: ignore[import-not-found,unused-ignore]

    begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
    torch.cuda.synchronize()
    torch.cuda._sleep(4_000_000)  # 2 ms, in which all the rest is queued
    begin.record()
    for _ in range(QUEUED):
        work()
    end.record()
    torch.cuda.synchronize()
    return float(begin.elapsed_time(end) / QUEUED * 1e3)


def wall_us(work: Work) -> float:
    return statistics.median(1e3 * _cuda.synchronised(work) for _ in range(QUEUED))


def loop_us(work: Work) -> float:
    def loop() -> None:
        for _ in range(4 * QUEUED):
            work()

    return 1e3 * _cuda.synchronised(loop) / (4 * QUEUED)


WAYS = {"gpu": gpu_us, "gpu_with_event": gpu_us, "wall": wall_us, "loop": loop_us}


def in_turn(does: Callable[[int], object]) -> Work:
    """A call that is told how many were before."""
    number = numbers()
    return lambda: does(next(number))


def measure(width: int, height: int, rounds: int) -> list[dict[str, Any]]:
    import torch  # type: ignore[import-not-found,unused-ignore]
    from splatbus_server.cuda import launching
    from splatbus_server.cuda.driver import interprocess_event

    with Device(0).current():
        event = interprocess_event()
    count = 2 if width > 4000 else 6
    size = _cuda.PIXEL_BYTES * width * height
    copies = [torch.empty(2, size // 4, device="cuda").uniform_() for _ in range(count)]
    pointers = [(copy[0].data_ptr(), copy[1].data_ptr()) for copy in copies]

    def copy(number: int) -> None:
        target, source = pointers[number % count]
        api.cuMemcpyDtoDAsync(target, source, size, 0)

    def copy_and_record(number: int) -> None:
        copy(number)
        api.cuEventRecord(event, 0)

    floors = {"gpu": copy, "gpu_with_event": copy_and_record, "wall": copy, "loop": copy}
    rows = []
    with _shared.seen(width, height, "cuda_ipc") as (bus, view):
        memory: Any = bus._exchange.memory
        for name, images in sources(width, height, count).items():
            fills = [
                memory.writer(c, o["depth"], o.get("alpha"), o.get("depth_kind", "linear"), None)
                for c, o in images
            ]

            def write_only(number: int, fills: Any = fills) -> None:
                fills[number % count](number % memory.ring.slots, view.wants)

            def kernel(number: int, write: Callable[[int], None] = write_only) -> None:
                record, launching.record = launching.record, lambda *_: 0  # type: ignore[assignment]
                try:
                    write(number)
                finally:
                    launching.record = record

            def publish(number: int, images: Any = images) -> None:
                color, others = images[number % count]
                bus.publish(view, color, **others)

            for number in range(3 * QUEUED):  # compiles, and wakes the machine
                publish(number)
            ours = {"gpu": kernel, "gpu_with_event": write_only, "wall": publish, "loop": publish}
            row: dict[str, Any] = {"layout": name, "width": width, "height": height}
            for way, timed in WAYS.items():
                floor, work = in_turn(floors[way]), in_turn(ours[way])
                (times,) = _shared.beside(floor, [work], rounds, timed)
                row[way] = {
                    "publish_us": round(statistics.median(times.taken), 2),
                    "copy_us": round(statistics.median(times.floor), 2),
                    "ratio": round(times.ratio()[1], 3),
                }
            rows.append(_shared.told(row))
    return rows


def draw(rows: list[dict[str, Any]]) -> None:
    layouts = dict.fromkeys(row["layout"] for row in rows)
    titles = {"gpu": "on the GPU", "wall": "call to done", "loop": "render loop, no wait"}
    shown = []
    for way, title in titles.items():
        ratios = {
            each: [row[way]["ratio"] for row in rows if row["layout"] == each] for each in layouts
        }
        goal = GPU_GOAL if way == "gpu" else WALL_GOAL
        shown.append(Bars(f"{title}, of a device copy", list(_cuda.SIZES), ratios, [goal]))
    _shared.draw_bars("cuda_publish", shown)


def main() -> None:
    options = _shared.options(__doc__, rounds=15)
    _cuda.require_gpu("torch")
    rows = [row for size in _cuda.SIZES.values() for row in measure(*size, options.rounds)]
    _cuda.write("cuda_publish", {"goals": {"gpu": GPU_GOAL, "wall": WALL_GOAL}, "rows": rows})
    draw(rows)


if __name__ == "__main__":
    main()
