"""Serves Gaussians: what an author of a renderer writes."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence

import numpy as np
from splatbus_server.api import Bus
from splatbus_server.view import Intrinsics, field_of_view
from splatbus_wire.messages import SceneObject
from splatbus_wire.semantics import Semantics

from splatbus_splats.definition import placed
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.renderer import rendered

SEMANTICS = Semantics(alpha="premultiplied", depth_estimator="harmonic")
"""What the numbers of `render_until` mean."""
LEAST_FAR = 100.0


def described(name: str, label: str, gaussians: Gaussians) -> SceneObject:
    """The object as clients are told of it."""
    return SceneObject(name, label, len(gaussians), gaussians.bounds)


def lens_for(width: int, height: int, objects: Sequence[Gaussians]) -> Intrinsics:
    """A vertical field of view of 60 degrees, with which all can be seen from within and around."""
    boxes = [each.bounds for each in objects]
    sizes = [np.linalg.norm(np.subtract(box.max, box.min)) for box in boxes if box]
    far = max([LEAST_FAR, *(4.0 * float(size) for size in sizes)])
    return field_of_view(width, height)._replace(far=far)


def render_until(
    stop: threading.Event, bus: Bus, objects: Mapping[str, Gaussians], threads: int = 1
) -> None:
    """Renders what is asked for.

    Args:
        stop: ends it.
        bus: to serve with, that was told `SEMANTICS` and the ids of the objects.
        objects: by their ids.
        threads: that draw.
    """
    took = 0.0
    while not stop.is_set():
        view = bus.next_view(timeout=0.1)
        if view is not None:
            began = time.monotonic()
            image = rendered(
                placed(view, objects), view.intrinsics, view.width, view.height, threads
            )
            depth = image.inverse if view.wants_depth else None
            bus.publish(view, image.color, depth, depth_kind="inverse")
            took = (time.monotonic() - began) * 1e3
        bus.telemetry(stage="idle" if view is None else "rendering", render_ms=(took, "ms"))
