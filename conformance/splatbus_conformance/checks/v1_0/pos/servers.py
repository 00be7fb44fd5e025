"""Checks on how servers take poses, as the `camera` of frames shows it (spec 1.0 section 6.1)."""

import itertools
from collections.abc import Sequence

from hypothesis import strategies as st

from splatbus_conformance.cases.malformed.poses import MOST, WITHIN_NORMS, broken_poses
from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.images.pinhole import told_of
from splatbus_conformance.trials.moves.camera_control import CameraControl, camera_of
from splatbus_conformance.trials.moves.frame_readers import fell_silent
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import DEFAULT
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

FAR: Json = camera_pose((30.5, -20.25, 10.125), (0.5, -0.5, 0.5, 0.5))
ROTATION = (0.1, 0.3, 0.5, 0.8062257748298549)
"""No two of its parts are the same, so that none can be taken for another unseen."""
Order = tuple[Sequence[str], Sequence[str], bool]
"""Of the members of position and rotation; and whether rotation comes first."""
REVERSE: Order = "zyx", "wzyx", True
ORDERS: st.SearchStrategy[Order] = st.tuples(
    st.permutations("xyz"), st.permutations("xyzw"), st.booleans()
)
SPARE = 10
"""So many broken poses are sent in the quick profile beside one of each kind."""
LIMITS_OF_POSES = (
    *(camera_pose(rotation=tuple(norm * part for part in ROTATION)) for norm in WITHIN_NORMS),
    *(camera_pose((MOST, -MOST, 0.0)), camera_pose((5e-324, -1e-310, -0.0))),
    camera_pose((2.0**53 + 2.0, 1e22, 0.1)),
    *(camera_pose(rotation=turn) for turn in ((1.0, 0.0, 0.0, 0.0), (0.0, 0.6, -0.8, 0.0))),
    camera_pose((1.0, 2.0, 3.0), (-0.0, 0.0, 0.0, -1.0)),
)


@check(
    "POS-5", observable="a frame shows each number where its name says", on={SERVER: ("frames",)}
)
def check_takes_members_by_name(trial: ServerTrial) -> None:
    """Poses with the members of position and rotation in every order, and rotation before
    position.
    """
    steering, poser = CameraControl(trial), trial.dial("msg")
    for number, order in enumerate(trial.each([REVERSE], ORDERS, quick=20, full=144)):
        pose = camera_pose((1.5 + number, 2.5, -3.5), ROTATION)
        what, written = in_order(pose, order)
        outcome = steering.takes(poser, pose, encode(written))
        seen = f"{what}; the camera is at {steering.now()}"
        trial.judge(outcome, seen if outcome == "ignores" else what)


def in_order(pose: Json, order: Order) -> tuple[str, Json]:
    """A pose with its members in this order, and that in words."""
    places, turns, swapped = order
    written = pose | {
        "position": {name: pose["position"][name] for name in places},
        "rotation": {name: pose["rotation"][name] for name in turns},
    }
    if swapped:
        written["position"] = written.pop("position")
    return f"a pose with position {', '.join(places)} and rotation {', '.join(turns)}", written


@check(
    "POS-6",
    observable="the frames that follow show the former camera",
    on={SERVER: ("frames",)},
    may_crash=True,
)
def check_keeps_the_former_pose(trial: ServerTrial) -> None:
    """Poses that miss or mistype members, lie beyond single precision, or have no unit quaternion;
    after each the Gaussians are moved, so that a new image shows where the camera is.
    """
    steering, poser = CameraControl(trial), trial.dial("msg")
    home = camera_pose((0.25, 0.5, -0.75), ROTATION)
    trial.expect(steering.shows(poser, home), "not-applied", "no frame shows a good pose")
    for each in trial.each(broken_poses(FAR), kind=lambda it: it.kind, spare=SPARE):
        if poser.ended:
            poser = trial.dial("msg")
            trial.expect(steering.shows(poser, home), "not-applied", "no frame shows a good pose")
        outcome = steering.outcome_of(poser, each.payload)
        what = f"a pose with {each.what} ({each.requirement})"
        trial.judge(outcome, f"{what}; the camera is at {steering.now()}")


@check(
    "POS-6",
    observable="where the frames that follow list the Gaussians",
    on={SERVER: ("frames",)},
    may_crash=True,
)
def check_keeps_the_former_pose_of_the_gaussians(trial: ServerTrial) -> None:
    """The same of the Gaussians, which frames list; after each broken pose the camera is moved, so
    that there is a new image.
    """
    reader, poser, places = trial.reading(), trial.dial("msg"), itertools.count(1)
    home = camera_pose((0.0, 0.125, 0.25), kind="point_cloud_pose")

    def listed(*before: Json) -> Json | None:
        """What a frame lists that was rendered after these, and with the camera elsewhere."""
        camera = camera_pose((next(places) / 8, -2.0, -1.0))
        for message in (*before, camera):
            trial.viewer.say(poser, message)
        frame = trial.sees(reader, camera)
        if frame is None:
            fell_silent(trial, reader, "no frame came after the camera had been moved")
        return told_of(frame, DEFAULT)

    for each in trial.each(
        broken_poses(FAR | {"type": home["type"]}), kind=lambda it: it.kind, spare=0
    ):
        if poser.ended:
            poser = trial.dial("msg")
        former = listed(home)
        if former is None:
            trial.not_observable("frames do not list where the Gaussians are")
        outcome = trial.outcome_on_msg(poser, packet(each.payload))
        if outcome in ("ignores", "reports", "replies"):
            outcome = "keeps" if listed() == former else "applies"
        trial.judge(outcome, f"a pose of the Gaussians with {each.what} ({each.requirement})")
        trial.delivered += 1


@check("POS-7", observable="frames show poses next to the limits", on={SERVER: ("frames",)})
def check_poses_at_the_limits_are_poses(trial: ServerTrial) -> None:
    """Rotations whose norm is just as far from 1 as it may be, half-turns and none, the greatest
    numbers that there are, and the least.
    """
    steering, poser = CameraControl(trial), trial.dial("msg")
    home = camera_pose((0.25, 0.5, -0.75), ROTATION)
    for pose in trial.each(LIMITS_OF_POSES):
        trial.expect(steering.shows(poser, home), "not-applied", "no frame shows a good pose")
        shown = steering.shows(poser, pose)
        trial.expect(
            shown,
            "pose-not-shown",
            f"the valid pose {show(pose)}; the camera is at {steering.now()}",
        )
        trial.delivered += 1


@check("POS-7", observable="frames show poses of any timestamp", on={SERVER: ("frames",)})
def check_poses_of_any_time_are_poses(trial: ServerTrial) -> None:
    """Timestamps in milliseconds, that go back, below zero, none, and of a client that comes later:
    which pose is the newest depends on none of them.
    """
    steering, poser = CameraControl(trial), trial.dial("msg")
    for number, moment in enumerate(trial.each(MOMENTS)):
        if number == len(MOMENTS) // 2:
            poser.close()
            poser = trial.dial("msg")
        told: Json = {} if moment is None else {"timestamp": moment}
        pose = camera_pose((0.5 + number, -0.5, -3.0), ROTATION) | told
        shown = steering.shows(poser, pose)
        trial.expect(
            shown, "pose-not-shown", f"no frame shows a pose with the timestamp {show(moment)}"
        )
        trial.delivered += 1


MOMENTS = (1.7e12, 5.0, None, -3, 0, 1e308, 12.5, -1e308, 3.0, 5e-324)
"""Of which half come from the next client."""


@check(
    "POS-14",
    observable="a frame shows all of such a pose, or none of it, or the connection is closed",
    on={SERVER: ("frames",)},
    may_crash=True,
)
def check_takes_poses_of_no_time_or_not(trial: ServerTrial) -> None:
    """A pose of a 1.0 client, whose timestamp is no number; and then a good one."""
    steering, poser = CameraControl(trial), trial.dial("msg")
    trial.expect(steering.shows(poser, camera_pose()), "not-applied", "no frame shows a good pose")
    for number, moment in enumerate(trial.each(NO_MOMENTS)):
        poser = trial.dial("msg") if poser.ended else poser
        pose = camera_pose((3.0 + number, 0.5, -3.0), ROTATION) | {"timestamp": moment}
        outcome = steering.outcome_of(poser, encode(pose))
        if outcome == "applies" and steering.shows_now(pose):
            outcome = "accepts"
        trial.judge(outcome, f"a pose with the timestamp {show(moment)}")


NO_MOMENTS = ("now", None, True, [1.0], {"seconds": 1.0})


@check(
    "POS-7",
    observable="the camera that frames name after poses in one piece",
    on={SERVER: ("frames",)},
)
def check_the_last_of_one_piece_is_shown(trial: ServerTrial) -> None:
    """Several poses that arrive together; nothing but the Gaussians is moved after them."""
    steering, poser = CameraControl(trial), trial.dial("msg")
    trial.expect(steering.shows(poser, camera_pose()), "not-applied", "no frame shows a good pose")
    for number in trial.each(range(1, 40 if trial.thorough else 6)):
        row = [camera_pose((float(number), 0.5 * place, -1.0)) for place in range(1 + number)]
        poser.send(b"".join(packet(encode(each)) for each in row))
        last = steering.nudged(poser)[-1]
        trial.expect(
            last.shows(camera_of(row[-1])),
            "not-the-newest",
            f"{len(row)} poses came in one piece, and then the Gaussians were moved: the camera is"
            f" at {last}, and not at {camera_of(row[-1])}",
        )
        trial.delivered += 1


@check(
    "POS-11",
    observable="frames show the poses of the connection that was first, then those of the next",
    on={SERVER: ("frames",)},
)
def check_one_connection_has_control(trial: ServerTrial) -> None:
    """One connection sends a broken pose, the next a good one, and a third another; then the one in
    control closes, and the next to have sent a good pose has it.
    """
    steering = CameraControl(trial)
    first, second = _served(trial), _served(trial)
    if first.ended or second.ended:
        trial.not_observable("the server serves one connection at a time on the message channel")
    early: Connection | None = _served(trial)
    if first.ended or (early and early.ended):  # it serves two, and may close either (CHN-13)
        trial.peer.close_all()
        steering, early = CameraControl(trial), None
        first, second = _served(trial), _served(trial)
    wrong = broken_poses(FAR)[0].payload
    for number in trial.each(range(4)):
        here = camera_pose((1.0 + number, 0.0, 0.0))
        there = camera_pose((-1.0 - number, 0.0, 0.0))
        if early is not None:
            trial.outcome_on_msg(early, packet(wrong))
        trial.expect(
            steering.shows(first, here),
            "control-not-given",
            "no frame shows the pose of the connection that was first to send a valid one",
        )
        wanted, since = camera_of(here), steering.count
        trial.outcome_on_msg(second, packet(encode(there)))
        seen = steering.nudged(first, since)
        trial.expect(
            all(camera.shows(wanted) for camera in seen),
            "applied-without-control",
            f"the camera went to {seen[-1]} with a pose of a connection that has no control",
        )
        first.close()
        trial.expect(
            steering.shows(second, there),
            "control-not-passed-on",
            "no frame shows the pose of the next connection once that in control has closed",
        )
        trial.delivered += 1
        second.close()
        if early is not None and early.ended:
            early = _served(trial)
        first, second = _served(trial), _served(trial)


def _served(trial: ServerTrial) -> Connection:
    connection = trial.dial("msg")
    trial.answers(connection)
    return connection
