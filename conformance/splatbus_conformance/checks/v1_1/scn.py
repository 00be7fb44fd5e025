"""Checks on `scene`, against what else a server says of its scene (spec 1.1 chapters 7 and 9)."""

from typing import Any

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.moves.image_session import answers, placed
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import integer_in, numbers, show, text_of, whole
from splatbus_conformance.wire.messages import Json, camera_pose

SCENE: Json = {"type": "get_scene"}
TELLS = ("1.1", "capability:scene")
MOST_CAMERAS = 64
ASIDE = Pose((3.0, -5.0, 7.0), (0.5, -0.5, 0.5, 0.5))
IDENTITY = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]


@check(
    "SCN-2", observable="the reply to get_scene, and that it is of this scene", on={SERVER: TELLS}
)
def check_tells_of_its_scene(trial: ServerTrial) -> None:
    """The objects that it lists can be posed, and their bounds are in their own axes; its cameras
    are as many as can be told apart, its origin is that of the init packet.
    """
    connection = trial.greeted("msg")
    told = trial.ask(connection, SCENE | {"id": 2**53 - 1}) or {}
    kind, named = told.get("type"), told.get("id")
    unlike = "another-answer" if told else "no-reply"
    trial.expect(kind == "scene", unlike, f"get_scene was answered by {show(kind)}")
    trial.expect(whole(named) == 2**53 - 1, "wrong-id", f"the id of the reply is {show(named)}")
    held: Any = told.get("objects")
    trial.expect(isinstance(held, list), "not-an-array", f"objects is {show(held)}")
    ids = [it.get("id") if isinstance(it, dict) else None for it in held]
    sound = all(text_of(name, 1, 64) for name in ids) and len(set(map(str, ids))) == len(ids)
    trial.expect(sound, "invalid-ids", f"the ids of objects are {show(ids)}")
    _expect_bounds_of_their_own(trial)
    if trial.facts.grants("objects"):
        _expect_poses_are_known(trial, ids)
    _expect_cameras(trial, told.get("cameras"))
    semantics = (trial.facts.init_packet or {}).get("semantics")
    origin = semantics.get("origin") if isinstance(semantics, dict) else told.get("origin")
    trial.expect(
        numbers(told.get("origin"), 3) and told["origin"] == origin,
        "another-origin",
        f"the origin of the scene is {show(told.get('origin'))}, and {show(origin)} elsewhere",
    )
    trial.delivered += 1


def _expect_poses_are_known(trial: ServerTrial, ids: list[Any]) -> None:
    poser = trial.greeted("msg")
    for name in ids:
        trial.viewer.say(poser, placed(name, AT_REST))
    trial.expect(
        answers(trial, poser), "no-reply", "poses of its objects, then a request: no answer"
    )
    unknown = "unknown_object" in trial.viewer.with_(poser).errors()
    trial.expect(
        not unknown, "unknown-object", f"of the objects {show(ids)} one is not known to object_pose"
    )


def _expect_bounds_of_their_own(trial: ServerTrial) -> None:
    """They stay as they are where the scene is moved; in one that is trained meanwhile they may
    change, and do not change back.
    """
    poser, bounds = trial.commanding(), list[Any]()
    for pose in (AT_REST, ASIDE, AT_REST):
        trial.viewer.say(poser, camera_pose(*pose, kind="point_cloud_pose"))
        told: Any = (trial.ask(poser, SCENE) or {}).get("objects")
        bounds.append([it.get("bounds") for it in told] if isinstance(told, list) else None)
    poser.close()
    at_rest, moved, again = bounds
    trial.expect(
        moved == at_rest or again != at_rest,
        "bounds-moved",
        f"where the scene was put aside, the bounds of its objects are told as {show(moved)}, and"
        f" as {show(at_rest)} before and after",
    )


def _expect_cameras(trial: ServerTrial, count: Any) -> None:
    trial.expect(integer_in(count, 0), "not-a-count", f"cameras is {show(count)}")
    connection, number = trial.dial("msg"), whole(count) or 0
    if number > MOST_CAMERAS:
        return
    replies = [
        trial.ask(connection, {"type": "get_camera_pose", "cam_idx": index}) or {}
        for index in range(2 * number + 2)
    ]
    poses = [[it.get("position"), it.get("rotation")] for it in replies]
    period = next(n for n in range(1, len(poses) + 1) if poses[n:] == poses[:-n] or n == len(poses))
    # Cameras that are alike make the period shorter than their number, and a divisor of it.
    sound = number % period == 0 if number else poses[0] == IDENTITY and period == 1
    trial.expect(
        sound, "another-count", f"there are {number} cameras, and they come again after {period}"
    )


@check("TIM-4", observable="timeRange of a scene whose time is granted", on={SERVER: TELLS})
def check_grants_time_to_the_animated_alone(trial: ServerTrial) -> None:
    """What `welcome` lists, and what `scene` says."""
    granted = trial.facts.grants("time")
    told = trial.ask(trial.greeted("msg"), SCENE) or {}
    trial.expect(
        told.get("timeRange") is not None or not granted,
        "no-time-range",
        "time is granted, and timeRange is null",
    )
    trial.delivered += 1
