"""Checks on how a server of 1.0 takes poses, by its images of the scene of SCENE.md.

Spec 1.0 section 6.1, chapters 5 and 7. 1.0 names no camera of an image. A scene that is known tells
which it was; where nobody knows it, other images of the same pose tell whether it is one of that.
"""

import contextlib
import random
from collections.abc import Iterator

import numpy as np

from splatbus_conformance.cases.malformed.poses import broken_poses
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.checks.v1_0.acc.device import UNKNOWN_SCENE, LegacyFrameCapture, lens_of
from splatbus_conformance.checks.v1_0.buf.servers_device import SHOWN, BufferContents, reading
from splatbus_conformance.checks.v1_0.pos.same_pose import ASKEW, NOWHERE, PoseFrameCapture
from splatbus_conformance.checks.v1_0.pos.servers import ORDERS, REVERSE, in_order
from splatbus_conformance.images.captured import LEGACY_EMPTY, shows_the_scene
from splatbus_conformance.images.hard_views import HardView, turned_about
from splatbus_conformance.images.known_scene import SceneState
from splatbus_conformance.images.memory.reading import Pixels
from splatbus_conformance.images.pinhole import STILL, ObjectPlacement
from splatbus_conformance.images.reprojection import POSES, QUATERNIONS, Misreading
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.moves.writers import in_strings
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet

BY_IMAGES = "of which camera the images of a known scene in CUDA memory are"
BY_LIKENESS = "of which pose the images in CUDA memory are: by the scene, or others of that pose"
MOVED = Pose((0.03, 0.02, 0.01), turned_about(AT_REST.rotation, (0.3, 0.5, 0.8), 0.02))
NUDGE = camera_pose(*MOVED, kind="point_cloud_pose")
"""By this the Gaussians move a little, so that there is a new image."""
OVER: dict[str, tuple[slice, ...]] = {
    "rows stored top-down": np.s_[::-1, :],
    "columns stored from right to left": np.s_[:, ::-1],
    "images turned by 180 degrees": np.s_[::-1, ::-1],
}
TURN = 0.2
"""By how much cameras are turned, in radians, so that each number of a rotation counts."""


@contextlib.contextmanager
def photographing(trial: ServerTrial) -> Iterator[LegacyFrameCapture]:
    """Who moves the camera, and reads what comes of it."""
    with reading(trial) as read:
        yield LegacyFrameCapture(trial, read)


@contextlib.contextmanager
def comparing(trial: ServerTrial) -> Iterator[PoseFrameCapture]:
    """The same, of a scene that nobody knows, too."""
    with reading(trial) as read:
        yield PoseFrameCapture(trial, read)


def turned(pose: Pose, rng: random.Random) -> Pose:
    """The same place, looking a little aside."""
    axis = [rng.choice((-1, 1)) * rng.uniform(0.5, 1.0) for _ in range(3)]
    return Pose(pose.position, turned_about(pose.rotation, axis, TURN))


def expect_shown(it: PoseFrameCapture, camera: Pose, code: str, what: str, *spelled: Json) -> None:
    """The image that comes of this shows the scene from that camera."""
    shown = it.comes_to_show(camera, AT_REST, *spelled)
    it.trial.expect(shown, code, f"{what}: the image is none of the camera at {camera}")


@check("BUF-1", observable="which way up images of a known scene lie", on={SERVER: SHOWN})
def check_rows_in_device_memory_are_bottom_up(trial: ServerTrial) -> None:
    """The image of a camera at the origin: as it lies it shows the scene, and not turned over."""
    with reading(trial) as read:
        stored = LegacyFrameCapture(trial, read, NOWHERE).at_origin()
    if lens_of(stored) is None:
        for words, over in OVER.items():
            turned_over = BufferContents(stored.color[over], stored.depth[over])
            trial.expect(lens_of(turned_over) is None, "turned-over", f"the images fit {words}")
        trial.not_observable(UNKNOWN_SCENE)


@check("BUF-6", observable="by which depths images show a known scene", on={SERVER: SHOWN})
def check_depth_in_device_memory_is_planar(trial: ServerTrial) -> None:
    """The image of a camera at the origin: as they are, its depths are those of the scene."""
    with reading(trial) as read:
        stored = LegacyFrameCapture(trial, read, NOWHERE).at_origin()
    if lens_of(stored) is None:
        for words, depth in other_depths(stored.depth):
            trial.expect(
                lens_of(BufferContents(stored.color, depth)) is None,
                "other-depths",
                f"the images fit {words}",
            )
        trial.not_observable(UNKNOWN_SCENE)


def other_depths(depth: Pixels) -> Iterator[tuple[str, Pixels]]:
    """What may have been stored in place of planar depths, made planar."""
    seen = np.isfinite(depth) & (depth > 0) & (depth != LEGACY_EMPTY)
    with np.errstate(divide="ignore"):
        yield "inverse depths", np.where(seen, 1.0 / depth, np.inf).astype(np.float32)
    for factor in (1e-3, 1e-2, 1e2, 1e3):
        scaled = np.where(seen, depth * factor, np.inf).astype(np.float32)
        yield f"depths of which {1 / factor:g} make a scene unit", scaled


@check("CNV-1", observable=BY_IMAGES, on={SERVER: SHOWN})
def check_poses_in_device_memory_are_camera_to_world(trial: ServerTrial) -> None:
    """The camera of an image is where and turned as the pose said."""
    judge_readings(trial, POSES)


@check("CNV-3", observable=BY_IMAGES, on={SERVER: SHOWN})
def check_rotations_in_device_memory_have_w_last(trial: ServerTrial) -> None:
    """The rotation of the camera of an image has its scalar last, and its sign."""
    judge_readings(trial, QUATERNIONS)


def judge_readings(trial: ServerTrial, wrong: tuple[Misreading, ...]) -> None:
    """An image that fits one of these readings of its pose, and not the pose, is a violation.

    The pose of the Gaussians may have been read so, too.
    """
    with photographing(trial) as it:
        photograph = it.take(ASKEW, AT_REST)
        if it.shows(photograph):
            return
        view, rest = photograph.view(), it.seen_from(AT_REST, photograph).view()
        for each in wrong:
            read = photograph._replace(camera=it.lens._replace(pose=each.pose(view)))
            for scene in (STILL, ObjectPlacement(each.pose(rest))):
                fits = shows_the_scene(read, SceneState(scene))
                trial.expect(not fits, each.code, f"the images fit {each.words}")
        trial.not_observable(f"the image of a camera at {ASKEW} is none of it, and fits nothing")


@check("POS-5", observable=BY_LIKENESS, on={SERVER: SHOWN})
def check_takes_members_by_name_in_device_memory(trial: ServerTrial) -> None:
    """Poses with the members of position and rotation in every order, and rotation before
    position.
    """
    rng = random.Random(trial.seed)
    with comparing(trial) as it:
        for number, order in enumerate(trial.each([REVERSE], ORDERS, quick=4, full=48)):
            camera = turned((it.left, it.right)[number % 2], rng)
            what, written = in_order(camera_pose(*camera), order)
            expect_shown(it, camera, "pose-not-shown", what, written)


@check("POS-6", observable=BY_LIKENESS, on={SERVER: SHOWN}, may_crash=True)
def check_keeps_the_former_pose_in_device_memory(trial: ServerTrial) -> None:
    """Poses that miss or mistype members, lie beyond single precision, or have no unit quaternion;
    after each the Gaussians are moved, so that a new image shows where the camera is.
    """
    with comparing(trial) as it:
        it.learn(HardView(it.left, MOVED))
        broken = broken_poses(camera_pose(*it.askew))
        for each in trial.each(broken, kind=lambda it: it.kind, spare=0):
            expect_shown(it, it.left, "not-applied", "a good pose")
            outcome = trial.outcome_on_msg(trial.mover(), packet(each.payload))
            what = f"a pose with {each.what} ({each.requirement})"
            if outcome in ("ignores", "reports", "replies"):
                outcome = "keeps" if it.comes_to_show(it.left, MOVED, NUDGE) else "applies"
            elif outcome == "closes":
                it.take(it.askew, AT_REST)
            trial.judge(outcome, what)


@check("POS-7", observable=BY_LIKENESS, on={SERVER: SHOWN})
def check_the_newest_camera_is_shown_in_device_memory(trial: ServerTrial) -> None:
    """Several poses at once, of which the last has to be shown."""
    rng = random.Random(trial.seed)
    with comparing(trial) as it:
        around = it.left, it.right
        for number in trial.each(range(100 if trial.thorough else 6)):
            others = [turned(rng.choice(around), rng) for _ in range(rng.randrange(1, 6))]
            last = turned(around[number % 2], rng)
            row = [camera_pose(*each) for each in (*others, last)]
            expect_shown(it, last, "not-the-newest", f"{len(row)} poses at once", *row)


@check("POS-11", observable=BY_LIKENESS, on={SERVER: SHOWN})
def check_one_connection_has_control_in_device_memory(trial: ServerTrial) -> None:
    """Two connections send poses; the first has control until it closes, and then the second."""
    if trial.facts.alone["msg"]:
        trial.not_observable("the server serves one connection at a time on the message channel")
    with comparing(trial) as it:
        it.learn(HardView(it.right, AT_REST), HardView(it.left, MOVED))
        expect_shown(it, it.left, "not-applied", "a good pose")
        second = trial.dial("msg")
        first = trial.mover()
        trial.answers(second)
        trial.require_all(first, second)
        trial.viewer.say(second, camera_pose(*it.right))
        trial.answers(second)
        kept = it.comes_to_show(it.left, MOVED, NUDGE)
        trial.expect(
            kept,
            "applied-without-control",
            "the camera went where a connection has put it that has no control",
        )
        trial.pass_control(second)
        expect_shown(
            it,
            it.right,
            "control-not-passed-on",
            "a pose of the next, once the connection in control has closed",
        )


@check("POS-13", observable=BY_LIKENESS, on={SERVER: SHOWN})
def check_the_scene_in_device_memory_is_at_rest_at_first(trial: ServerTrial) -> None:
    """A server that was just started is told of cameras, and nothing of the Gaussians."""
    if not trial.testee.expendable:
        trial.not_observable("a server that others have used may have been told otherwise")
    with comparing(trial) as before:
        before.learn(HardView(before.left, AT_REST))
    trial.end_testee()
    with reading(trial) as read:
        it = PoseFrameCapture(trial, read, before)
        trial.pass_control(trial.dial("msg"))
        if it.comes_to_show(it.left, AT_REST, camera_pose(*it.left)):
            return
        expect_shown(it, it.right, "pose-not-shown", "with the Gaussians at rest")
        trial.violated(
            "not-at-rest", "the Gaussians were not at rest before any pose of theirs had come"
        )


@check("JSN-11", observable=BY_LIKENESS, on={SERVER: SHOWN}, may_crash=True)
def check_takes_strings_for_numbers_or_not_in_device_memory(trial: ServerTrial) -> None:
    """A pose of a 1.0 client, with every number as a string: taken whole, or not at all."""
    with comparing(trial) as it:
        there, here = HardView(it.askew, MOVED), HardView(it.left, MOVED)
        it.learn(there, here)
        for written in trial.each([in_strings(camera_pose(*it.askew))]):
            expect_shown(it, it.left, "not-applied", "a good pose")
            outcome = trial.outcome_on_msg(trial.mover(), packet(encode(written)))
            if outcome in ("ignores", "replies", "reports"):
                shown = it.comes_to_show_one(here, there, by=NUDGE)
                outcome = {here: "keeps", there: "accepts", None: "applies"}[shown]
            trial.judge(outcome, "a pose whose numbers are strings")
