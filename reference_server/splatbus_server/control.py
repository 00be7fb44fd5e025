"""Who moves the camera: of the open connections, the one that was first to send a valid pose."""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

from splatbus_wire.messages import CameraPose, PointCloudPose
from splatbus_wire.poses import IDENTITY, Pose


class Poses(NamedTuple):
    """What an image is rendered with: camera-to-world, and object-to-world of the Gaussians."""

    camera: Pose
    points: Pose = IDENTITY  # POS-13

    def moved_by(self, message: CameraPose | PointCloudPose) -> Poses:
        """The poses after the message."""
        if isinstance(message, CameraPose):
            return self._replace(camera=message.pose)
        return self._replace(points=message.pose)

    def look_alike(self, other: Poses) -> bool:
        """Whether both give the same image; q and −q are the same rotation [IMG-10]."""
        return all(
            a.position == b.position
            and (a.rotation == b.rotation or a.rotation == tuple(-c for c in b.rotation))
            for a, b in zip(self, other, strict=True)
        )


class Control:
    """Keeps the newest poses of every connection, and applies those of one [POS-11].

    Attributes:
        poses: those to render with [POS-7].
    """

    def __init__(self, poses: Poses) -> None:
        self.poses = poses
        self._sent: dict[Hashable, dict[type, CameraPose | PointCloudPose]] = {}

    def move(self, connection: Hashable, message: CameraPose | PointCloudPose) -> bool:
        """Takes a valid pose; False if another connection has control."""
        self._sent.setdefault(connection, {})[type(message)] = message
        in_control = next(iter(self._sent)) is connection
        if in_control:
            self.poses = self.poses.moved_by(message)
        return in_control

    def leave(self, connection: Hashable) -> bool:
        """Forgets a connection that closed; True if control passed on to another with its poses."""
        had_control = next(iter(self._sent), None) is connection
        self._sent.pop(connection, None)
        if not (had_control and self._sent):
            return False
        for message in next(iter(self._sent.values())).values():
            self.poses = self.poses.moved_by(message)
        return True
