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

import math
import statistics
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from benchmarks import _cuda, _shared
from benchmarks._shared import Work

COUNTS = (100_000, 1_000_000)
SIZES = ((640, 480), (1920, 1080))
IMAGES = 60
"""Of a round; in one the camera turns by 30 degrees."""


def turned(view: Any) -> list[Any]:
    """The view, with a camera that turns from left to right."""
    angles = [math.radians(30.0 * (number / IMAGES - 0.5)) / 2.0 for number in range(IMAGES)]
    turns = [(0.0, math.sin(a), 0.0, math.cos(a)) for a in angles]
    cameras = [view.poses.camera._replace(rotation=each) for each in turns]
    return [replace(view, poses=view.poses._replace(camera=each)) for each in cameras]


def alone(scene: Any) -> Callable[[Any], Any]:
    """One call of gsplat for a view, with what it takes ready on the GPU."""
    import gsplat  # type: ignore[import-not-found,unused-ignore]
    import torch  # type: ignore[import-not-found,unused-ignore]

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


def measure(count: int, width: int, height: int, rounds: int) -> dict[str, Any]:
    from splatbus_splats.drawing import gpu
    from splatbus_splats.made import garden, poses
    from splatbus_splats.serving import SEMANTICS

    scene = garden(count)
    draw, floor = gpu.Renderer(), alone(scene)
    with _shared.seen(width, height, "cuda_ipc", semantics=SEMANTICS) as (bus, view):
        views = turned(replace(view, poses=view.poses._replace(camera=poses()[0])))

        def ours(view: Any) -> None:
            image = draw(view, {"default": scene})
            bus.publish(view, image.color, image.inverse, alpha=image.alpha, depth_kind="inverse")

        def over(draws: Callable[[Any], Any]) -> Work:
            """All views, told by `each` one after the other."""

            def work(each: Callable[[Work], object] = lambda draw: draw()) -> list[object]:
                return [each(partial(draws, view)) for view in views]

            return work

        def each_ms(work: Any) -> float:
            """Of one image, the GPU waited for after each."""
            return float(statistics.median(work(_cuda.synchronised)))

        works = over(floor), [over(ours)]
        (single,) = _shared.beside(*works, rounds, each_ms)
        (many,) = _shared.beside(*works, rounds, _cuda.synchronised)
    per_s = [IMAGES * 1e3 / statistics.median(each) for each in many]
    return _shared.told(
        {
            "gaussians": count,
            "width": width,
            "height": height,
            "ms": round(statistics.median(single.taken), 3),
            "floor_ms": round(statistics.median(single.floor), 3),
            "ratio": round(single.ratio()[1], 3),
            "images_per_s": round(per_s[0], 1),
            "floor_images_per_s": round(per_s[1], 1),
        }
    )


def main() -> None:
    options = _shared.options(__doc__, rounds=7)
    _cuda.require_gpu("torch", "gsplat")
    rows = [measure(count, *size, options.rounds) for count in COUNTS for size in SIZES]
    _cuda.write("splats_gpu", {"rows": rows})


if __name__ == "__main__":
    main()
