"""Mutants that only an adapter shows: what they convert and understand is wrong."""

import dataclasses

import numpy as np
from splatbus_client.session import Session
from splatbus_client.steering import Steering
from splatbus_wire import conventions
from splatbus_wire.conventions import (
    BLENDER_CAMERA,
    BLENDER_OBJECT,
    ENGINES,
    OPENGL,
    UNITY,
    UNREAL,
    Engine,
)
from splatbus_wire.messages import CameraPose, ObjectPose
from splatbus_wire.poses import Pose, view_matrix

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, wire
from tests.zoo.faults.surgery import (
    adding_up_digits,
    messages,
    of_type,
)
from tests.zoo.mutant import mutant

CAMERAS = "check_camera_poses_are_camera_to_world"
DIGITS = "check_numbers_keep_their_digits"
OUT, IN = "check_axes_change_exactly_on_the_way_out", "check_axes_change_exactly_on_the_way_in"


@mutant("CNV-1", check=CAMERAS, code="another-pose", axes="opencv", at=client.SENDS_CAMERA)
def sends_world_to_camera(original, self, pose, *more, **named):
    """Sends the view matrix's translation and the inverse rotation."""
    view, (x, y, z, w) = view_matrix(pose), pose.rotation
    original(self, Pose((view[3], view[7], view[11]), (-x, -y, -z, w)), *more, **named)


@mutant("CNV-1", check="check_understands_cameras", code="another-pose", axes="unity")
def takes_replies_as_they_are(patch):
    """Puts the engine's camera where the reply says, without a change of axes."""
    wire.POSE_FROM_WIRE.replace(patch, lambda self, pose: pose)


@mutant("CNV-1", check=CAMERAS, code="another-pose", axes="unity")
def sends_the_pose_before(patch):
    """Sends each time the pose that it was given the time before."""
    former: list[Pose] = []

    def send(original, self, pose, *more, **named):
        for before in former:
            original(self, before, *more, **named)
        former[:] = [pose]

    client.SENDS_CAMERA.wrap(patch, send)


@mutant(
    "CNV-1",
    check="check_says_its_camera_again_as_it_was",
    code="another-pose",
    axes="blender",
    at=client.BEGINS_TO_STEER,
)
def says_its_camera_again_in_other_axes(original, self):
    """Says its last camera again, when it has come back, in the axes of its engine."""
    for key, message in self.newest.items():
        if isinstance(message, CameraPose):
            pose = BLENDER_CAMERA.from_wire(message.pose)
            self.newest[key] = message._replace(pose=pose)
    return original(self)


@mutant("CNV-1", check="check_understands_cameras", code="another-pose", axes="unreal")
def converts_replies_in_the_other_direction(patch):
    """Converts the camera of a reply as if it were the engine's own."""
    wire.POSE_FROM_WIRE.replace(patch, Engine.to_wire)


@mutant(
    "CNV-2",
    check="check_object_poses_are_object_to_world",
    code="another-pose",
    axes="blender",
)
def takes_objects_for_cameras(patch):
    """Converts the pose of the splats as if they looked along −z."""
    patch.setitem(ENGINES, "blender_object", BLENDER_CAMERA)


@mutant(
    "CNV-3",
    check="check_quaternions_are_hamilton_with_w_last",
    code="another-order",
    axes="opencv",
    at=client.SENDS_CAMERA,
)
def sends_w_under_the_name_of_x(original, self, pose, *more, **named):
    """Takes an engine's quaternion w, x, y, z for x, y, z, w."""
    x, y, z, w = pose.rotation
    original(self, pose._replace(rotation=(w, x, y, z)), *more, **named)


@mutant("CNV-4", check="check_unity_s_row", code="another-pose", axes="unity")
def takes_unity_for_right_handed(patch):
    """Converts Unity's poses by the row of OpenGL."""
    patch.setitem(ENGINES, "unity", OPENGL)


@mutant("CNV-5", check="check_unreal_s_row", code="another-pose", axes="unreal")
def sends_centimetres(patch):
    """Does not divide Unreal's positions by 100."""
    patch.setitem(ENGINES, "unreal", dataclasses.replace(UNREAL, scale=1.0))


@mutant("CNV-6", check="check_blender_s_rows", code="another-pose", axes="blender")
def takes_cameras_for_objects(patch):
    """Converts Blender's cameras, which look along −z, by the row of objects."""
    patch.setitem(ENGINES, "blender_camera", BLENDER_OBJECT)


@mutant(
    "CNV-7",
    check="check_opengl_s_row",
    code="another-pose",
    axes="opengl",
)
def flips_only_positions(patch):
    """Flips y and z of positions, and sends rotations as they are."""
    only = dataclasses.replace(OPENGL, rotation_to_wire=lambda q: q)
    patch.setitem(ENGINES, "opengl", only)


def _spelled(patch, spell, *parts):
    def change(pose):
        return pose | {
            part: {name: spell(number) for name, number in pose[part].items()} for part in parts
        }

    messages(patch, of_type("camera_pose", change))


@mutant("ACC-1", check=DIGITS, code="beyond-its-budget", axes="opencv")
def sends_six_digits(patch):
    """Prints numbers with six significant digits, as printf's %g does."""
    _spelled(patch, lambda number: float(f"{number:.6g}"), "position", "rotation")


@mutant("ACC-1", check=DIGITS, code="beyond-its-budget", axes="opencv")
def sends_sixteen_digits_of_positions(patch):
    """Prints positions with sixteen significant digits, one short of enough."""
    _spelled(patch, lambda number: float(f"{number:.16g}"), "position")


@mutant("ACC-1", check=DIGITS, code="beyond-its-budget", axes="unity")
def sends_single_precision(patch):
    """Has rotations in double precision, and prints them in single."""
    _spelled(patch, lambda number: float(np.float32(number)), "rotation")


@mutant(
    "ACC-14",
    check="check_numbers_are_read_to_the_last_bit",
    code="beyond-its-budget",
    axes="opencv",
)
def adds_up_digits(patch):
    """Reads a number digit by digit, in double precision."""
    adding_up_digits(patch)


@mutant(
    "ACC-7", check=OUT, code="beyond-its-budget", axes="unreal", at=Seam(Engine, "position_to_wire")
)
def multiplies_by_a_hundredth(original, self, position):
    """Multiplies by 0.01, which no double is, instead of dividing by 100."""
    x, y, z = original(dataclasses.replace(self, scale=1.0), position)
    return 0.01 * x, 0.01 * y, 0.01 * z


@mutant("ACC-7", check=OUT, code="beyond-its-budget", axes="blender")
def types_the_root_of_one_half(patch):
    """Types √½ with seven digits."""
    Seam(conventions, "HALF_SQRT").replace(patch, 0.7071068)


@mutant("ACC-7", check=IN, code="beyond-its-budget", axes="unity", at=wire.POSE_FROM_WIRE)
def understands_in_single_precision(original, self, pose):
    """Says that it holds double precision, and rounds replies to single."""
    position, rotation = original(self, pose)
    return Pose(position, tuple(float(np.float32(number)) for number in rotation))  # type: ignore[arg-type]


@mutant(
    "REQ-11",
    check="check_matches_replies_by_their_order",
    code="another-reply",
    axes="opencv",
    at=Seam(Steering, "answered"),
)
def gives_replies_to_the_last_who_asked(original, self, ticket):
    """Takes a reply for that to the last of all open questions of its kind."""
    asked = [question for question in self.questions if question.ticket == ticket]
    alike = [q for q in self.questions if asked and type(q.request) is type(asked[0].request)]
    for question in asked:
        question.ticket, alike[-1].ticket = alike[-1].ticket, question.ticket
    return original(self, ticket)


@mutant(
    "CNV-2",
    check="check_says_its_object_again_as_it_was",
    code="another-pose",
    axes="unity",
    at=client.BEGINS_TO_STEER,
)
def says_its_object_again_in_the_engine_s_axes(original, self):
    """Converts the pose of the splats when it is sent, and not when it is said again."""
    for key, message in self.newest.items():
        if isinstance(message, ObjectPose):
            self.newest[key] = message._replace(pose=UNITY.from_wire(message.pose))
    return original(self)


@mutant(
    "ACC-7", check=OUT, code="beyond-its-budget", axes="opencv", at=Seam(Session, "send_object")
)
def holds_the_splats_in_single_precision(original, self, pose, *more, **named):
    """Sends positions of cameras as they are, and rounds those of the splats."""
    x, y, z = (float(np.float32(number)) for number in pose.position)
    original(self, pose._replace(position=(x, y, z)), *more, **named)
