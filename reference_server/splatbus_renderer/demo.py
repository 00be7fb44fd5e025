"""Serves the closed-form scene: what an author of a renderer writes, with one to try it with."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from dataclasses import replace

import numpy as np
from splatbus_server.api import Bus
from splatbus_server.view import View
from splatbus_wire.messages import Box, SceneObject
from splatbus_wire.rotations import Quaternion, rotation_matrix

from splatbus_renderer.raycast import Raycaster
from splatbus_renderer.scene import Camera, Matrix, ObjectPose, Scene, default_scene, multiply

FPS = 120.0
"""Twice what viewers steer with: a pose that comes at the limit's own rate would wait for it."""
OBJECTS = (
    SceneObject("default", "five spheres", 5, Box((-2.2, -1.0, 3.2), (2.6, 0.4, 5.5))),
    SceneObject("ball", "blue sphere", 1, Box((1.5, 0.55, 2.8), (1.5, 0.55, 2.8))),
)
"""What the scene consists of; its spheres count as Gaussians."""
BALL, BOBBING = 2, 1
"""Which of its spheres is an object of its own, and which goes up and down with time."""
BOBBING_TIME = (0.0, 4.0)
"""First and last time of the scene, seconds, where it does not turn."""
RISE = 0.25


def turning_time(degrees_per_second: float) -> tuple[float, float] | None:
    """First and last time of the scene that turns once, seconds; None if it does not turn."""
    return (0.0, 360.0 / abs(degrees_per_second)) if degrees_per_second else None


def render_until(
    stop: threading.Event, bus: Bus, fps: float = FPS, degrees_per_second: float = 0.0
) -> None:
    """Renders what is asked for, at most `fps` times a second.

    Args:
        stop: ends it.
        bus: to serve with.
        fps: most images a second.
        degrees_per_second: how fast the scene turns about its vertical axis by itself, until a
            client sets the time. One that does not turn stands still until then.
    """
    raycaster, size = Raycaster(1, 1), (1, 1)
    start, is_playing = time.monotonic(), degrees_per_second != 0.0
    render_times: deque[float] = deque(maxlen=1000)
    while not stop.is_set():
        view = bus.next_view(timeout=0.1, contents_changed=is_playing)
        began = time.monotonic()
        if view is not None:
            if size != (view.width, view.height):
                raycaster, size = Raycaster(view.width, view.height), (view.width, view.height)
            is_playing = degrees_per_second != 0.0 and view.time is None
            scene_time = (
                _playing(began - start, degrees_per_second) if view.time is None else view.time
            )
            scene = scene_at(scene_time, view, degrees_per_second)
            image = raycaster.render(scene, camera_of(view), view.wants_depth)
            bus.publish(view, image.color, image.depth, time=scene_time)
            render_times.append((time.monotonic() - began) * 1e3)
        _tell(bus, "idle" if view is None else "rendering", render_times)
        stop.wait(max(0.0, began + 1.0 / fps - time.monotonic()) if view else 0.0)


def scene_at(seconds: float, view: View, degrees_per_second: float = 0.0) -> Scene:
    """What there is to see at a time in the scene, its objects where the view has them.

    A scene that does not turn has a sphere that bobs. Where there is no object called "ball", all
    belongs to "default".
    """
    scene, angle = default_scene(), math.radians(degrees_per_second * seconds)
    spheres = list(scene.spheres)
    if not degrees_per_second:
        x, y, z = spheres[BOBBING].center
        height = RISE * (1.0 - math.cos(math.pi * seconds / 2.0))
        spheres[BOBBING] = replace(spheres[BOBBING], center=(x, y - height, z))
    balls = []
    if "ball" in view.poses.objects:
        ball, pose = spheres.pop(BALL), object_pose_of(view.of("ball"), angle)
        balls.append(Scene((ball,), None, scene.light, pose))
    return replace(
        scene, spheres=tuple(spheres), pose=object_pose_of(view, angle), beside=tuple(balls)
    )


def _playing(seconds: float, degrees_per_second: float) -> float:
    """The time in a scene that turns over and over, and begins anew with each turn."""
    whole = turning_time(degrees_per_second)
    return 0.0 if whole is None else seconds % whole[1]


def _tell(bus: Bus, stage: str, render_times: deque[float]) -> None:
    newest = (render_times[-1], "ms") if render_times else (0.0, "ms")
    bus.telemetry(
        stage=stage, render_ms=newest, render_times=lambda: np.histogram(render_times, bins=32)
    )


def camera_of(view: View) -> Camera:
    """The camera that a view asks for."""
    pose = view.poses.camera
    fx, fy, cx, cy, near, far = view.intrinsics
    matrix = matrix_of(pose.rotation)
    return Camera(view.width, view.height, fx, fy, cx, cy, pose.position, matrix, near, far)


def object_pose_of(view: View, angle: float) -> ObjectPose:
    """Where the object of a view is, turned about its vertical axis."""
    _, pose, scale = view.placement
    about_y = matrix_of((0.0, math.sin(angle / 2.0), 0.0, math.cos(angle / 2.0)))
    return ObjectPose(pose.position, multiply(matrix_of(pose.rotation), about_y), scale)


def matrix_of(rotation: Quaternion) -> Matrix:
    """The rows of the matrix of a quaternion of any norm."""
    r = rotation_matrix(rotation)
    return (r[:3], r[3:6], r[6:])
