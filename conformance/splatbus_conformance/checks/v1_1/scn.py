"""Checks on `scene`, against what else a server says of its scene (spec 1.1 chapters 7 and 9)."""

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.trials.controls import CAMERA_REQUEST
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.moves.image_session import answers, placed
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import (
    array,
    numbers,
    show,
    whole,
    within,
)
from splatbus_conformance.wire.messages import Json, camera_pose

SCENE: Json = {"type": "get_scene"}
TELLS = ("1.1", "capability:scene")
MOST_CAMERAS = 64
ASIDE = Pose((3.0, -5.0, 7.0), (0.5, -0.5, 0.5, 0.5))
IDENTITY = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]


@check("SCN-2", on={SERVER: TELLS})
def check_tells_of_its_scene(trial: ServerTrial) -> None:
    """The objects that it lists can be posed, and their bounds are in their own axes; its cameras
    are as many as can be told apart, its origin is that of the init packet.
    """
    told = trial.ask(trial.greeted("msg"), SCENE | {"id": 2**53 - 1})
    kind = within(told, "type")
    unlike = "another-answer" if told else "no-reply"
    trial.expect(kind == "scene", unlike, f"get_scene was answered by {show(kind)}")
    ids = [within(it, "id") for it in array(within(told, "objects"))]
    _expect_bounds_of_their_own(trial)
    if trial.facts.grants("objects"):
        poser = trial.greeted("msg")
        for name in ids:
            trial.viewer.say(poser, placed(name, AT_REST))
        answered = answers(trial, poser)
        trial.expect(answered, "no-reply", "poses of its objects, then a request: no answer")
        unknown = "unknown_object" in trial.with_(poser).errors()
        why = f"of the objects {show(ids)} one is not known to object_pose"
        trial.expect(not unknown, "unknown-object", why)
    _expect_cameras(trial, within(told, "cameras"))
    origin, semantics = within(told, "origin"), within(trial.facts.init_packet, "semantics")
    elsewhere = semantics.get("origin") if isinstance(semantics, dict) else origin
    why = f"the origin of the scene is {show(origin)}, and {show(elsewhere)} elsewhere"
    trial.expect(numbers(origin, 3) and origin == elsewhere, "another-origin", why)


def _expect_bounds_of_their_own(trial: ServerTrial) -> None:
    """They stay as they are where the scene is moved; in one that is trained meanwhile they may
    change, and do not change back.
    """
    poser, bounds = trial.commanding(), []
    for pose in (AT_REST, ASIDE, AT_REST):
        trial.viewer.say(poser, camera_pose(*pose, kind="point_cloud_pose"))
        held = within(trial.ask(poser, SCENE), "objects")
        bounds.append([within(it, "bounds") for it in array(held)])
    poser.close()
    at_rest, moved, again = bounds
    trial.expect(
        moved == at_rest or again != at_rest,
        "bounds-moved",
        f"where the scene was put aside, the bounds of its objects are told as {show(moved)}, and"
        f" as {show(at_rest)} before and after",
    )


def _expect_cameras(trial: ServerTrial, count: object) -> None:
    connection, number = trial.dial("msg"), whole(count) or 0
    if number > MOST_CAMERAS:
        return
    replies = [
        trial.ask(connection, CAMERA_REQUEST | {"cam_idx": it}) for it in range(2 * number + 2)
    ]
    poses = [[within(it, "position"), within(it, "rotation")] for it in replies]
    period = next(n for n in range(1, len(poses) + 1) if poses[n:] == poses[:-n] or n == len(poses))
    # Cameras that are alike make the period shorter than their number, and a divisor of it.
    sound = number % period == 0 if number else poses[0] == IDENTITY and period == 1
    why = f"there are {number} cameras, and they come again after {period}"
    trial.expect(sound, "another-count", why)


@check("TIM-4", on={SERVER: TELLS})
def check_grants_time_to_the_animated_alone(trial: ServerTrial) -> None:
    """What `welcome` lists, and what `scene` says."""
    ranges = within(trial.ask(trial.greeted("msg"), SCENE), "timeRange") is not None
    told = "time is granted, and timeRange is null"
    trial.expect(ranges or not trial.facts.grants("time"), "no-time-range", told)
