"""Mutants that break POS: they misread poses, or apply those that they should not."""

import math
import time
from typing import Any

from splatbus_conformance.wire.messages import camera_pose, encode
from splatbus_server.session import Session
from splatbus_wire import from_client, plain_poses, rotations
from splatbus_wire.messages import CameraPose, PointCloudPose, ViewportSize
from splatbus_wire.poses import IDENTITY

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server, wire
from tests.zoo.faults.surgery import Json, crash
from tests.zoo.mutant import mutant


@mutant("POS-5", check="check_takes_members_by_name", code="ignores", in_device_memory=True)
def server_takes_members_as_they_come(patch):
    """Takes the numbers of a rotation in the order in which they stand."""

    def parse(original, payload, *most):
        message: Json = original(payload, *most)
        rotation = message.get("rotation")
        if isinstance(rotation, dict) and set(rotation) == set("xyzw"):
            message["rotation"] = dict(zip("xyzw", rotation.values(), strict=True))
        return message

    wire.READS_POSE_THE_SHORT_WAY.replace(patch, lambda payload: None)
    wire.READS_OBJECT.wrap(patch, parse)


@mutant("POS-6", check="check_keeps_the_former_pose", code="applies")
def server_fills_in_what_a_pose_lacks(patch):
    """Takes the origin for a position that is missing."""
    _repairs(patch, lambda message: {"position": dict.fromkeys("xyz", 0.0)} | message)


@mutant("POS-6", check="check_keeps_the_former_pose", code="applies", in_device_memory=True)
def server_scales_every_rotation(patch):
    """Makes a unit quaternion of every rotation."""

    def scaled(message):
        rotation = message.get("rotation")
        if not isinstance(rotation, dict) or not all(type(n) is float for n in rotation.values()):
            return message
        norm = max(math.hypot(*rotation.values()), 1e-300)
        return message | {"rotation": {name: part / norm for name, part in rotation.items()}}

    _repairs(patch, scaled)


@mutant("POS-6", check="check_keeps_the_former_pose", code="applies")
def server_rounds_norms(patch):
    """Takes norms that are 0.99 or 1.01 in single precision for ones within the limits."""
    tolerating(patch, 0.01 + 2.0**-23)


@mutant("POS-7", check="check_poses_at_the_limits_are_poses", code="pose-not-shown")
def server_is_strict_with_norms(patch):
    """Refuses rotations whose norm differs from 1 by nearly 0.01."""
    tolerating(patch, 0.00999)


def tolerating(patch, tolerance):
    """Judge rotations by another tolerance."""
    for module in (plain_poses, rotations):
        Seam(module, "NORM_TOLERANCE").replace(patch, tolerance)


@mutant("POS-10", code="answered", through="POS-5", at=server.TAKES_POSE)
def server_acknowledges_poses(original, self, connection, message):
    """Replies to each pose with the size of the image."""
    connection.send(ViewportSize(64, 48, None))
    return original(self, connection, message)


@mutant(
    "POS-11",
    check="check_one_connection_has_control",
    code="applied-without-control",
    at=server.OBEYS,
    in_device_memory=True,
)
def server_obeys_everyone(original, self, connection, message):
    """Applies the newest pose, whoever sent it."""
    self.poses = self.poses.moved_by(message)
    return True


@mutant("POS-11", check="check_one_connection_has_control", code="control-not-passed-on")
def server_obeys_the_first_forever(patch):
    """Does not pass control on when the connection that has it closes."""
    server.PASSES_CONTROL_ON.wrap(patch, lambda original, self, connection: False)


@mutant(
    "POS-11",
    check="check_one_connection_has_control",
    code="control-not-given",
    at=server.UNDERSTANDS,
)
def server_gives_control_for_a_broken_pose(original, self, payload, now):
    """Gives control to who sends a broken pose first."""
    event = original(self, payload, now)
    broken = b"camera_pose" in payload and not isinstance(event, CameraPose | PointCloudPose)
    return CameraPose(IDENTITY, None) if broken and b"cam_idx" not in payload else event


@mutant("POS-7", check="check_the_newest_camera_is_shown", code="no-frame", at=server.TAKES_POSE)
def server_closes_its_readers_at_a_far_camera(original, self, connection, message):
    """Ends every reader when the camera is far away, though not when it is where nobody looks."""
    away = max(map(abs, message.pose.position)) if isinstance(message, CameraPose) else 0.0
    if 100.0 < away < 10_000.0:
        for reader in self.readers:
            reader.end("it cannot be shown that far", time.monotonic())
    return original(self, connection, message)


def _repairs(patch, repair):
    """Repair camera poses before they are judged."""

    def parse(original, payload, *most):
        message: Json = original(payload, *most)
        return repair(message) if message.get("type") == "camera_pose" else message

    wire.READS_OBJECT.wrap(patch, parse)


@mutant("POS-6", check="check_keeps_the_former_pose_of_the_gaussians", code="applies")
def server_moves_gaussians_that_it_will_not_turn(patch):
    """Moves the Gaussians by a pose whose rotation has another norm, and does not turn them."""

    def pose(original, kind, message):
        rotation = message.value.get("rotation")
        members = rotation.values() if isinstance(rotation, dict) else ()
        norm = math.hypot(*members) if members and all(map(is_number, members)) else 1.0
        if kind == "point_cloud_pose" and len(members) == 4 and abs(norm - 1.0) > 0.01:
            message.value["rotation"] = dict(zip("xyzw", IDENTITY.rotation, strict=True))
        return original(kind, message)

    def is_number(value):
        return isinstance(value, int | float) and not isinstance(value, bool)

    Seam(from_client, "pose_of_1_0").wrap(patch, pose)


@mutant(
    "POS-7",
    check="check_the_last_of_one_piece_is_shown",
    code="not-the-newest",
    in_device_memory=True,
)
def server_takes_the_first_of_one_piece(patch):
    """Takes one camera until it has passed on what changed."""
    taken: list[Any] = []

    def move(original, self, connection, message):
        if isinstance(message, CameraPose) and self.holder is connection:
            if taken:
                return True
            taken.append(message)
        return original(self, connection, message)

    def catch_up(original, self, now):
        taken.clear()
        original(self, now)

    server.OBEYS.wrap(patch, move)
    Seam(Session, "catch_up").wrap(patch, catch_up)


@mutant(
    "POS-7",
    check="check_poses_at_the_limits_are_poses",
    code="pose-not-shown",
    at=server.TAKES_POSE,
)
def server_takes_no_half_turns(original, self, connection, message):
    """Passes poses over whose scalar is 0, as that of a rotation that was never set."""
    if isinstance(message, CameraPose) and message.pose.rotation[3] == 0.0:
        return None
    return original(self, connection, message)


@mutant(
    "POS-14",
    check="check_takes_poses_of_no_time_or_not",
    code="dies",
    at=Seam(from_client, "timestamp"),
)
def server_dies_of_what_is_no_time(original, message, **named):
    """Takes whatever stands for the timestamp for a number."""
    if isinstance(message.value.get("timestamp"), str | list | dict):
        crash()
    return original(message, **named)


@mutant(
    "POS-14",
    check="check_takes_poses_of_no_time_or_not",
    code="applies",
    at=server.REFUSES_PACKET,
    in_device_memory=True,
)
def server_turns_by_poses_of_no_time(original, self, error, now):
    """Applies the rotation alone of a pose whose timestamp is no number."""
    if error.pointer == "/timestamp":
        return self.understand(TURNED, now)
    return original(self, error, now)


TURNED = encode(camera_pose((0.0, 0.0, 0.0), (0.6, 0.0, 0.0, 0.8)))
