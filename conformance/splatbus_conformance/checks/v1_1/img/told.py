"""Checks on what a client makes of a `frame` beside its pixels (spec 1.1 chapters 5 and 7): through
which camera the image was seen, when, and where objects were.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from hypothesis import strategies as st

from splatbus_conformance.cases.valid.poses import Pose, poses
from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.images.painted import coordinates
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.frame_lender import READS, FrameLender
from splatbus_conformance.trials.moves.pose_error import Kind, engine_of, misread, why
from splatbus_conformance.wire.messages import Json, encode

TOLD = (*READS, "adapter:frame")
IDS = ("default", "ball", "a", "chair 1", "\u00e9t\u00e9", "\U0001f600")
NUMBERS = ("fx", "fy", "cx", "cy", "width", "height", "near", "far")
FOCAL, CENTRE = st.floats(1e-3, 1e6), st.floats(-1e6, 1e6)
PLANES = st.tuples(st.floats(1e-3, 1.0), st.floats(2.0, 1e6))
LENS = st.tuples(FOCAL, FOCAL, CENTRE, CENTRE)


def frames(trial: ClientTrial, quick: int, full: int) -> Iterator[tuple[Json, Json]]:
    """Frames with every camera, time and object, and what the client made of each.

    Members come in the order of the specification, the optional ones where they say something, and
    in the reverse: who reads the usual spelling by a shorter way has two.
    """
    search = f"{trial.requirement.id} frames"
    pose = poses(search, single=trial.greeting.single).map(Pose.as_lists)
    scales = st.floats(1e-3, 1e3)
    placed = st.lists(st.tuples(st.sampled_from(IDS), pose, scales), max_size=3, unique_by=_id)
    drawn = st.tuples(LENS, PLANES, pose, CENTRE, placed, st.booleans())
    lender = FrameLender(trial)
    for number, case in enumerate(trial.each(drawn=drawn, quick=quick, full=full, search=search)):
        lens, planes, camera, time, objects, is_reversed = case
        numbers = *lens, trial.role.width, trial.role.height, *planes
        said = {
            "camera": {**_placed(camera), **dict(zip(NUMBERS, numbers, strict=True))},
            "objects": [{"object": it, **_placed(at), "scale": by} for it, at, by in objects],
            "time": time,
        }
        trial.role.encode["ipc"] = _reversed if is_reversed else _plain
        yield said, _made_of(trial, lender, number, said)


def _id(placed: tuple[str, Any, float]) -> str:
    return placed[0]


def _placed(pose: list[list[float]]) -> Json:
    return dict(zip(("position", "rotation"), pose, strict=True))


def _plain(message: Json) -> bytes:
    return encode({name: it for name, it in message.items() if it != []})


def _reversed(message: Json) -> bytes:
    return encode(dict(reversed(message.items())))


def _made_of(trial: ClientTrial, lender: FrameLender, number: int, said: Json) -> Json:
    image = coordinates(number, *lender.size)
    lender.paint(image, lender.announced(image).slot)
    seq = trial.lend(lender.connection, **said)
    if not trial.releases(lender.connection, seq) or lender.newest()["seq"] != seq:
        trial.not_observable(f"the testee did not read the image of {said}")
    told = trial.ask("frame")
    if told["seq"] != seq:
        trial.not_observable(f"the testee tells of image {told['seq']}, not of {seq}")
    return told


def judge_pose(trial: ClientTrial, kind: Kind, said: Json, told: Json, what: str) -> None:
    """A pose on the wire, and what the client took it for."""
    engine = engine_of(trial.greeting, kind)
    wire, taken = (Pose(tuple(it["position"]), tuple(it["rotation"])) for it in (said, told))
    size = trial.role.width, trial.role.height
    found = misread(taken, wire, engine, single=trial.greeting.single, size=size)
    if found.far:
        reason = why(wire, taken, engine, "in") or f"it is {found.away_by} away"
        trial.violated("another-pose", f"{what} at {wire} was taken to be at {taken}: {reason}")


@check("IMG-26", on={CLIENT: TOLD})
def check_understands_the_cameras_of_frames(trial: ClientTrial) -> None:
    """Frames of cameras near every edge of what is allowed."""
    for said, told in frames(trial, 20, 400):
        judge_pose(trial, "camera_pose", said["camera"], told["camera"], "the camera of a frame")


@check("IMG-26", on={CLIENT: TOLD})
def check_understands_the_objects_of_frames(trial: ClientTrial) -> None:
    """Frames that list up to three objects, each with a pose and a scale."""
    for said, told in frames(trial, 20, 400):
        if "objects" not in told:
            trial.not_observable("the client takes no objects from a frame")
        taken = {it["object"]: it for it in told["objects"]}
        listed = {it["object"]: it for it in said["objects"]}
        if taken.keys() != listed.keys():
            trial.violated("other-objects", f"of {[*listed]} it took {[*taken]}")
        for name, it in listed.items():
            judge_pose(trial, "point_cloud_pose", it, taken[name], f"object {name!r} of a frame")


@check("ACC-14", on={CLIENT: TOLD})
def check_takes_the_numbers_of_frames(trial: ClientTrial) -> None:
    """Lenses, sizes, clipping planes, times and scales, to the last bit that the client holds."""
    for said, told in frames(trial, 20, 400):
        _judge_numbers(trial, "camera", said["camera"], told["camera"])
        if "time" in told:
            _judge_numbers(trial, "frame", {"time": said["time"]}, told)
        scales = {it["object"]: it["scale"] for it in said["objects"]}
        taken = {it["object"]: it["scale"] for it in told.get("objects", [])}
        both = scales.keys() & taken.keys()
        _judge_numbers(trial, "scale", {name: scales[name] for name in both}, taken)


def _judge_numbers(trial: ClientTrial, of: str, said: Json, told: Mapping[str, Any]) -> None:
    for name, right in said.items():
        if isinstance(right, list):
            continue
        taken = told[name]
        is_held = trial.greeting.single and np.float32(taken) == np.float32(right)
        what = f"{of}/{name}, {right!r}, was taken for {taken!r}"
        trial.expect(taken == right or is_held, "another-number", what)
