"""Serves the closed-form scene: what an author of a renderer writes, with one to try it with."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import replace

from splatbus_wire.rotations import Quaternion, rotation_matrix

from splatbus_server.api import Bus
from splatbus_server.raycast import Raycaster
from splatbus_server.scene import Camera, Matrix, ObjectPose, default_scene, multiply
from splatbus_server.view import View

FPS = 120.0
"""Twice what viewers steer with: a pose that comes at the limit's own rate would wait for it."""


def render_until(
    stop: threading.Event, bus: Bus, fps: float = FPS, degrees_per_second: float = 0.0
) -> None:
    """Renders what is asked for, at most `fps` times a second.

    Args:
        stop: ends it.
        bus: to serve with.
        fps: most images a second.
        degrees_per_second: how fast the scene turns about its vertical axis by itself.
    """
    scene = default_scene()
    raycaster, size = Raycaster(1, 1), (1, 1)
    start = time.monotonic()
    while not stop.is_set():
        view = bus.next_view(timeout=0.1, contents_changed=degrees_per_second != 0.0)
        if view is None:
            continue
        began = time.monotonic()
        if size != (view.width, view.height):
            raycaster, size = Raycaster(view.width, view.height), (view.width, view.height)
        scene_time = time.monotonic() - start
        turned = _object_pose(view, math.radians(degrees_per_second * scene_time))
        image = raycaster.render(replace(scene, pose=turned), _camera(view), view.wants_depth)
        bus.publish(view, image.color, image.depth, time=scene_time)
        stop.wait(max(0.0, began + 1.0 / fps - time.monotonic()))


def _camera(view: View) -> Camera:
    pose = view.poses.camera
    fx, fy, cx, cy, near, far = view.intrinsics
    matrix = _matrix(pose.rotation)
    return Camera(view.width, view.height, fx, fy, cx, cy, pose.position, matrix, near, far)


def _object_pose(view: View, angle: float) -> ObjectPose:
    pose = view.poses.points
    about_y = _matrix((0.0, math.sin(angle / 2.0), 0.0, math.cos(angle / 2.0)))
    return ObjectPose(pose.position, multiply(_matrix(pose.rotation), about_y))


def _matrix(rotation: Quaternion) -> Matrix:
    r = rotation_matrix(rotation)
    return (r[:3], r[3:6], r[6:])
