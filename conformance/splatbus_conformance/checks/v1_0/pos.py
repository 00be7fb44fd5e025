"""Checks on how servers take poses: by the camera that frames name, or, of 1.0, by the images
(spec 1.0 section 6.1).
"""

import random
from collections.abc import Sequence
from operator import attrgetter

import numpy as np
from hypothesis import strategies as st

from splatbus_conformance.cases.malformed.poses import (
    MOST,
    WITHIN_NORMS,
    BrokenPose,
    broken_poses,
    in_strings,
)
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import SERVER, SERVER_DEVICE, SERVER_HOST, Cases, Place, check
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.hard_views import staged, turned_about
from splatbus_conformance.images.pinhole import rigid, told_of
from splatbus_conformance.images.reprojection import (
    APART,
    AS_SPECIFIED,
    CLOSE,
    FITS,
    SCENES,
    ViewPair,
    agreement,
    explain,
    named,
)
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.moves.device_gallery import DeviceSteering, reading
from splatbus_conformance.trials.moves.exchanges.exchange import in_use
from splatbus_conformance.trials.moves.frame_capture import AT_REST, FrameCapture
from splatbus_conformance.trials.moves.frame_readers import fell_silent
from splatbus_conformance.trials.moves.gallery import ROTATION, HostSteering, Steering, steering
from splatbus_conformance.trials.moves.survey import alike, first_view, likeness, moves
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import DEFAULT
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

FRAMES = ("frames",)
PIXELS = ("1.1", "frames", "pixels")
STEERED = {SERVER_HOST: FRAMES, SERVER_DEVICE: ("cuda", "device")}
FAR = camera_pose(*HostSteering.askew)
Order = tuple[Sequence[str], Sequence[str], bool]
"""Of the members of position and rotation; and whether rotation comes first."""
REVERSE: Order = "zyx", "wzyx", True
ORDERS: st.SearchStrategy[Order] = st.tuples(
    st.permutations("xyz"), st.permutations("xyzw"), st.booleans()
)
SPARE = 10
"""So many broken poses are sent in the quick profile beside one of each kind."""
MOMENTS = (1.7e12, 5.0, None, -3, 0, 1e308, 12.5, -1e308, 3.0, 5e-324)
"""Of which half come from the next client."""
LIMITS_OF_POSES = (
    *(Pose(AT_REST.position, tuple(norm * part for part in ROTATION)) for norm in WITHIN_NORMS),
    *(Pose(at, AT_REST.rotation) for at in ((MOST, -MOST, 0.0), (5e-324, -1e-310, -0.0))),
    Pose((2.0**53 + 2.0, 1e22, 0.1), AT_REST.rotation),
    *(Pose(AT_REST.position, turn) for turn in ((1.0, 0.0, 0.0, 0.0), (0.0, 0.6, -0.8, 0.0))),
    Pose((1.0, 2.0, 3.0), (-0.0, 0.0, 0.0, -1.0)),
)
NO_MOMENTS = ("now", None, True, [1.0], {"seconds": 1.0})
TURN = 0.2
"""By how much cameras are turned, in radians, so that each number of a rotation counts."""


def turned(pose: Pose, rng: random.Random) -> Pose:
    """The same place, looking a little aside."""
    axis = [rng.choice((-1, 1)) * rng.uniform(0.5, 1.0) for _ in range(3)]
    return Pose(pose.position, turned_about(pose.rotation, axis, TURN))


@check(
    "POS-5",
    on=STEERED,
    given=steering,
    cases={
        SERVER_HOST: Cases([REVERSE], ORDERS, quick=20, full=144),
        SERVER_DEVICE: Cases([REVERSE], ORDERS, quick=4, full=48),
    },
)
def check_takes_members_by_name(trial: ServerTrial, _: Place, it: Steering, order: Order) -> None:
    """Poses with the members of position and rotation in every order, and rotation before
    position.
    """
    it.put(it.left)
    camera = turned(it.right, random.Random(f"{trial.seed} {trial.number}"))
    what, written = in_order(camera_pose(*camera), order)
    outcome = it.takes(camera, written)
    trial.judge(outcome, f"{what}; {it.where()}" if outcome == "ignores" else what)


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
    on=STEERED,
    given=steering,
    cases=lambda trial, place, it: Cases(
        broken_poses(camera_pose(*it.askew)),
        kind=attrgetter("kind"),
        spare=SPARE if place == "host" else 0,
    ),
    may_crash=True,
)
def check_keeps_the_former_pose(
    trial: ServerTrial, _: Place, it: Steering, each: BrokenPose
) -> None:
    """Poses that miss or mistype members, lie beyond single precision, or have no unit quaternion;
    after each the Gaussians are moved, so that a new image shows where the camera is.
    """
    it.put((it.left, it.right)[trial.number % 2])
    outcome = it.outcome_of(each.payload)
    trial.judge(outcome, f"a pose with {each.what} ({each.requirement}); {it.where()}")


@check(
    "POS-6",
    on={SERVER: FRAMES},
    given=ServerTrial.reading,
    cases=Cases(broken_poses(FAR | {"type": "point_cloud_pose"}), kind=attrgetter("kind"), spare=0),
    may_crash=True,
)
def check_keeps_the_former_pose_of_the_gaussians(
    trial: ServerTrial, reader: Connection, each: BrokenPose
) -> None:
    """The same of the Gaussians, which frames list; after each broken pose the camera is moved, so
    that there is a new image.
    """

    def listed(*before: Json) -> Json | None:
        """What a frame lists that was rendered after these, and with the camera elsewhere."""
        camera = camera_pose((trial.number + len(before) / 2, -2.0, -1.0))
        for message in (*before, camera):
            trial.viewer.say(in_use(trial), message)
        frame = trial.sees(reader, camera)
        if frame is None:
            fell_silent(trial, reader, "no frame came after the camera had been moved")
        return told_of(frame, DEFAULT)

    former = listed(camera_pose((0.0, 0.125, 0.25), kind="point_cloud_pose"))
    if former is None:
        trial.not_observable("frames do not list where the Gaussians are")
    outcome = trial.outcome_on_msg(in_use(trial), packet(each.payload))
    if outcome in ("ignores", "reports", "replies"):
        outcome = "keeps" if listed() == former else "applies"
    trial.judge(outcome, f"a pose of the Gaussians with {each.what} ({each.requirement})")


@check("POS-7", on={SERVER: FRAMES}, given=HostSteering, cases=Cases(LIMITS_OF_POSES))
def check_poses_at_the_limits_are_poses(_: ServerTrial, it: HostSteering, pose: Pose) -> None:
    """Rotations whose norm is just as far from 1 as it may be, half-turns and none, the greatest
    numbers that there are, and the least.
    """
    it.put(it.left)
    it.put(pose, "pose-not-shown")


@check("POS-7", on={SERVER: FRAMES}, given=CameraControl, cases=Cases(MOMENTS))
def check_poses_of_any_time_are_poses(
    trial: ServerTrial, control: CameraControl, moment: float | None
) -> None:
    """Timestamps in milliseconds, that go back, below zero, none, and of a client that comes later:
    which pose is the newest depends on none of them.
    """
    if trial.number == len(MOMENTS) // 2:
        in_use(trial).close()
    told: Json = {} if moment is None else {"timestamp": moment}
    shown = control.shows(in_use(trial), camera_pose((0.5 + trial.number, -0.5, -3.0)) | told)
    what = f"no frame shows a pose with the timestamp {show(moment)}"
    trial.expect(shown, "pose-not-shown", what)


@check(
    "POS-7",
    on=STEERED,
    given=steering,
    cases=lambda trial, *_: Cases(range(1, 40 if trial.thorough else 6)),
)
def check_the_last_of_one_piece_is_shown(
    trial: ServerTrial, _: Place, it: Steering, number: int
) -> None:
    """Several poses that arrive together; nothing but the Gaussians is moved after them."""
    rng, (there, here) = random.Random(f"{trial.seed} {number}"), (it.left, it.right)
    it.put(there)
    row = [turned(rng.choice((here, there)), rng) for _ in range(number)] + [turned(here, rng)]
    outcome = it.takes(row[-1], *(camera_pose(*each) for each in row))
    what = f"{len(row)} poses came in one piece, and no image is of the last, {row[-1]}"
    trial.expect(outcome == "accepts", "not-the-newest", f"{what}; {it.where()}")


@check("POS-7", on={SERVER: PIXELS})
def check_the_newest_camera_is_shown(trial: ServerTrial) -> None:
    """Several poses at once, of which the last has to be shown; far ones, too."""
    first, rng = first_view(trial, 0.0), random.Random(trial.seed)
    capture = FrameCapture(trial)
    capture.take(_near(rng, first.pose))
    for _ in trial.each(range(500 if trial.thorough else 25)):
        for _ in range(rng.randrange(6)):
            trial.move(camera_pose(*_near(rng, first.pose)))
        wanted = _near(rng, first.pose)
        shown = capture.take(wanted, insists=False)
        if named(shown.camera.pose, wanted) is None:
            trial.violated(
                "another-pose",
                f"after a camera at {wanted} the newest frame names one at {shown.pose}, 5 s later",
            )


@check("POS-7", on={SERVER: PIXELS})
def check_the_newest_scene_is_shown(trial: ServerTrial) -> None:
    """The Gaussians are moved and turned, so that what is seen is what a camera would see that had
    moved instead; one does.
    """
    first = first_view(trial)
    capture, around = FrameCapture(trial), moves(first)
    before, instead = capture.take(around[0]), capture.take(around[-1])
    stage = staged(Pose(*first.pose), around[-1])
    after = capture.take(*stage)
    capture.take(around[0])
    same = _same_depths(instead, after)
    if same >= FITS and same - _same_depths(instead, first) >= APART:
        return
    moved, still = (
        ViewPair(before.view(), view, pose)
        for view, pose in ((after.view(), rigid(*stage.scene)), (instead.view(), rigid(*AT_REST)))
    )
    shares = explain([moved], (AS_SPECIFIED, *SCENES))
    right, best = float(shares[0]), float(shares[1:].max())
    control = agreement(still, AS_SPECIFIED)
    if min(best, control) < FITS or best - right < APART:
        trial.not_observable(
            f"the images cannot tell: {right:.0%} of the points are where the pose of the"
            f" Gaussians puts them, and {best:.0%} elsewhere; where a camera had moved instead it"
            f" were {control:.0%}"
        )
    if not alike(capture.take(Pose(*first.pose)), first):
        trial.not_observable("the scene moves by itself, or had been moved before")
    likeliest = SCENES[int(shares[1:].argmax())]
    trial.violated(
        likeliest.code,
        f"the images fit {likeliest.words}: {best:.0%} of the points, and {right:.0%} if it was",
    )


@check("POS-13", on={SERVER: PIXELS})
def check_the_scene_is_at_rest_at_first(trial: ServerTrial) -> None:
    """From where the first image was seen, with the identity as the pose of the Gaussians."""
    if not trial.testee.expendable:
        trial.not_observable("a server that others have used may have been told otherwise")
    first = first_view(trial)
    capture, elsewhere = FrameCapture(trial), moves(first)[0]
    capture.take(elsewhere)
    told = capture.take(Pose(*first.pose))
    if told.depth.shape != first.depth.shape:
        trial.not_observable("the server has changed the size of its images")
    if told.frame.get("time") != first.frame.get("time"):
        trial.not_observable("the server shows another time than at first")
    if alike(told, first):
        return
    capture.take(elsewhere)
    if not alike(capture.take(Pose(*first.pose)), told):
        trial.not_observable("the scene moves by itself")
    trial.violated(
        "not-at-rest",
        f"{1 - likeness(told, first):.0%} of the pixels changed when the Gaussians were given the"
        " identity pose, which they had to have before",
    )


def _same_depths(some: CapturedFrame, others: CapturedFrame) -> float:
    """The share of pixels that hold the same depth in two images, of those that hold any."""
    if some.depth.shape != others.depth.shape:
        return 0.0
    seen = some.covered() | others.covered()
    same = np.isclose(some.planar(), others.planar(), rtol=CLOSE, atol=0)
    return float(same[seen].mean()) if seen.any() else 0.0


@check("POS-13", on={SERVER_DEVICE: STEERED[SERVER_DEVICE]})
def check_the_scene_of_a_new_server_is_at_rest(trial: ServerTrial, _: Place) -> None:
    """A server that was just started is told of cameras, and nothing of the Gaussians."""
    if not trial.testee.expendable:
        trial.not_observable("a server that others have used may have been told otherwise")
    with reading(trial) as read:
        it = DeviceSteering(trial, read)
    trial.end_testee()
    with reading(trial) as it.read:
        trial.pass_control(trial.dial("msg"))
        if it.takes(it.left, camera_pose(*it.left)) == "accepts":
            return
        it.put(it.right, "pose-not-shown")
    what = "the Gaussians were not at rest before any pose of theirs had come"
    trial.violated("not-at-rest", what)


@check(
    "POS-11",
    on=STEERED,
    given=steering,
    cases={SERVER_HOST: Cases(range(4)), SERVER_DEVICE: Cases(range(1))},
)
def check_one_connection_has_control(
    trial: ServerTrial, _: Place, it: Steering, number: int
) -> None:
    """One connection sends a broken pose, the next a good one, and a third another; then the one in
    control closes, and the next to have sent a good pose has it.
    """
    first, second, *early = _rivals(trial)
    for each in early:
        trial.outcome_on_msg(each, packet(broken_poses(FAR)[0].payload))
    it.put(it.left, "control-not-given", first)
    trial.outcome_on_msg(second, packet(encode(camera_pose(*it.right))))
    kept = it.keeps()
    what = f"a connection that has no control sent a pose; {it.where()}"
    trial.expect(kept, "applied-without-control", what)
    it.put(it.right, "control-not-passed-on", second)


def _rivals(trial: ServerTrial) -> list[Connection]:
    """Message connections that are served at a time: three, or two."""
    found = _served(trial, 3)
    if any(each.ended for each in found):  # it serves two, and may close either (CHN-13)
        found = _served(trial, 2)
    if any(each.ended for each in found):
        trial.not_observable("the server serves one connection at a time on the message channel")
    return found


def _served(trial: ServerTrial, count: int) -> list[Connection]:
    for former in trial.peer.connections:
        if former.channel == "msg":
            former.close()
    found = [trial.dial("msg") for _ in range(count)]
    for each in found:
        trial.answers(each)
    return found


@check("POS-14", on=STEERED, given=steering, cases=Cases(NO_MOMENTS), may_crash=True)
def check_takes_poses_of_no_time_or_not(
    trial: ServerTrial, _: Place, it: Steering, moment: object
) -> None:
    """A pose of a 1.0 client, whose timestamp is no number: taken whole, or not at all."""
    it.put((it.left, it.right)[trial.number % 2])
    pose = camera_pose(*it.askew) | {"timestamp": moment}
    outcome = it.outcome_of(encode(pose), it.askew)
    trial.judge(outcome, f"a pose with the timestamp {show(moment)}")


@check("JSN-11", on=STEERED, given=steering, may_crash=True)
def check_takes_strings_for_numbers_or_not(trial: ServerTrial, _: Place, it: Steering) -> None:
    """A pose of a 1.0 client, with every number as a string: taken whole, or not at all."""
    it.put(it.left)
    outcome = it.outcome_of(encode(in_strings(camera_pose(*it.askew))), it.askew)
    trial.judge(outcome, "a pose whose numbers are strings")


def _near(rng: random.Random, pose: Pose) -> Pose:
    """A pose about another one; now and then far from it."""
    spread = rng.choice((0.1, 1.0, 1e3))
    return Pose(
        tuple(number + rng.uniform(-spread, spread) for number in pose.position),
        turned_about(pose.rotation, [rng.gauss(0, 1) for _ in range(3)], rng.uniform(-3, 3)),
    )
