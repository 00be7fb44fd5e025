"""Serves Gaussians: what an author of a renderer writes."""

from __future__ import annotations

import math
import threading
import time

from splatbus_server.api import Bus
from splatbus_wire.semantics import Semantics

from splatbus_splats.definition import placed
from splatbus_splats.renderer import Renderer
from splatbus_splats.scene import Scene
from splatbus_splats.skips import USUAL, Skip

SEMANTICS = Semantics(alpha="premultiplied", depth_estimator="harmonic")
"""What the numbers of `render_until` mean."""
FPS = 120.0
"""Twice what viewers steer with: a pose that comes at the limit's own rate would wait for it."""
IDLE_SECONDS, PLAYING_SECONDS = 0.1, 0.005
"""How long to wait for a client to want something, and for the next moment of what plays."""

REST_SECONDS = 0.1
"""After how long a camera rests, and its image is drawn with all pixels."""


def render_until(
    stop: threading.Event,
    bus: Bus,
    scene: Scene,
    threads: int = 1,
    fps: float = FPS,
    skips: Skip = USUAL,
) -> None:
    """Renders what is asked for.

    Args:
        stop: ends it.
        bus: to serve with, that was told `SEMANTICS`, and the ids and the time range of the scene.
        scene: plays by itself, over and over, until a client sets the time.
        threads: that draw.
        fps: most images a second.
        skips: what is not done.
    """
    with Renderer(threads, skips) as renderer:
        _render_until(stop, bus, scene, fps, renderer, Skip.MOVING in skips)


def _render_until(
    stop: threading.Event,
    bus: Bus,
    scene: Scene,
    fps: float,
    renderer: Renderer,
    may_be_rough: bool,
) -> None:
    start, took, shown = time.monotonic(), 0.0, scene.moment(None)
    plays, is_rough = scene.time_range is not None, False
    camera, moved = None, -math.inf
    while not stop.is_set():
        began = time.monotonic()
        changed = plays and scene.moment(shown_at(scene, None, began - start)) != shown
        rests = is_rough and began - moved >= REST_SECONDS
        wait = PLAYING_SECONDS if plays else REST_SECONDS if is_rough else IDLE_SECONDS
        view = bus.next_view(wait, contents_changed=changed or rests)
        if view is not None:
            began = time.monotonic()
            plays = scene.time_range is not None and view.time is None
            now = shown_at(scene, view.time, began - start)
            is_other = view.poses.camera != camera
            is_rough = may_be_rough and is_other and began - moved < REST_SECONDS
            image = renderer.draw(
                placed(view, scene.at(now)),
                view.intrinsics,
                view.width,
                view.height,
                view.wants,
                is_moving=is_rough,
            )
            depth = image.inverse if view.wants_depth else None
            bus.publish(view, image.color, depth, depth_kind="inverse", time=now)
            took, shown = (time.monotonic() - began) * 1e3, scene.moment(now)
            if is_other:
                camera, moved = view.poses.camera, time.monotonic()
        bus.telemetry(stage="idle" if view is None else "rendering", render_ms=(took, "ms"))
        stop.wait(max(0.0, began + 1.0 / fps - time.monotonic()) if view else 0.0)


def shown_at(scene: Scene, asked: float | None, playing: float) -> float | None:
    """Which second of the scene is shown; None where nothing changes.

    Args:
        scene: that is shown.
        asked: the second that a client has set, if one has.
        playing: seconds for which the scene plays by itself.
    """
    if scene.time_range is None:
        return None
    return min(playing % scene.loop, scene.time_range[1]) if asked is None else asked
