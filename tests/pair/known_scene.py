"""The demo scene, served, and what a frame of it has to be by that frame's own words."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import Any

import splatbus_client
import splatbus_server
from splatbus_conformance.images.known_scene import SceneState, render
from splatbus_conformance.images.pinhole import Camera, ObjectPlacement, rigid, rotation_matrix
from splatbus_renderer.demo import BOBBING_TIME, OBJECTS, render_until, turning_time

from tests.pair.rig import Tap, served


@contextlib.contextmanager
def showing(
    width: int = 96, height: int = 54, degrees: float = 0.0, **options: Any
) -> Iterator[tuple[splatbus_server.Bus, Tap]]:
    """The demo scene, turning by so many degrees a second, at 500 images a second at most."""
    time_range = turning_time(degrees) or BOBBING_TIME
    with served(
        lambda stopped, bus: render_until(stopped, bus, 500.0, degrees),
        *(width, height),
        **{"objects": OBJECTS, "time_range": time_range, **options},
    ) as both:
        yield both


def is_right(frame: splatbus_client.FrameLease, degrees: float = 0.0) -> bool:
    """Whether it shows the scene as its camera, objects and time say, in the harness's closed form.

    Args:
        frame: that is held.
        degrees: that the scene turns in a second of its time; one that does not has a sphere that
            bobs.
    """
    half = math.radians(degrees * frame.time) / 2.0
    turn = rotation_matrix((0.0, math.sin(half), 0.0, math.cos(half)))

    def placed(name: str) -> ObjectPlacement:
        _, pose, scale = frame.placement(name)
        lies = rigid(pose.position, pose.rotation)
        return ObjectPlacement(lies._replace(rotation=lies.rotation @ turn), scale)

    (at, turned), fx, fy, cx, cy, width, height, near, far, *_ = frame.camera
    camera = Camera(rigid(at, turned), fx, fy, cx, cy, width, height, near, far)
    time = 0.0 if degrees else frame.time
    exact = render(camera, SceneState(placed("default"), placed("ball"), time))
    seen = exact.certain.mean() > 0.5 and exact.color.any()
    return bool(seen and exact.agreement(frame.color, frame.depth) == 1.0)
