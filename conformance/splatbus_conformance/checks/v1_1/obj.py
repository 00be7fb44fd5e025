"""Checks on objects: where they are, how large, what frames say of them (spec 1.1 chapter 7)."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.poses import broken_poses
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.hard_views import turned_about
from splatbus_conformance.images.known_scene import COLOR_BUDGET, NOTHING, ExactImage, render
from splatbus_conformance.images.pinhole import ObjectPlacement, rigid, told_of
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.moves.image_session import (
    ImageSession,
    at_rest,
    errors_after,
    expect_error,
    image_session,
    placed,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import BALL, DEFAULT
from splatbus_conformance.wire.json_values import finite, finites, show, within
from splatbus_conformance.wire.messages import Json, camera_pose, encode

MOVES_OBJECTS = ("1.1", "frames", "capability:objects")
KNOWN = (*MOVES_OBJECTS, "pixels", "scene")
WHOLE = 0.99
CLOSENESS = 1e-5
"""How far a number of a pose in a frame may be from the one that was sent, absolute or relative."""
LEAST, MOST = LIMITS["min_scale"], LIMITS["max_scale"]
BAD_SCALES: tuple[Any, ...] = (
    *(0, -1.0, LEAST / 2, MOST * 2, 1e300, -LEAST, "1", None, True, [], [1.0], {}),
)
BAD_NAMES: tuple[Any, ...] = ("", None, 5, True, [], [DEFAULT], {}, "x" * 65)
SPARE = 5
"""So many broken poses are sent in the quick profile beside one of each kind."""
UNICODE = st.characters(exclude_categories=["Cs"])
"""What `text` draws from by itself, but that asks the codec about each, for seconds."""
HOME = Pose((-0.125, 0.125, 0.25), turned_about(AT_REST.rotation, (0, 1, 0), 0.25))
Moved = dict[str, tuple[Pose, float]]


def arrangements(names: list[str]) -> st.SearchStrategy[Moved]:
    """Some of these objects moved, turned and scaled, so that one still sees them."""
    part = st.floats(-0.4, 0.4)
    poses = st.builds(
        lambda position, axis, turn: Pose(position, turned_about(AT_REST.rotation, axis, turn)),
        *(st.tuples(part, part, part), st.tuples(part, part, st.just(1.0)), part),
    )
    there = st.tuples(poses, st.floats(0.25, 2.5))
    return st.dictionaries(st.sampled_from(names), there, min_size=1)


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
            yield where, it.look(*(placed(name, *there) for name, there in moved.items()))


def expect_as_rendered(
    trial: ServerTrial,
    code: str,
    right_in: Callable[[ExactImage, CapturedFrame], Any],
    quick: int,
    full: int,
) -> None:
    """Images of moving objects are those of the known scene, by what is right where both show
    something.
    """
    compared = False
    for where, seen in moving(trial, quick, full):
        default, ball = (
            ObjectPlacement(rigid(*pose), scale)
            for pose, scale in (where.get(name, (AT_REST, 1.0)) for name in (DEFAULT, BALL))
        )
        exact = render(seen.camera, trial.facts.setting(seen.frame, default, ball))
        right = right_in(exact, seen)
        if right.size:
            compared = True
            what = f"{1 - right.mean():.0%} of the pixels are not those of a scene with {where}"
            trial.expect(right.mean() >= WHOLE, code, what)
    if not compared:
        trial.not_observable("no image showed any of the scene")


@check("OBJ-5", on={SERVER: KNOWN})
def check_objects_are_where_they_were_put(trial: ServerTrial) -> None:
    """Each object of the scene is moved, turned and scaled, by itself and with the others; the
    colours are those of the known scene.
    """
    expect_as_rendered(
        trial,
        "other-colours",
        lambda exact, seen: (exact.color_error(seen.color) <= COLOR_BUDGET)[exact.certain],
        quick=6,
        full=400,
    )


@check("OBJ-6", on={SERVER: KNOWN})
def check_depth_is_in_world_units(trial: ServerTrial) -> None:
    """The depths of objects that are larger or smaller than they were."""

    def right_in(exact: ExactImage, seen: CapturedFrame) -> Any:
        depth = seen.planar()
        both = exact.certain & (exact.what != NOTHING) & np.isfinite(depth)
        return exact.depth_is_right(depth)[both]

    expect_as_rendered(trial, "other-depths", right_in, quick=3, full=200)


@check("OBJ-7", on={SERVER: ("1.1", "frames")})
def check_frames_list_what_was_moved(trial: ServerTrial) -> None:
    """Each object of the scene is moved, then the Gaussians as 1.0 does it."""
    if trial.facts.grants("objects"):
        for where, seen in moving(trial, quick=4, full=300):
            _expect_listed(trial, where, seen.frame)
    trial.peer.close_all()
    it = ImageSession(trial)
    for number in range(3):
        pose = Pose((0.125 * number, 0.0, 0.25), turned_about(AT_REST.rotation, (0, 1, 0), 0.25))
        seen = it.look(camera_pose(*pose, kind="point_cloud_pose"))
        _expect_listed(trial, {DEFAULT: (pose, 1.0)}, seen.frame)
    it.look(at_rest())


def _expect_listed(trial: ServerTrial, where: Moved, frame: Json) -> None:
    """A frame lists each object that was moved, and where it is."""
    for name, (pose, scale) in where.items():
        told = told_of(frame, name)
        trial.expect(
            _same(told, pose, scale) if told else (pose, scale) == (AT_REST, 1.0),
            "another-placement" if told else "object-not-listed",
            f"a frame tells of {name} that it is at {show(told)}; it was put to {pose} with scale"
            f" {scale}",
        )


def _same(told: Json | None, pose: Pose, scale: float) -> bool:
    position, rotation = finites(within(told, "position"), 3), finites(within(told, "rotation"), 4)
    size = finite(within(told, "scale"))
    if position is None or rotation is None or size is None:
        return False
    return any(
        np.allclose(
            (*position, *np.multiply(sign, rotation), size),
            (*pose.position, *pose.rotation, scale),
            *(CLOSENESS, CLOSENESS),
        )
        for sign in (1, -1)
    )


@check("OBJ-2", on={SERVER: MOVES_OBJECTS}, given=image_session, cases=Cases(range(3)))
def check_point_cloud_pose_is_of_the_default_object(
    trial: ServerTrial, it: ImageSession, number: int
) -> None:
    """The default object is moved by one message and by the other, in turns."""
    away = Pose((-0.25, 0.125, 0.25), turned_about(AT_REST.rotation, (0, 0, 1), 0.2))
    message = camera_pose(*away, kind="point_cloud_pose")
    _expect_no_scale(it, DEFAULT, 0.5 + number, away, message)


@check(
    "OBJ-5",
    on={SERVER: MOVES_OBJECTS},
    given=image_session,
    cases=lambda trial, it: Cases(trial.facts.objects()),
)
def check_a_scale_that_is_absent_is_1(trial: ServerTrial, it: ImageSession, name: str) -> None:
    """Each object of the scene is scaled, and then posed without a scale."""
    away = Pose((0.125, 0.25, 0.75), AT_REST.rotation)
    _expect_no_scale(it, name, 1.5, away, placed(name, away))


def _expect_no_scale(it: ImageSession, name: str, scale: float, away: Pose, message: Json) -> None:
    """An object with a scale is put away by a message that tells none."""
    _put(it, [name], HOME, scale)
    told = told_of(it.look(message).frame, name)
    what = f"{name} had a scale of {scale}, and {message} came; a frame has it at {show(told)}"
    it.trial.expect(_same(told, away, 1.0), "another-placement", what)


def _put(it: ImageSession, names: list[str], pose: Pose, scale: float) -> None:
    """Put objects there; skips the check where frames do not tell so."""
    frame = it.look(*(placed(name, pose, scale) for name in names)).frame
    for name in names:
        told = told_of(frame, name)
        if not _same(told, pose, scale):
            it.trial.not_observable(f"frames tell of {name} that it is at {show(told)} (OBJ-7)")


@check("OBJ-3", on={SERVER: ("1.1", "capability:objects")})
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
        what = f"a pose of the object {show(name)}"
        expect_error(trial, errors, "unknown_object", "/object", what)


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


@check("OBJ-4", on={SERVER: MOVES_OBJECTS})
def check_keeps_the_former_pose_of_an_object(trial: ServerTrial) -> None:
    """Poses of an object that miss or mistype members, and scales that are none; then, of every
    object of the scene, a rotation and a scale that are none.
    """
    names = trial.facts.objects()
    away = placed(DEFAULT, Pose((0.5, 0.25, 0.75), AT_REST.rotation), 0.75)
    cases = [(DEFAULT, *broken) for broken in broken_object_poses(away)]
    for name in names:
        turned = placed(name, Pose((0.5, 0.25, 0.75), (0.0, 0.0, 0.0, 2.0)), 1.0)
        for what, message in (("rotation", turned), ("scale", placed(name, HOME, 0.0))):
            cases.append((name, f"a {what} that is none", message, f"{what} of {name}"))
    with image_session(trial) as it:
        _put(it, names, HOME, 1.25)
        for name, what, message, _ in trial.each(cases, kind=lambda case: case[-1], spare=SPARE):
            known = len(it.frames)
            it.say(message)
            if it.answers():
                it.look()
                for frame in it.frames[known:]:
                    told = told_of(frame, name)
                    kept = _same(told, HOME, 1.25)
                    said = f"a pose of {name} with {what}; a frame has it at {show(told)}"
                    trial.judge("keeps" if kept else "applies", said)
            else:
                trial.judge(it.end(), f"a pose of {name} with {what}")
                trial.peer.close_all()
                it = ImageSession(trial)
                _put(it, names, HOME, 1.25)
        it.look(*(placed(name, AT_REST) for name in names))
