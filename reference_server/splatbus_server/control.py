"""Who steers the scene: of the open connections, the one that was first to send a valid pose."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import NamedTuple

from splatbus_wire.messages import (
    DEFAULT_OBJECT,
    CameraPose,
    Intrinsics,
    Move,
    ObjectPose,
    Placement,
    PointCloudPose,
)
from splatbus_wire.poses import IDENTITY, Pose
from splatbus_wire.superseding import subject, succeeding

ONE_AT_REST: Mapping[str, Placement] = {DEFAULT_OBJECT: Placement(DEFAULT_OBJECT, IDENTITY)}
"""The scene of 1.0 [POS-13]."""


class Poses(NamedTuple):
    """What an image is rendered with, as far as clients say it.

    Attributes:
        camera: camera-to-world.
        objects: every object of the scene by its id, and where it is.
        intrinsics: those that a client asked for [CAM-5]; None for the renderer's own.
        time: in the scene, seconds, that a client asked for [TIM-2]; None as the renderer likes.
        tag: of the `camera_pose` that the camera is from, if that had one [CAM-2].
        serial: counts the `camera_pose` that were applied, for two of equal values are two.
    """

    camera: Pose
    objects: Mapping[str, Placement] = ONE_AT_REST
    intrinsics: Intrinsics | None = None
    time: float | None = None
    tag: str | None = None
    serial: int = 0

    def moved_by(self, message: Move) -> Poses:
        """What the message, which is about an object of the scene, makes of it."""
        if isinstance(message, CameraPose):  # most of what arrives, so without detours
            lens = self.intrinsics if message.intrinsics is None else message.intrinsics  # CAM-7
            return Poses(message.pose, self.objects, lens, self.time, message.tag, self.serial + 1)
        if isinstance(message, PointCloudPose):
            return self.placed(Placement(DEFAULT_OBJECT, message.pose))  # OBJ-2
        if isinstance(message, ObjectPose):
            return self.placed(Placement(message.object, message.pose, message.scale))
        return self._replace(time=message.time)

    def look_alike(self, other: Poses) -> bool:
        """Whether both give the same image; q and −q are the same rotation [IMG-10]."""
        return (
            _same_pose(self.camera, other.camera)
            and self.intrinsics == other.intrinsics
            and self.time == other.time
            and (
                self.objects is other.objects
                or all(
                    _same_pose(a.pose, b.pose) and a.scale == b.scale
                    for a, b in zip(self.objects.values(), other.objects.values())
                )
            )
        )

    @property
    def moved_objects(self) -> tuple[Placement, ...]:
        """Those that are not at the identity with scale 1 [OBJ-7]."""
        return tuple(each for each in self.objects.values() if each[1:] != (IDENTITY, 1.0))

    def placed(self, placement: Placement) -> Poses:
        """With one object elsewhere."""
        return self._replace(objects={**self.objects, placement.object: placement})


class Control:
    """Keeps the newest of each kind that a connection sent, and applies those of one [POS-11].

    Attributes:
        poses: those to render with [POS-7].
        sent: the newest of each kind, by connection; the first of these has control.
    """

    def __init__(self, poses: Poses) -> None:
        self.poses = poses
        self.sent: dict[Hashable, dict[object, Move]] = {}

    @property
    def holder(self) -> Hashable | None:
        """The connection that has control; None if nobody has."""
        return next(iter(self.sent), None)

    def move(self, connection: Hashable, message: Move) -> bool:
        """Takes what is valid; False if another connection has control."""
        newest, about = self.sent.setdefault(connection, {}), subject(message)
        newest[about] = message = succeeding(newest.get(about), message)
        in_control = self.holder is connection
        if in_control:
            self.poses = self.poses.moved_by(message)
        return in_control

    def leave(self, connection: Hashable) -> None:
        """Forgets a connection that closed.

        Control passes on to the next, and the newest of each kind that this sent is applied. Where
        it says nothing, camera and objects stay; intrinsics and time do not [CTL-3].
        """
        had_control = self.holder is connection
        self.sent.pop(connection, None)
        if had_control:
            self.poses = self.poses._replace(intrinsics=None, time=None)
            for message in next(iter(self.sent.values()), {}).values():
                self.poses = self.poses.moved_by(message)


def _same_pose(a: Pose, b: Pose) -> bool:
    return a.position == b.position and (
        a.rotation == b.rotation or a.rotation == tuple(-c for c in b.rotation)
    )
