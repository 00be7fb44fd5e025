"""What a client sees of a scene."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from splatbus_client import Session
from splatbus_wire.poses import Pose

MOST = 300
"""Images that may come before the one that was asked for; a scene that plays has 120 a second."""


class Picture(NamedTuple):
    """A frame that was read, the top row first."""

    color: np.ndarray
    depth: np.ndarray
    time: float


def looked(session: Session, camera: Pose, time: float | None = None) -> Picture:
    """An image from a camera, and of a time in the scene, if that is given.

    Raises AssertionError if none comes.
    """
    session.send_camera(camera)
    if time is not None:
        session.send_time(time)
    for _ in range(MOST):
        with session.next_frame(60.0) as frame:
            is_from_there = frame.camera is not None and frame.camera.pose == camera
            if is_from_there and time in (None, frame.time):
                return Picture(frame.color.copy(), frame.depth.copy(), frame.time)
    raise AssertionError(f"of {MOST} images none is from {camera} at {time}")
