"""Poses that an engine is given, and what comes of them on the wire (spec 1.0 chapter 7).

The harness gives a pose in the engine's axes, and reads what became of it.
"""

from collections.abc import Collection, Iterator
from functools import partial
from typing import NamedTuple

from splatbus_conformance.cases.valid.poses import Pose, poses, simpler
from splatbus_conformance.oracle import Engine
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.pose_error import (
    Kind,
    PoseError,
    engine_of,
    off,
    read_pose,
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
        trial.wait(lambda: trial.with_(connection).welcome)
    _give(trial, kind, FIRST)
    trial.rest(REACTION_SECONDS)  # for this, and for what it says again of former connections
    search = f"{trial.requirement.id} {kind}"
    drawn = poses(search, single=greeting.single, unit=True).map(Pose.as_lists)
    heard = trial.with_(connection).heard
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
        yield GivenPose(pose, came, found, _reason(pose, came, former, engine) if found.far else "")
        former = pose
    if former is FIRST:
        trial.not_observable("no pose was given")


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
    heard = trial.with_(connection).heard
    at, nothing = len(heard), True
    _give(trial, kind, pose)
    deadline = trial.peer.clock() + trial.patience
    while (left := deadline - trial.peer.clock()) > 0:
        trial.wait(partial(_more, heard, at, connection), left)
        if len(heard) == at:
            break
        message, at = heard[at], at + 1
        if _is_of(kind, message):
            came, nothing = read(trial, kind, message), False
            yield came
            if came not in before:
                deadline = min(deadline, trial.peer.clock() + RESEND_SECONDS)
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


def read(trial: ClientTrial, kind: Kind, message: Json) -> Pose:
    """The pose that came in a message; skips the check where none can be read."""
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


def said_again(trial: ClientTrial, kind: Kind, *seconds: float) -> tuple[GivenPose, Json | None]:
    """A pose that was sent, and lost with its connection, and what the testee says by itself of
    this kind in that time, when it has come back.
    """
    *_, given = sent(trial, kind, 1, 1)
    heard = trial.with_(trial.connection("msg")).heard
    trial.wait(lambda: any(_is_of(kind, message) for message in heard), *seconds)
    return given, next((message for message in heard if _is_of(kind, message)), None)
