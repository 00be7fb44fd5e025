"""What does an image of Gaussians on a GPU cost, from a view until it is published?

Of made scenes with harmonics of degree 3, seen by a camera that turns, by a server with a client
that has the memory open:

- `ms`: from the view until the GPU is done with the published image, one after the other;
- `images_per_s`: of a render loop that waits for nothing but what gsplat waits for.

The floor, turn about in the same run, is one call of gsplat's `rasterization` of the same Gaussians
with the same harmonics and its own depth: what it takes is on the GPU beforehand, and nothing is
published.

    python -m benchmarks splats_gpu [--rounds 7]
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from benchmarks._cuda import require_gpu, write
from benchmarks.cuda_publish import watched

COUNTS = (100_000, 1_000_000)
SIZES = ((640, 480), (1920, 1080))
IMAGES = 60
"""Of a round; in one the camera turns by 30 degrees."""
Call = Callable[[Any], Any]


def turned(view: Any) -> list[Any]:
    """The view, with a camera that turns from left to right."""
    from splatbus_wire.poses import Pose

    angles = [math.radians(30.0 * (number / IMAGES - 0.5)) / 2.0 for number in range(IMAGES)]
    cameras = [Pose((0.0, 0.0, 0.0), (0.0, math.sin(a), 0.0, math.cos(a))) for a in angles]
    return [replace(view, poses=view.poses._replace(camera=each)) for each in cameras]


def alone(scene: Any) -> Call:
    """One call of gsplat for a view, with what it takes ready on the GPU."""
    import gsplat
    import torch

    quats = scene.rotations[:, [3, 0, 1, 2]]
    arrays = (scene.means, quats, scene.scales, scene.opacities, scene.coefficients)
    splats = [torch.tensor(each, device="cuda") for each in arrays]
    ready: dict[Any, tuple[Any, Any]] = {}

    def draw(view: Any) -> None:
        key = view.width, view.poses.camera
        if key not in ready:
            fx, fy, cx, cy, _, _ = view.intrinsics
            K = torch.tensor([[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]], device="cuda")
            ready[key] = torch.from_numpy(view.object_to_camera).float().cuda()[None], K
        gsplat.rasterization(
            *splats,
            *ready[key],
            view.width,
            view.height,
            sh_degree=scene.degree,
            render_mode="RGB+D",
            packed=False,
        )

    return draw


def each_ms(work: Call, views: list[Any]) -> float:
    """Milliseconds of one image, the GPU waited for after each."""
    import torch

    times = []
    for view in views:
        torch.cuda.synchronize()
        start = time.perf_counter()
        work(view)
        torch.cuda.synchronize()
        times.append((time.perf_counter() - start) * 1e3)
    return statistics.median(times)


def images_per_s(work: Call, views: list[Any]) -> float:
    import torch

    torch.cuda.synchronize()
    start = time.perf_counter()
    for view in views:
        work(view)
    torch.cuda.synchronize()
    return len(views) / (time.perf_counter() - start)


def measure(count: int, width: int, height: int, rounds: int) -> dict[str, Any]:
    import splatbus_server
    from splatbus_splats.drawing import gpu
    from splatbus_splats.made import made
    from splatbus_splats.serving import SEMANTICS

    scene = made(count)
    draw, floor = gpu.Renderer(), alone(scene)
    options = {"memory": "cuda_ipc", "ipc_port": 0, "message_port": 0, "readers": 1}
    with (
        splatbus_server.serve(width, height, semantics=SEMANTICS, **options) as bus,
        watched(bus.address.ipc_port),
    ):
        view = bus.next_view(10.0)
        assert view is not None
        while "legacy" in view.wants:  # as long as the client has not said hello
            view = bus.next_view(0.1, contents_changed=True) or view
        views = turned(view)

        def ours(view: Any) -> None:
            image = draw(view, {"default": scene})
            bus.publish(view, image.color, image.inverse, alpha=image.alpha, depth_kind="inverse")

        for work in (ours, floor):
            each_ms(work, views)  # compiles, and brings all to the GPU
        single = [(each_ms(ours, views), each_ms(floor, views)) for _ in range(rounds)]
        many = [(images_per_s(ours, views), images_per_s(floor, views)) for _ in range(rounds)]
    row = {
        "gaussians": count,
        "width": width,
        "height": height,
        "ms": round(statistics.median(a for a, _ in single), 3),
        "floor_ms": round(statistics.median(b for _, b in single), 3),
        "ratio": round(statistics.median(a / b for a, b in single), 3),
        "images_per_s": round(statistics.median(a for a, _ in many), 1),
        "floor_images_per_s": round(statistics.median(b for _, b in many), 1),
    }
    print(row, flush=True)
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    require_gpu("torch", "gsplat")
    rows = [measure(count, *size, options.rounds) for count in COUNTS for size in SIZES]
    write("splats_gpu", {"rows": rows})


if __name__ == "__main__":
    main()
