"""Serves Gaussians: what an author of a renderer writes, whatever draws."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from typing import Protocol

from splatbus_server.api import Bus
from splatbus_server.view import View
from splatbus_wire.semantics import Semantics

from splatbus_splats.gaussians import Gaussians
from splatbus_splats.scene import Scene

SEMANTICS = Semantics(alpha="premultiplied", depth_estimator="harmonic")
"""What the numbers of images mean, whatever draws them."""
FPS = 120.0
"""Twice what viewers steer with: a pose that comes at the limit's own rate would wait for it."""
IDLE_SECONDS, PLAYING_SECONDS = 0.1, 0.005
"""How long to wait for a client to want something at the most; and, of what plays, at the least."""
REST_SECONDS = 0.1
"""After how long a camera rests, and its image is drawn with all pixels."""


class Drawing(Protocol):
    """How images are made, and where."""

    @property
    def milliseconds(self) -> float:
        """That an image took of late."""

    def show(
        self,
        bus: Bus,
        view: View,
        objects: Mapping[str, Gaussians],
        time: float | None,
        *,
        is_moving: bool,
    ) -> bool:
        """Draws and publishes a view; whether it had fewer pixels, as while the camera moves."""


def render_until(
    stop: threading.Event, bus: Bus, scene: Scene, drawing: Drawing, fps: float = FPS
) -> None:
    """Renders what is asked for.

    Args:
        stop: ends it.
        bus: to serve with, that was told `SEMANTICS`, and the ids and the time range of the scene.
        scene: plays by itself, over and over, until a client sets the time.
        drawing: draws.
        fps: most images a second.
    """
    start, shown = time.monotonic(), scene.moment(None)
    plays, is_rough, found = scene.time_range is not None, False, 0.0
    camera, moved = None, -math.inf
    while not stop.is_set():
        began = time.monotonic()
        changed = plays and scene.moment(shown_at(scene, None, began - start)) != shown
        rests = is_rough and began - moved >= REST_SECONDS
        wait = IDLE_SECONDS
        if plays and not changed:  # else it is due at once, or nobody looks
            wait = min(max(scene.lasts(began - start), PLAYING_SECONDS), IDLE_SECONDS)
        view = bus.next_view(wait, contents_changed=changed or rests)
        if view is not None:
            began = time.monotonic()
            plays = scene.time_range is not None and view.time is None
            now = shown_at(scene, view.time, began - start)
            is_other = view.poses.camera != camera
            is_moving = is_other and began - moved < REST_SECONDS
            objects, found = scene.at(now), time.monotonic() - began
            is_rough = drawing.show(bus, view, objects, now, is_moving=is_moving)
            shown = scene.moment(now)
            if is_other:
                camera, moved = view.poses.camera, time.monotonic()
        stage = "idle" if view is None else "rendering"
        bus.telemetry(stage=stage, render_ms=(drawing.milliseconds + 1e3 * found, "ms"))
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
