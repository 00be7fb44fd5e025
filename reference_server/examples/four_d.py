"""A scene in time: `python four_d.py point_cloud.ply`.

It plays by itself until a client sets the time.
"""

from __future__ import annotations

import math
import sys
import time
from contextlib import suppress
from pathlib import Path

import splatbus_server as splatbus
import torch
from gsplat_scene import MEANING, SIZE, drawn, loaded

SECONDS = 4.0
FPS = 60.0
HEIGHT, LENGTH = 0.1, 2.0
"""Of the wave, scene units."""


def at(splats: list[torch.Tensor], seconds: float) -> list[torch.Tensor]:
    """The scene at a time; in its place a network that deforms it, or Gaussians of 4D cut there.

    Here a wave goes through it along x.
    """
    means, *others = splats
    phases = math.tau * (means[:, 0] / LENGTH - seconds / SECONDS)
    waves = torch.zeros_like(means)
    waves[:, 1] = HEIGHT * torch.sin(phases)
    return [means + waves, *others]


def main(path: Path) -> None:
    """Serves until it is stopped."""
    splats, degree = loaded(path)
    with splatbus.serve(
        *SIZE, memory="cuda_ipc", semantics=MEANING, time_range=(0.0, SECONDS)
    ) as bus:
        print(f"ready: {bus.address}", flush=True)
        is_playing, started, due = True, time.monotonic(), 0.0
        while True:
            # A camera that moves is drawn at once, the scene that plays when its next image is due.
            is_due = is_playing and time.monotonic() >= due
            view = bus.next_view(timeout=1.0 / FPS, contents_changed=is_due)
            if view is None:
                continue
            now = time.monotonic()
            is_playing, due = view.time is None, now + 1.0 / FPS
            seconds = (now - started) % SECONDS if view.time is None else view.time
            image, alpha = drawn(view, at(splats, seconds), degree)
            bus.publish(
                view,
                image[..., :3],
                image[..., 3],
                alpha=alpha,
                depth_kind="accumulated",
                time=seconds,
            )


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        main(Path(sys.argv[1]))
