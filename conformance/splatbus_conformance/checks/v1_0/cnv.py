"""Checks on axes and conventions (spec 1.0 chapters 5, 7 and 8): the poses that a client sends, and
those of a server's images, of its frames and of its replies.
"""

import math

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import CLIENT, SERVER, SERVER_DEVICE, SERVER_HOST, Place, check
from splatbus_conformance.images.reprojection import (
    AS_SPECIFIED,
    MOMENTS,
    POSES,
    QUATERNIONS,
    Misreading,
    named,
)
from splatbus_conformance.oracle import exact
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.frame_capture import FrameCapture
from splatbus_conformance.trials.moves.gallery import Gallery, gallery
from splatbus_conformance.trials.moves.given_poses import (
    COMMANDS,
    RESEND_SECONDS,
    read,
    said_again,
    sent,
)
from splatbus_conformance.trials.moves.pose_error import (
    ORDER,
    Kind,
    PoseError,
    engine_of,
    off,
    pose_in,
    rotation_budget,
    why,
)
from splatbus_conformance.trials.moves.survey import first_view, judge_readings, moves
from splatbus_conformance.trials.server import ServerTrial

PIXELS = ("1.1", "frames", "pixels")
SHOWN = {SERVER_HOST: PIXELS, SERVER_DEVICE: ("cuda", "device")}
CAMERAS_ASKED = 8
DISTANCES = (
    (10.0, "up to 10 units from the origin"),
    (1e4, "up to 10,000 units away"),
    (math.inf, "farther away"),
)


def judge_mapping(trial: ClientTrial, kind: Kind, quick: int, full: int) -> None:
    """A pose that is another one than was given is a violation; one with fewer digits is none."""
    for pose, came, found, known in sent(trial, kind, quick, full):
        if found.far:
            reason = known or f"it is {found.away_by} away"
            trial.violated("another-pose", f"{COMMANDS[kind]} of {pose} became {came}: {reason}")


@check("CNV-1", on={CLIENT: ("msg", "adapter:send_camera")})
def check_camera_poses_are_camera_to_world(trial: ClientTrial) -> None:
    """Camera poses in the engine's axes, near every edge of what is allowed."""
    judge_mapping(trial, "camera_pose", 40, 1000)


@check(
    "CNV-1",
    on={CLIENT: ("msg", "adapter:send_camera", "returns:msg")},
)
def check_says_its_camera_again_as_it_was(trial: ClientTrial) -> None:
    """The message channel is lost after a pose was sent, and comes back; a camera that is said
    again then is the one that was sent.
    """
    judge_what_is_said_again(trial, "camera_pose")


@check(
    "CNV-2",
    on={CLIENT: ("msg", "adapter:send_object", "returns:msg")},
)
def check_says_its_object_again_as_it_was(trial: ClientTrial) -> None:
    """The same of the splats."""
    judge_what_is_said_again(trial, "point_cloud_pose")


def judge_what_is_said_again(trial: ClientTrial, kind: Kind) -> None:
    """A pose that was sent is lost with its connection; what is said then has to be that pose."""
    given, said = said_again(trial, kind, RESEND_SECONDS)
    before = given.came
    if given.off.far:
        trial.not_observable(f"{before} came of {given.pose} while the connection lasted (CNV)")
    if said is None:
        trial.not_observable(f"the testee says no {kind} again when it has come back")
    again, size = read(trial, kind, said), (trial.role.width, trial.role.height)
    if off(again, *map(exact, before), single=trial.greeting.single, size=size).far:
        reason = why(given.pose, again, engine_of(trial.greeting, kind))
        trial.violated(
            "another-pose",
            f"{before} was said again as {again}" + (f": {reason}" if reason else ""),
        )


@check("CNV-2", on={CLIENT: ("msg", "adapter:send_object")})
def check_object_poses_are_object_to_world(trial: ClientTrial) -> None:
    """Poses of the splats in the engine's axes, near every edge of what is allowed."""
    judge_mapping(trial, "point_cloud_pose", 40, 1000)


@check("CNV-3", on={CLIENT: ("msg", "adapter:send_camera")})
def check_quaternions_are_hamilton_with_w_last(trial: ClientTrial) -> None:
    """Poses whose quaternion would be another with its members in another order or of other sign.

    A pose that is wrong in another way is left to CNV-1.
    """
    for pose, came, found, reason in sent(trial, "camera_pose", 20, 200):
        if found.far:
            if reason == ORDER:
                trial.violated("another-order", f"send_camera of {pose} became {came}: {reason}")
            trial.not_observable(f"the pose that came is wrong in another way: {reason or came}")


def judge_row(trial: ClientTrial) -> None:
    """Cameras, and objects where the adapter can send them, by the engine's row of the table."""
    judge_mapping(trial, "camera_pose", 30, 500)
    if "send_object" in trial.greeting.can:
        judge_mapping(trial, "point_cloud_pose", 30, 500)


@check("CNV-4", on={CLIENT: ("msg", "adapter:send_camera", "axes:unity")})
def check_unity_s_row(trial: ClientTrial) -> None:
    """Poses of cameras and of the splats, from Unity's axes."""
    judge_row(trial)


@check("CNV-5", on={CLIENT: ("msg", "adapter:send_camera", "axes:unreal")})
def check_unreal_s_row(trial: ClientTrial) -> None:
    """Poses of cameras and of the splats, from Unreal's axes and centimetres."""
    judge_row(trial)


@check("CNV-6", on={CLIENT: ("msg", "adapter:send_camera", "axes:blender")})
def check_blender_s_rows(trial: ClientTrial) -> None:
    """Poses of cameras by one row, and of the splats by the other, from Blender's axes."""
    judge_row(trial)


@check("CNV-7", on={CLIENT: ("msg", "adapter:send_camera", "axes:opengl")})
def check_opengl_s_row(trial: ClientTrial) -> None:
    """Poses of cameras and of the splats, from OpenGL's axes, world and camera."""
    judge_row(trial)


@check("ACC-1", on={CLIENT: ("msg", "adapter:send_camera")})
def check_numbers_keep_their_digits(trial: ClientTrial) -> None:
    """Poses of cameras, and of the splats where the adapter can send them, whose numbers need all
    their digits; what is lost is told in pixels too.

    Where the mapping only moves and negates numbers they arrive as they were; elsewhere its own
    rounding (ACC-7) is allowed for.
    """
    judge_digits(trial, scaled=2.0, turned=2.0)


@check("ACC-7", on={CLIENT: ("msg", "adapter:send_camera")})
def check_axes_change_exactly_on_the_way_out(trial: ClientTrial) -> None:
    """Poses of cameras, and of the splats where the adapter can send them, from the engine's axes
    to the wire's: positions exact, or within half an ULP where they are scaled; quaternions within
    4u.
    """
    judge_digits(trial, scaled=0.5, turned=1.0)


def judge_digits(trial: ClientTrial, scaled: float, turned: float) -> None:
    """Poses of each kind that can be sent; what came of them has to keep to the budgets: so many
    ULP where positions are scaled, none elsewhere, and so many times that of ACC-7 for quaternions.
    """
    for kind, command in COMMANDS.items():
        if command not in trial.greeting.can:
            continue
        engine, quaternions = engine_of(trial.greeting, kind), rotation_budget(trial.greeting, kind)
        for pose, _, found, _ in sent(trial, kind, 60, 1500):
            _measure(trial, pose, found, scaled * (engine.scale != 1), turned * quaternions)
            if found.far:  # a wrong mapping, however often: each pose may cost a wait
                break
    trial.expect_within_budgets()


def _measure(
    trial: ClientTrial, pose: Pose, found: PoseError, position_budget: float, rotation_budget: float
) -> None:
    words = str(pose)
    trial.measured("position", found.position, position_budget, "ULP", words)
    trial.measured("quaternion", found.rotation, rotation_budget, "u", words)
    trial.measured("angle", found.angle, None, "rad", words)
    band = next(name for most, name in DISTANCES if found.away <= most)
    image = f"image of {trial.role.width}x{trial.role.height}, camera {band}"
    trial.measured(image, found.pixels, None, "px", words)


@check("CNV-1", on=SHOWN, given=gallery)
def check_poses_are_camera_to_world(trial: ServerTrial, place: Place, images: Gallery) -> None:
    """The camera of an image, of its frame and of a reply is where and turned as was said."""
    _judge_poses(trial, place, images, POSES)


@check("CNV-3", on=SHOWN, given=gallery)
def check_rotations_are_hamilton_with_w_last(
    trial: ServerTrial, place: Place, images: Gallery
) -> None:
    """The rotation of an image, of its frame and of a reply has its scalar last, and its sign."""
    _judge_poses(trial, place, images, QUATERNIONS)


def _judge_poses(
    trial: ServerTrial, place: Place, images: Gallery, wrong: tuple[Misreading, ...]
) -> None:
    if place == "host":
        _judge_names(trial, wrong)
    images.judge(wrong)
    if place == "host":
        _judge_reply(trial, wrong)


def _judge_names(trial: ServerTrial, wrong: tuple[Misreading, ...]) -> None:
    """A frame that names a pose by one of these wrong readings is a violation."""
    first = first_view(trial)
    wanted = moves(first)[-1]
    shown = FrameCapture(trial).take(wanted)
    meant = named(shown.camera.pose, wanted)
    if meant in wrong:
        trial.violated(
            "misnamed-pose",
            f"a camera was sent to {wanted}; its frame names {shown.pose}: {meant.words}",
        )
    if meant is not AS_SPECIFIED:
        trial.not_observable(f"a camera was sent to {wanted}, and a frame names {shown.pose}")


def _judge_reply(trial: ServerTrial, wrong: tuple[Misreading, ...]) -> None:
    """The first view is of a camera that the scene comes with, or has nothing to do with any."""
    first, connection = first_view(trial), trial.dial("msg")
    for index in range(CAMERAS_ASKED):
        reply = trial.ask(connection, {"type": "get_camera_pose", "cam_idx": index}) or {}
        pose = pose_in(reply)
        meant = pose and named(first.camera.pose, pose)
        if pose is None or meant is AS_SPECIFIED:
            return
        if meant in wrong:
            trial.violated(
                "misreported-pose",
                f"camera {index} is told as {pose}; the first frame was rendered at {first.pose}:"
                f" {meant.words}",
            )


@check("IMG-5", on={SERVER: PIXELS})
def check_images_are_of_the_camera_that_is_named(trial: ServerTrial) -> None:
    """Images from around the first view fit the named cameras, not those before."""
    judge_readings(trial, MOMENTS)
