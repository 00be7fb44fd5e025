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

import argparse
import socket
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from benchmarks._cuda import PIXEL_BYTES, RESULTS, SIZES, require_gpu, write
from benchmarks._pictures import pyplot, save
from benchmarks.round_trip import HELLO, packet

GPU_GOAL, WALL_GOAL = 1.05, 1.15
QUEUED = 40
Call = Callable[[int], Any]


@contextmanager
def watched(ipc_port: int) -> Iterator[None]:
    """A client that has the memory open, and so lets the server render; it never reads."""
    hello = HELLO | {"capabilities": ["cuda_ipc", "frames"]}
    with socket.create_connection(("127.0.0.1", ipc_port), timeout=10) as client:
        client.sendall(packet(hello))
        received = b""
        while b"welcome" not in received:
            received += client.recv(65536)
        client.sendall(packet({"type": "opened", "generation": 1}))
        yield


def sources(width: int, height: int, count: int) -> dict[str, list[tuple[Any, dict[str, Any]]]]:
    """Of each layout, some images: colour, and what else `publish` is given."""
    import torch

    def image(*shape: int) -> Any:
        return torch.rand(*shape, device="cuda")

    rgba = [image(height, width, 4) for _ in range(count)]
    depth = [image(height, width) + 0.5 for _ in range(count)]
    alpha = [image(height, width) for _ in range(count)]
    planes = [c.permute(2, 0, 1).contiguous() for c in rgba]
    return {
        "RGBA": [(c, {"depth": d}) for c, d in zip(rgba, depth, strict=True)],
        "RGB": [(c[..., :3].contiguous(), {"depth": d}) for c, d in zip(rgba, depth, strict=True)],
        "planes RGBA": [(c, {"depth": d}) for c, d in zip(planes, depth, strict=True)],
        "planes RGB, 1/z, alpha": [
            (c[:3], {"depth": d, "alpha": a, "depth_kind": "inverse"})
            for c, d, a in zip(planes, depth, alpha, strict=True)
        ],
        "RGBD in one, alpha (gsplat)": [
            (c[..., :3], {"depth": c[..., 3], "alpha": a, "depth_kind": "accumulated"})
            for c, a in zip(rgba, alpha, strict=True)
        ],
        "RGBA, float16": [
            (c.half(), {"depth": d.half()}) for c, d in zip(rgba, depth, strict=True)
        ],
    }


def gpu_us(work: Call) -> float:
    """Microseconds on the GPU of one piece of work among many that wait in its queue."""
    import torch

    begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
    torch.cuda.synchronize()
    torch.cuda._sleep(4_000_000)  # 2 ms, in which all the rest is queued
    begin.record()
    for number in range(QUEUED):
        work(number)
    end.record()
    torch.cuda.synchronize()
    return begin.elapsed_time(end) / QUEUED * 1e3


def wall_us(work: Call) -> float:
    import torch

    times = []
    stream = torch.cuda.current_stream()
    for number in range(QUEUED):
        start = time.perf_counter()
        work(number)
        stream.synchronize()
        times.append((time.perf_counter() - start) * 1e6)
    return statistics.median(times)


def loop_us(work: Call) -> float:
    import torch

    torch.cuda.synchronize()
    start = time.perf_counter()
    for number in range(4 * QUEUED):
        work(number)
    torch.cuda.synchronize()
    return (time.perf_counter() - start) / (4 * QUEUED) * 1e6


WAYS = {"gpu": gpu_us, "gpu_with_event": gpu_us, "wall": wall_us, "loop": loop_us}


def measure(width: int, height: int, rounds: int) -> list[dict[str, Any]]:
    import splatbus_server
    import torch
    from splatbus_server.cuda import launching
    from splatbus_server.cuda.driver import Device, api, interprocess_event

    with Device(0).current():
        event = interprocess_event()
    count = 2 if width > 4000 else 6
    size = PIXEL_BYTES * width * height
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
    options = {"memory": "cuda_ipc", "ipc_port": 0, "message_port": 0, "readers": 1}
    with (
        splatbus_server.serve(width, height, **options) as bus,
        watched(bus.address.ipc_port),
    ):
        view = bus.next_view(10.0)
        assert view is not None
        while "legacy" in view.wants:  # as long as the client has not said hello
            view = bus.next_view(0.1, contents_changed=True) or view
        memory: Any = bus._exchange.memory
        for name, images in sources(width, height, count).items():
            color, others = images[0]
            for _ in range(3 * QUEUED):  # compiles, and wakes the machine
                bus.publish(view, color, **others)
            fills = [
                memory.writer(c, o["depth"], o.get("alpha"), o.get("depth_kind", "linear"), None)
                for c, o in images
            ]

            def write_only(number: int, fills: Any = fills) -> None:
                fills[number % count](number % memory.ring.slots, view.wants)

            def kernel(number: int, fills: Any = fills, write: Call = write_only) -> None:
                record, launching.record = launching.record, lambda *_: 0
                try:
                    write(number)
                finally:
                    launching.record = record

            def publish(number: int, images: Any = images) -> None:
                color, others = images[number % count]
                bus.publish(view, color, **others)

            ours = {"gpu": kernel, "gpu_with_event": write_only, "wall": publish, "loop": publish}
            row: dict[str, Any] = {"layout": name, "width": width, "height": height}
            for way, timed in WAYS.items():
                pairs = [(timed(ours[way]), timed(floors[way])) for _ in range(rounds)]
                row[way] = {
                    "publish_us": round(statistics.median(a for a, _ in pairs), 2),
                    "copy_us": round(statistics.median(b for _, b in pairs), 2),
                    "ratio": round(statistics.median(a / b for a, b in pairs), 3),
                }
            rows.append(row)
            print(
                f"{width}×{height} {name}: "
                + ", ".join(
                    f"{way} {row[way]['publish_us']} µs ×{row[way]['ratio']}" for way in WAYS
                ),
                flush=True,
            )
    return rows


def draw(rows: list[dict[str, Any]], gpu: str) -> None:
    plt = pyplot()
    layouts = list(dict.fromkeys(row["layout"] for row in rows))
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.6), sharey=True)
    titles = {"gpu": "on the GPU", "wall": "call to done", "loop": "render loop, no wait"}
    for axis, (way, title) in zip(axes, titles.items(), strict=True):
        for at, layout in enumerate(layouts):
            found = [row for row in rows if row["layout"] == layout]
            heights = [row[way]["ratio"] for row in found]
            places = [size + 0.13 * (at - 2.5) for size in range(len(found))]
            axis.bar(places, heights, width=0.12, label=layout)
        goal = GPU_GOAL if way == "gpu" else WALL_GOAL
        axis.axhline(goal, color="black", linewidth=0.8, linestyle="--")
        axis.axhline(1.0, color="black", linewidth=0.8)
        axis.text(3.55, goal + 0.01, f"goal {goal}", ha="right", fontsize=8)
        found = [row for row in rows if row["layout"] == layouts[0]]
        labels = [
            f"{size}\ncopy {row[way]['copy_us']:.0f} µs"
            for size, row in zip(SIZES, found, strict=False)
        ]
        axis.set_xticks(range(len(found)), labels, fontsize=8)
        axis.set_title(title, fontsize=10)
    axes[0].set_ylabel("publish ÷ device copy of the image")
    figure.legend(
        *axes[0].get_legend_handles_labels(), fontsize=8, loc="lower center", ncols=len(layouts)
    )
    figure.suptitle(f"Publishing an image on an {gpu}", fontsize=11)
    figure.tight_layout(rect=(0.0, 0.06, 1.0, 1.0))
    save(figure, RESULTS / "cuda_publish.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args()
    require_gpu("torch")
    rows = [row for size in SIZES.values() for row in measure(*size, options.rounds)]
    write("cuda_publish", {"goals": {"gpu": GPU_GOAL, "wall": WALL_GOAL}, "rows": rows})
    from benchmarks._cuda import machine

    draw(rows, machine()["gpu"])


if __name__ == "__main__":
    main()
