"""Checks on the poses that a client sends (spec 1.0 chapters 7 and 8): the harness gives a pose in
the engine's axes, and reads on the wire what became of it.
"""

import math
import time
from collections.abc import Collection, Iterator
from functools import partial
from typing import NamedTuple

from splatbus_conformance.cases.valid.poses import Pose, poses, simpler
from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.oracle import Engine, exact
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.pose_error import (
    ORDER,
    Kind,
    PoseError,
    engine_of,
    off,
    read_pose,
    rotation_budget,
    why,
)
from splatbus_conformance.trials.testee.adapter import AdapterBroken
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

COMMANDS: dict[Kind, str] = {"camera_pose": "send_camera", "point_cloud_pose": "send_object"}
RESEND_SECONDS = 1.0
"""A client that sends other poses unasked shows the one that it was given within this time."""
SCENE = "default"
"""The object that a `point_cloud_pose` moves (OBJ-2)."""
DISTANCES = (
    (10.0, "up to 10 units from the origin"),
    (1e4, "up to 10,000 units away"),
    (math.inf, "farther away"),
)
OBSERVABLE = "the pose on the wire, against the oracle's for the pose that the engine was given"


FIRST = Pose((3.0, -1.0, 2.0), (0.4, -0.2, 0.8, 0.4))
"""Given on each connection before any that is judged."""


class GivenPose(NamedTuple):
    """A pose that was given to the engine, and what came of it."""

    pose: Pose
    came: Pose
    off: PoseError
    """How far that is from the right one."""
    reason: str
    """What explains it, where it is far."""


def sent(trial: ClientTrial, kind: Kind, quick: int, full: int) -> Iterator[GivenPose]:
    """Poses given to the engine, and what came of each on the wire."""
    greeting = trial.greeting
    engine, connection = engine_of(greeting, kind), trial.connection("msg")
    if trial.facts.speaks_1_1("msg"):
        trial.wait(lambda: trial.role.with_(connection).welcome)
    _give(trial, kind, FIRST)
    trial.rest(REACTION_SECONDS)  # for this, and for what it says again of former connections
    search = f"{trial.requirement.id} {kind}"
    drawn = poses(search, single=greeting.single, unit=True).map(Pose.as_lists)
    heard = trial.role.with_(connection).heard
    before = {pose for m in heard if _is_of(kind, m) and (pose := read_pose(m))}
    former = FIRST
    for case in trial.each(drawn=drawn, quick=quick, full=full, simpler=simpler, search=search):
        pose = Pose.of(case)
        p, q = engine.position_to_wire(pose.position), engine.quaternion_to_wire(pose.rotation)
        size = trial.role.width, trial.role.height
        if not off(_on_wire(engine, former), p, q, single=greeting.single, size=size).far:
            continue  # an engine may take a camera that hardly moved for one at rest
        for came in _arriving(trial, connection, kind, pose, before):
            found = off(came, p, q, single=greeting.single, size=size)
            if not found.far and (came not in before or found.position <= 1.0):
                break
        before.add(came)
        trial.delivered += 1
        yield GivenPose(pose, came, found, _reason(pose, came, former, engine) if found.far else "")
        former = pose


def _reason(pose: Pose, came: Pose, former: Pose, engine: Engine) -> str:
    known = why(pose, came, engine)
    late = "" if known else why(former, came, engine, right=True)
    return known or (late and f"for the pose that was given before, {late}")


def _on_wire(engine: Engine, pose: Pose) -> Pose:
    p, q = engine.position_to_wire(pose.position), engine.quaternion_to_wire(pose.rotation)
    return Pose(tuple(map(float, p)), tuple(map(float, q)))


def _give(trial: ClientTrial, kind: Kind, pose: Pose) -> None:
    trial.ask(COMMANDS[kind], position=list(pose.position), rotation=list(pose.rotation))


def _arriving(
    trial: ClientTrial, connection: Connection, kind: Kind, pose: Pose, before: Collection[Pose]
) -> Iterator[Pose]:
    """Each pose that comes after this one was to be sent, until none more is waited for.

    A client may say others unasked: its last one, when it has come back, or what its user does.
    One that it has said before answers nothing; after one that is new the right one follows soon.
    """
    heard = trial.role.with_(connection).heard
    at, nothing = len(heard), True
    _give(trial, kind, pose)
    deadline = time.monotonic() + trial.patience
    while (left := deadline - time.monotonic()) > 0:
        trial.wait(partial(_more, heard, at, connection), left)
        if len(heard) == at:
            break
        message, at = heard[at], at + 1
        if _is_of(kind, message):
            came, nothing = _read(trial, kind, message), False
            yield came
            if came not in before:
                deadline = min(deadline, time.monotonic() + RESEND_SECONDS)
    if nothing and connection.ended:
        trial.not_observable("the testee closed the connection")
    if nothing and before:
        trial.violated(
            "not-sent", f"{COMMANDS[kind]} of {pose}: no {kind} came, though others did before"
        )
    if nothing:
        raise AdapterBroken(f"it said that {pose} was taken, and no {kind} came")


def _is_of(kind: Kind, message: Json) -> bool:
    """It is a pose of this kind, by whichever message says it (OBJ-2)."""
    if kind == "point_cloud_pose" and message.get("type") == "object_pose":
        return message.get("object") == SCENE
    return message.get("type") == kind


def _read(trial: ClientTrial, kind: Kind, message: Json) -> Pose:
    if (pose := read_pose(message)) is None:
        trial.not_observable(f"the {kind} that came has no pose that can be read (POS-1)")
    if message.get("type") == "object_pose" and message.get("scale", 1) != 1:
        trial.violated(
            "unasked-scale",
            f"{COMMANDS[kind]} has no scale, and came with that of {message['scale']}",
        )
    return pose


def _more(heard: list[Json], than: int, connection: Connection) -> bool:
    return len(heard) > than or connection.ended is not None


def judge_mapping(trial: ClientTrial, kind: Kind, quick: int, full: int) -> None:
    """A pose that is another one than was given is a violation; one with fewer digits is none."""
    for pose, came, found, known in sent(trial, kind, quick, full):
        if found.far:
            reason = known or f"it is {found.away_by} away"
            trial.violated("another-pose", f"{COMMANDS[kind]} of {pose} became {came}: {reason}")


@check("CNV-1", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:send_camera")})
def check_camera_poses_are_camera_to_world(trial: ClientTrial) -> None:
    """Camera poses in the engine's axes, near every edge of what is allowed."""
    judge_mapping(trial, "camera_pose", 40, 1000)


@check(
    "CNV-1",
    observable="the pose that the testee says by itself when it has come back",
    on={CLIENT: ("msg", "adapter:send_camera", "returns:msg")},
)
def check_says_its_camera_again_as_it_was(trial: ClientTrial) -> None:
    """The message channel is lost after a pose was sent, and comes back; a camera that is said
    again then is the one that was sent.
    """
    judge_what_is_said_again(trial, "camera_pose")


@check(
    "CNV-2",
    observable="the pose of the splats that the testee says by itself when it has come back",
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
    again, size = _read(trial, kind, said), (trial.role.width, trial.role.height)
    if off(again, *map(exact, before), single=trial.greeting.single, size=size).far:
        reason = why(given.pose, again, engine_of(trial.greeting, kind))
        trial.violated(
            "another-pose",
            f"{before} was said again as {again}" + (f": {reason}" if reason else ""),
        )
    trial.delivered += 1


def said_again(trial: ClientTrial, kind: Kind, *seconds: float) -> tuple[GivenPose, Json | None]:
    """A pose that was sent, and lost with its connection, and what the testee says by itself of
    this kind in that time, when it has come back.
    """
    *_, given = sent(trial, kind, 1, 1)
    heard = trial.role.with_(trial.connection("msg")).heard
    trial.wait(lambda: any(_is_of(kind, message) for message in heard), *seconds)
    return given, next((message for message in heard if _is_of(kind, message)), None)


@check("CNV-2", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:send_object")})
def check_object_poses_are_object_to_world(trial: ClientTrial) -> None:
    """Poses of the splats in the engine's axes, near every edge of what is allowed."""
    judge_mapping(trial, "point_cloud_pose", 40, 1000)


@check("CNV-3", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:send_camera")})
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


@check("CNV-4", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:send_camera", "axes:unity")})
def check_unity_s_row(trial: ClientTrial) -> None:
    """Poses of cameras and of the splats, from Unity's axes."""
    judge_row(trial)


@check("CNV-5", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:send_camera", "axes:unreal")})
def check_unreal_s_row(trial: ClientTrial) -> None:
    """Poses of cameras and of the splats, from Unreal's axes and centimetres."""
    judge_row(trial)


@check("CNV-6", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:send_camera", "axes:blender")})
def check_blender_s_rows(trial: ClientTrial) -> None:
    """Poses of cameras by one row, and of the splats by the other, from Blender's axes."""
    judge_row(trial)


@check("CNV-7", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:send_camera", "axes:opengl")})
def check_opengl_s_row(trial: ClientTrial) -> None:
    """Poses of cameras and of the splats, from OpenGL's axes, world and camera."""
    judge_row(trial)


@check("ACC-1", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:send_camera")})
def check_numbers_keep_their_digits(trial: ClientTrial) -> None:
    """Poses of cameras, and of the splats where the adapter can send them, whose numbers need all
    their digits; what is lost is told in pixels too.

    Where the mapping only moves and negates numbers they arrive as they were; elsewhere its own
    rounding (ACC-7) is allowed for.
    """
    judge_digits(trial, scaled=2.0, turned=2.0)


@check("ACC-7", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:send_camera")})
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
