"""Checks on objects: where they are, how large, what frames say of them (spec 1.1 chapter 7)."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.poses import broken_poses
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.hard_views import turned_about
from splatbus_conformance.images.known_scene import COLOR_BUDGET, NOTHING, ExactImage, render
from splatbus_conformance.images.pinhole import STILL, ObjectPlacement, rigid, told_of
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.moves.image_session import (
    ImageSession,
    errors_after,
    image_session,
    placed,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import BALL, DEFAULT
from splatbus_conformance.wire.json_values import is_number, numbers, show
from splatbus_conformance.wire.messages import Json, camera_pose, encode

MOVES_OBJECTS = ("1.1", "frames", "capability:objects")
KNOWN = (*MOVES_OBJECTS, "pixels", "scene")
WHOLE = 0.99
CLOSENESS = 1e-5
"""How far a number of a pose in a frame may be from the one that was sent, absolute or relative."""
LEAST, MOST = LIMITS["min_scale"], LIMITS["max_scale"]
SMALLEST, LARGEST = 0.25, 2.5
"""Scales with which something is still seen."""
BAD_SCALES: tuple[Any, ...] = (
    *(0, -1.0, LEAST / 2, MOST * 2, 1e300, -LEAST, "1", None, True, [], [1.0], {}),
)
BAD_NAMES: tuple[Any, ...] = ("", None, 5, True, [], [DEFAULT], {}, "x" * 65)
SPARE = 5
"""So many broken poses are sent in the quick profile beside one of each kind."""
UNICODE = st.characters(exclude_categories=["Cs"])
"""What `text` draws from by itself, but that asks the codec about each, for seconds."""
Moved = dict[str, tuple[Pose, float]]


def arrangements(names: list[str]) -> st.SearchStrategy[Moved]:
    """Some of these objects moved, turned and scaled, so that one still sees them."""
    part = st.floats(-0.4, 0.4)
    axis = st.tuples(part, part, st.just(1.0))

    def pose(x: float, y: float, z: float, about: Any, turn: float, scale: float) -> Any:
        return Pose((x, y, z), turned_about(AT_REST.rotation, about, turn)), scale

    poses = st.builds(pose, part, part, part, axis, part, st.floats(SMALLEST, LARGEST))
    return st.dictionaries(st.sampled_from(names), poses, min_size=1)


def listed(names: list[str]) -> list[Moved]:
    """Each object by itself, smaller and nearer, then all of them, then none."""
    pose = Pose((0.1, -0.2, 0.3), turned_about(AT_REST.rotation, (0.2, 1.0, 0.1), 0.3))
    each: list[Moved] = [{name: (pose, 0.5)} for name in names[:4]]
    return [*each, dict.fromkeys(names, (pose, 1.5)), {DEFAULT: (AT_REST, 1.0)}]


def moving(trial: ServerTrial, quick: int, full: int) -> Iterator[tuple[Moved, CapturedFrame]]:
    """Objects where they were put, and the image that came of it."""
    names = trial.facts.objects()
    with image_session(trial) as it:
        where: Moved = {}
        for moved in trial.each(listed(names), arrangements(names), quick=quick, full=full):
            where |= moved
            sent = [placed(name, pose, scale) for name, (pose, scale) in moved.items()]
            yield where, it.look(*sent)
            trial.delivered += 1


def exact_of(trial: ServerTrial, where: Moved, seen: CapturedFrame) -> ExactImage:
    """What the known scene looks like with its objects there."""
    default, ball = (
        ObjectPlacement(rigid(*pose), scale)
        for pose, scale in (where.get(n, (AT_REST, 1.0)) for n in BOTH)
    )
    return render(seen.camera, trial.facts.setting(seen.frame, default, ball))


BOTH = (DEFAULT, BALL)


@check("OBJ-5", observable="the colours of images of a known scene", on={SERVER: KNOWN})
def check_objects_are_where_they_were_put(trial: ServerTrial) -> None:
    """Each object of the scene is moved, turned and scaled, by itself and with the others."""
    for where, seen in moving(trial, quick=6, full=400):
        exact = exact_of(trial, where, seen)
        right = (exact.color_error(seen.color) <= COLOR_BUDGET)[exact.certain]
        if not right.size:
            continue
        trial.expect(
            right.mean() >= WHOLE,
            "other-colours",
            f"{1 - right.mean():.0%} of the colours are not those of a scene with {_words(where)}",
        )


@check("OBJ-6", observable="the depths of images of a known scene", on={SERVER: KNOWN})
def check_depth_is_in_world_units(trial: ServerTrial) -> None:
    """The depths of objects that are larger or smaller than they were."""
    compared = 0
    for where, seen in moving(trial, quick=3, full=200):
        exact, depth = exact_of(trial, where, seen), seen.planar()
        both = exact.certain & (exact.what != NOTHING) & np.isfinite(depth)
        if not both.any():
            continue
        compared += 1
        right = exact.depth_is_right(depth)[both].mean()
        ratio = float(np.median(depth[both] / exact.depth[both]))
        trial.expect(
            right >= WHOLE,
            "other-depths",
            f"{1 - right:.0%} of the depths are not those of the scene with {_words(where)};"
            f" half of them are {ratio:.4g} times what they should be, or less",
        )
    if not compared:
        trial.not_observable("no image showed any of the scene")


@check("OBJ-7", observable="the objects that frames list", on={SERVER: ("1.1", "frames")})
def check_frames_list_what_was_moved(trial: ServerTrial) -> None:
    """The Gaussians are moved as 1.0 does it, then each object of the scene."""
    if trial.facts.grants("objects"):
        for where, seen in moving(trial, quick=4, full=300):
            _expect_listed(trial, where, seen.frame)
    trial.peer.close_all()
    it = ImageSession(trial)
    for number in range(3):
        pose = Pose((0.125 * number, 0.0, 0.25), turned_about(AT_REST.rotation, (0, 1, 0), 0.25))
        seen = it.look(camera_pose(*pose, kind="point_cloud_pose"))
        _expect_listed(trial, {DEFAULT: (pose, 1.0)}, seen.frame)
        trial.delivered += 1
    it.look(camera_pose(*AT_REST, kind="point_cloud_pose"))


def _expect_listed(trial: ServerTrial, where: Moved, frame: Json) -> None:
    """A frame lists each object that was moved, and where it is."""
    for name, (pose, scale) in where.items():
        told = told_of(frame, name)
        if told is None:
            at_rest = pose == AT_REST and scale == 1.0
            what = f"which was put to {pose} with scale {scale}"
            trial.expect(at_rest, "object-not-listed", f"a frame does not list {name}, {what}")
            continue
        said = f"a frame tells of {name} that it is at {show(told)}"
        trial.expect(
            _same(told, pose, scale),
            "another-placement",
            f"{said}; it was put to {pose} with scale {scale}",
        )


def _put(it: ImageSession, name: str, pose: Pose, scale: float) -> None:
    """Put an object there; skips the check where frames do not tell so."""
    told = told_of(it.look(placed(name, pose, scale)).frame, name)
    if not _same(told, pose, scale):
        it.trial.not_observable(f"frames tell of {name} that it is at {show(told)} (OBJ-7)")


def _same(told: Json | None, pose: Pose, scale: float) -> bool:
    told = told or {}
    position: Any = told.get("position")
    rotation, size = told.get("rotation"), told.get("scale")
    if not (numbers(position, 3) and numbers(rotation, 4) and is_number(size)):
        return False
    q = np.array(rotation, np.float64)
    turned = min(np.abs(sign * q - pose.rotation).max() for sign in (1, -1))
    return bool(
        np.allclose(position, pose.position, rtol=CLOSENESS, atol=CLOSENESS)
        and turned <= CLOSENESS
        and np.isclose(float(size or 0.0), scale, rtol=CLOSENESS, atol=0.0)
    )


@check("OBJ-2", observable="the objects that frames list", on={SERVER: MOVES_OBJECTS})
def check_point_cloud_pose_is_of_the_default_object(trial: ServerTrial) -> None:
    """The default object is moved by one message and by the other, in turns."""
    pose = Pose((0.25, -0.125, 0.5), turned_about(AT_REST.rotation, (1, 0, 0), 0.2))
    further = Pose((-0.25, 0.125, 0.25), turned_about(AT_REST.rotation, (0, 0, 1), 0.2))
    with image_session(trial) as it:
        for number in trial.each(range(3)):
            _put(it, DEFAULT, pose, 0.5 + number)
            told = told_of(it.look(camera_pose(*further, kind="point_cloud_pose")).frame, DEFAULT)
            trial.expect(
                _same(told, further, 1.0),
                "another-placement",
                f"{DEFAULT} was put to {further} by point_cloud_pose after it had a scale of"
                f" {0.5 + number}; a frame has it at {show(told)}",
            )
            trial.delivered += 1


@check("OBJ-3", observable="the error", on={SERVER: ("1.1", "capability:objects")})
def check_reports_unknown_objects(trial: ServerTrial) -> None:
    """Names that the scene has not, good poses otherwise."""
    known, poser = trial.facts.objects(), trial.greeted("msg")
    if trial.facts.scene is None:
        trial.not_observable("which objects the scene has is not known without get_scene")
    names = st.text(UNICODE, min_size=1, max_size=64).filter(lambda name: name not in known)
    near = [f"{known[0]} "[:64], known[0].upper() + "?", "camera", "__proto__", "x" * 64]
    for name in trial.each([it for it in near if it not in known], names, quick=8, full=300):
        errors, answered = errors_after(trial, poser, encode(placed(name, AT_REST)))
        trial.expect(answered, "no-reply", f"after the object {show(name)} nothing was answered")
        codes = [(it.get("code"), it.get("pointer")) for it in errors]
        trial.expect(
            codes == [("unknown_object", "/object")],
            "another-error" if codes else "no-error",
            f"a pose of the object {show(name)} was answered by {show(codes or 'no error')}",
        )
        trial.delivered += 1


def broken_object_poses(good: Json) -> Iterator[tuple[str, Json, str]]:
    """Every way to break OBJ-1 in a pose of an object: what it is, the message, and its kind."""
    for each in broken_poses(good):
        yield each.what, each.message, each.kind
    absent = {name: value for name, value in good.items() if name != "object"}
    yield "no object", absent, "no object"
    for value in BAD_NAMES:
        yield (told := f"the object {show(value)}"), good | {"object": value}, told
    for value in BAD_SCALES:
        yield (told := f"the scale {show(value)}"), good | {"scale": value}, told


@check("OBJ-4", observable="where frames have the object afterwards", on={SERVER: MOVES_OBJECTS})
def check_keeps_the_former_pose_of_an_object(trial: ServerTrial) -> None:
    """Poses of an object that miss or mistype members, and scales that are none."""
    good = placed(DEFAULT, Pose((0.5, 0.25, 0.75), AT_REST.rotation), 0.75)
    home = Pose((-0.125, 0.125, 0.25), turned_about(AT_REST.rotation, (0, 1, 0), 0.25))
    with image_session(trial) as it:
        _put(it, DEFAULT, home, 1.25)
        for what, message, _ in trial.each(
            list(broken_object_poses(good)), kind=lambda case: case[-1], spare=SPARE
        ):
            known = len(it.frames)
            it.say(message)
            if not it.answers():
                trial.judge(it.end(), f"a pose of an object with {what}")
                trial.peer.close_all()
                it = ImageSession(trial)
                it.look(placed(DEFAULT, home, 1.25))
                continue
            it.look()
            for frame in it.frames[known:]:
                told = told_of(frame, DEFAULT)
                kept = _same(told, home, 1.25)
                said = f"a pose of an object with {what}; a frame has it at {show(told)}"
                trial.judge("keeps" if kept else "applies", said)
            trial.delivered += 1
        it.look(placed(DEFAULT, AT_REST))


@check("OBJ-4", observable="where frames have each object afterwards", on={SERVER: MOVES_OBJECTS})
def check_keeps_the_former_pose_of_each_object(trial: ServerTrial) -> None:
    """The same of every object of the scene, by a rotation and by a scale that are none."""
    home = Pose((-0.125, 0.125, 0.25), AT_REST.rotation)
    away = Pose((0.5, 0.25, 0.75), (0.0, 0.0, 0.0, 2.0))
    with image_session(trial) as it:
        for name in trial.each(trial.facts.objects()):
            _put(it, name, home, 1.25)
            for broken in (placed(name, away, 1.0), placed(name, home, 0.0)):
                it.say(broken)
                if not it.answers():
                    trial.judge(it.end(), f"a broken pose of {name}")
                    return
                seen = told_of(it.look().frame, name)
                kept = _same(seen, home, 1.25)
                what = f"a pose of {name} with a rotation or a scale that is none; it is at"
                trial.judge("keeps" if kept else "applies", f"{what} {show(seen)}")
            trial.delivered += 1


@check("OBJ-5", observable="the scale of objects in frames", on={SERVER: MOVES_OBJECTS})
def check_a_scale_that_is_absent_is_1(trial: ServerTrial) -> None:
    """Each object of the scene is scaled, and then posed without a scale."""
    here, there = (Pose((0.125, 0.25, z), AT_REST.rotation) for z in (0.5, 0.75))
    with image_session(trial) as it:
        for name in trial.each(trial.facts.objects()):
            _put(it, name, here, 1.5)
            seen = told_of(it.look(placed(name, there)).frame, name)
            what = f"{name} had a scale, and a pose without one came; a frame has it at"
            trial.expect(_same(seen, there, 1.0), "another-placement", f"{what} {show(seen)}")
            trial.delivered += 1


def _words(where: Moved) -> str:
    return " and ".join(
        f"{name} at {pose}, scale {scale:g}"
        for name, (pose, scale) in where.items()
        if (pose, scale) != (AT_REST, 1.0)
    ) or str(STILL)
