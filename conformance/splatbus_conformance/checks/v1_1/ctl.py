"""Checks on control of the scene, among several clients (spec 1.1 section 6.3)."""

import itertools
import math
from typing import Any

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.checks.v1_1.tim_png import CLOSENESS, set_time
from splatbus_conformance.images.pinhole import placed_in, told_of
from splatbus_conformance.trials.moves.camera_control import CameraControl, camera_in, camera_of
from splatbus_conformance.trials.moves.control import busy, controlling, in_control
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.moves.frame_readers import frames_of
from splatbus_conformance.trials.moves.image_session import (
    LENS,
    ImageSession,
    answers,
    at_rest,
    further,
    image_session,
    placed,
)
from splatbus_conformance.trials.moves.lenses import in_force, lens_of, scaled
from splatbus_conformance.trials.moves.nudging import Nudging
from splatbus_conformance.trials.moves.survey import first_view
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import DEFAULT
from splatbus_conformance.wire.json_values import is_number, show
from splatbus_conformance.wire.messages import Json, camera_pose
from splatbus_conformance.wire.sockets import Connection

SPEAKS = ("1.1",)
AGAIN = 20
"""How often a client that has no control poses."""
NEWEST_TAG = "heir 2"
POSED = "posed the camera"
ENDS = ("reset its connection", "sent a header that is none")
"""How a client may go that does not close."""
AFTERWARDS = (POSED, "moved the Gaussians alone")
"""What may end what a client has left behind, and must not need to."""


def poses(trial: ServerTrial, place: float) -> dict[str, Json]:
    """A pose of each kind that the server grants, and the messages of 1.0."""
    found = {
        "camera_pose": camera_pose((place, 0.5, -3.0)),
        "point_cloud_pose": camera_pose((0.0, 0.0, place / 8), kind="point_cloud_pose"),
    }
    if trial.facts.grants("objects"):
        found["object_pose"] = placed(DEFAULT, AT_REST, 1.0 + abs(place) / 8)
    if trial.facts.grants("time"):
        found["set_time"] = set_time((trial.facts.time_range() or (0.0, 1.0))[1])
    return found


def leave(client: Connection, how: str) -> None:
    """End the connection of a client, or give the server cause to (FRM-3)."""
    if how == ENDS[0]:
        client.reset()
    elif how == ENDS[1]:
        client.send(bytes(4))
        client.end_stream()
    else:
        client.close()


@check("CTL-1", observable="the error after the first pose of a second client", on={SERVER: SPEAKS})
def check_tells_who_has_no_control(trial: ServerTrial) -> None:
    """One client has control; others send a pose, each of another kind, the first of them after one
    that is broken.
    """
    first = controlling(trial)
    for number, (kind, pose) in enumerate(trial.each(list(poses(trial, 2.0).items()))):
        other = further(trial, first)
        if number == 0:
            trial.viewer.say(other, {"type": "camera_pose", "position": {}})
            other = other if answers(trial, other) else further(trial, first)
        trial.viewer.say(other, pose)
        answered = answers(trial, other)
        trial.expect(
            answered, "no-reply", f"no answer to a client without control that sent {kind}"
        )
        told = trial.viewer.with_(other).errors()
        trial.expect(
            "busy" in told,
            "not-told-busy",
            f"{kind} of a second client: {', '.join(told) or 'no error'}",
        )
        other.close()
        trial.delivered += 1
    trial.expect(busy(trial, first) == 0, "wrongly-busy", "the client in control was told busy")


@check("CTL-4", observable="who has control after poses that are refused", on={SERVER: SPEAKS})
def check_refused_poses_count_for_nothing(trial: ServerTrial) -> None:
    """A client sends a pose that is refused, before anybody has control, and then others pose; the
    same after one has it.
    """
    for what, refused in trial.each(list(refused_poses(trial).items())):
        trial.peer.close_all()
        early = trial.greeted("msg")
        trial.viewer.say(early, refused)
        goes_on = answers(trial, early)
        trial.expect(
            goes_on or early.ended, "no-reply", f"{what}: the next request was not answered"
        )
        first = in_control(trial)
        if first is None:
            early.close()
            controlling(trial)
            trial.violated(
                "refused-pose-gave-control", f"{what}, refused, gave control to its connection"
            )
        if early.ended:
            if goes_on:
                trial.not_observable("the server serves one connection at a time")
            continue  # it was closed for what it sent, as it may be (POS-6)
        trial.viewer.say(early, refused)
        answers(trial, early)
        trial.expect(
            not busy(trial, early), "wrongly-busy", f"{what}, refused, was answered busy as well"
        )
        trial.viewer.say(early, camera_pose())
        answers(trial, early)
        trial.expect(
            busy(trial, early),
            "not-told-busy",
            f"after {what}, a good pose beside a client in control: no busy",
        )
        first.close()
        trial.delivered += 1


def refused_poses(trial: ServerTrial) -> dict[str, Json]:
    """What is no valid pose, in different ways."""
    found = {
        "a pose without members": {"type": "camera_pose"},
        "a pose with a rotation of norm 2": camera_pose(rotation=(0.0, 0.0, 0.0, 2.0)),
        "a pose with a tag that is none": camera_pose() | {"tag": ""},
    }
    if trial.facts.grants("objects"):
        found["a pose of an unknown object"] = placed("no such object", AT_REST)
        found["a pose of an object without size"] = placed(DEFAULT, AT_REST, 0.0)
    if trial.facts.grants("time"):
        found["a time that is no number"] = {"type": "set_time", "time": "now"}
    if trial.facts.grants("intrinsics") and trial.facts.first is not None:
        width, height = trial.facts.size
        lens = lens_of(trial.facts.first, width, 2 * height + 2, 1.0, 1.0, 0.0, 0.0)
        found["a pose with intrinsics of another shape"] = camera_pose() | {"intrinsics": lens}
    return found


@check("CTL-2", observable="how many errors come of many poses", on={SERVER: SPEAKS})
def check_tells_it_once(trial: ServerTrial) -> None:
    """Two clients without control send poses of every kind, many times, and some that are refused,
    beside one of 1.0; then control passes to one of them, which poses on.
    """
    first = controlling(trial)
    others = [further(trial, first) for _ in range(2)]
    old = trial.dial("msg")
    stranger = {"type": "weather_report"}
    if trial.facts.grants("objects"):
        stranger = placed("no such object", AT_REST)
    for number in trial.each(range(AGAIN)):
        if number == 1:  # another error is no reason to say it again
            for other in others:
                trial.viewer.say(other, stranger)
        for place, other in enumerate((*others, old), 2):
            for pose in poses(trial, place + number / 16).values():
                trial.viewer.say(other, pose)
            if number == 0:
                trial.expect(
                    answers(trial, other) or other is old, "no-reply", "a pose, and no more answers"
                )
        for other in others:
            for refused in refused_poses(trial).values():
                trial.viewer.say(other, refused)
            if not answers(trial, other):
                trial.not_observable("the server ends the connection of who sends a broken pose")
        trial.delivered += 1
    for number, other in enumerate(others, 2):
        answers(trial, other)
        told = busy(trial, other)
        trial.expect(told <= 1, "busy-again", f"client {number} was told busy {told} times")
    first.close()
    heir, rest = others
    for _ in range(AGAIN):
        trial.viewer.say(heir, poses(trial, 9.0)["camera_pose"])
        trial.viewer.say(rest, poses(trial, 8.0)["camera_pose"])
        answers(trial, heir)
    for number, other in enumerate(others, 2):
        told = busy(trial, other)
        trial.expect(
            told <= 1,
            "busy-again",
            f"after control had passed, client {number} has {told} times busy",
        )
    trial.delivered += 1


@check(
    "CTL-5",
    observable="the first frames after control passed on, and nobody posed",
    on={SERVER: ("1.1", "frames")},
)
def check_control_passes_with_the_newest_poses(trial: ServerTrial) -> None:
    """Three clients, of 1.1, 1.0 and 1.1, pose many times, the last with all that it may say, its
    intrinsics only once (CAM-7); the first closes, then the next.
    """
    steering, first = CameraControl(trial), trial.commanding()
    trial.expect(
        steering.shows(first, camera_pose((0.0, 0.0, 3.0))),
        "not-applied",
        "no frame shows a good pose",
    )
    old = trial.dial("msg")
    trial.answers(old)
    third = further(trial, first, old)
    clients = ((old, -1.0), (third, -4.0))
    lens = _lens_as_shown(trial, steering)
    time = (trial.facts.time_range() or (0.0, 0.0))[1] if trial.facts.grants("time") else None
    for number in range(3):
        for client, place in clients:
            more: Json = {"tag": NEWEST_TAG[:-1] + str(number)}
            more |= {"intrinsics": lens} if lens and number == 0 else {}
            camera = camera_pose((place, number, 0.0)) | (more if client is third else {})
            for pose in (camera, _cloud(place + number)):
                trial.viewer.say(client, pose)
            if client is third and time is not None:
                trial.viewer.say(client, set_time(time))
            trial.answers(client)
    left = first
    for client, place in trial.each(clients):
        since = steering.count
        left.close()
        what = f"control passed to a client of {'1.0' if client is old else '1.1'};"
        _expect_poses(trial, steering, what, since, place)
        if client is third:
            frames = frames_of(trial, steering.reader)[since:]
            _expect_the_rest(trial, frames, what, lens, time)
        left = client
        trial.delivered += 1
    steering.shows(third, camera_pose((0.0, 0.0, 3.0)))
    trial.viewer.say(third, at_rest())
    trial.answers(third)


def _expect_poses(
    trial: ServerTrial, steering: CameraControl, what: str, since: int, place: float
) -> None:
    """Camera and Gaussians are put where the client had posed them last."""
    wanted, depth = camera_of(camera_pose((place, 2.0, 0.0))), place + 2.0
    trial.expect(
        trial.wait(lambda: any(it.shows(wanted) for it in steering.cameras(since))),
        "another-camera",
        f"{what} no frame shows the newest camera that it sent",
    )
    trial.expect(
        trial.wait(lambda: _depth_of_cloud(trial, steering) == depth),
        "another-placement",
        f"{what} the Gaussians are at z = {_depth_of_cloud(trial, steering)}, and its newest pose"
        f" of them has {depth}",
    )


def _expect_the_rest(
    trial: ServerTrial, frames: list[Json], what: str, lens: Json | None, time: float | None
) -> None:
    """Intrinsics, time and tag are those that the client had sent when it had no control."""
    wrong = in_force(frames[-1], scaled(lens, trial.facts.size)) if lens else ""
    trial.expect(not wrong, "other-intrinsics", f"{what} it had sent intrinsics, and {wrong}")
    seen: Any = frames[-1].get("time")
    trial.expect(
        time is None or (is_number(seen) and math.isclose(seen, time, rel_tol=CLOSENESS)),
        "another-time",
        f"{what} it had set the time to {time}, and a frame has {show(seen)}",
    )
    cameras = [camera for it in frames if isinstance(camera := it.get("camera"), dict)]
    tags = [camera["tag"] for camera in cameras if "tag" in camera]
    trial.expect(
        tags == [NEWEST_TAG],
        "another-tag",
        f"{what} its newest tag is {NEWEST_TAG}, and {show(tags)} came",
    )


def _lens_as_shown(trial: ServerTrial, steering: CameraControl) -> Json | None:
    """Intrinsics that are not those of the newest frame; None where they are not granted."""
    if not trial.facts.grants("intrinsics"):
        return None
    camera = frames_of(trial, steering.reader)[-1]["camera"]
    names = (*LENS, "width", "height")
    return {name: camera[name] for name in names} | {"fx": 1.5 * camera["fx"]}


def _depth_of_cloud(trial: ServerTrial, steering: CameraControl) -> float:
    """Where the newest frame has the Gaussians, along z, which is a small integer here."""
    newest = frames_of(trial, steering.reader)[-1]
    return round(float(placed_in(newest, DEFAULT).pose.position[2]), 4)


def _cloud(z: float) -> Json:
    return camera_pose((0.0, 0.0, z), kind="point_cloud_pose")


@check(
    "POS-11",
    observable="frames after poses of each kind of a second client",
    on={SERVER: ("1.1", "frames", "pixels")},
)
def check_no_pose_of_another_is_applied(trial: ServerTrial) -> None:
    """A client has control and has set what it may; another sends a pose of each kind."""
    span = trial.facts.time_range() if trial.facts.grants("time") else None
    with image_session(trial) as it:
        other = further(trial, it.poser)
        for kind, pose in trial.each(list(poses(trial, 3.0).items())):
            before = it.look(at_rest(), *([set_time(span[0])] if span else [])).frame
            known = len(it.frames)
            trial.viewer.say(other, pose)
            answered = answers(trial, other)
            trial.expect(
                answered, "no-reply", f"no answer to a client without control that sent {kind}"
            )
            if kind == "camera_pose":
                moved = any(camera_in(frame) != camera_in(before) for frame in it.nudged(known))
            else:
                seen = it.look().frame
                moved = told_of(seen, DEFAULT) != told_of(before, DEFAULT)
                moved |= bool(span) and seen["time"] != before["time"]
            trial.expect(
                not moved,
                "applied-without-control",
                f"a client without control sent {kind}, and it was applied",
            )
            trial.delivered += 1


@check(
    "CTL-3",
    observable="the cameras and times of frames after the client that set them has gone",
    on={SERVER: ("1.1", "frames", "pixels")},
)
def check_lens_and_time_end_with_their_client(trial: ServerTrial) -> None:
    """A client sets intrinsics and time and closes; then one of 1.0, or of 1.1, has control, which
    has posed the camera meanwhile, or never does.
    """
    first = first_view(trial, 0.0)
    own = {name: first.frame["camera"][name] for name in LENS}
    size = first.camera.width, first.camera.height
    lens = lens_of(first, *size, 0.5, 0.5, 0.1, 0.1)
    has_lens = trial.facts.grants("intrinsics")
    span = trial.facts.time_range()
    if not trial.facts.grants("time"):
        span = None
    if not (has_lens or span):
        trial.not_observable("the server grants neither intrinsics nor time")
    odd = 0.0 if span is None else span[0] + 0.3718281828 * (span[1] - span[0])
    cases = [(*case, "closed") for case in itertools.product(("1.0", "1.1"), AFTERWARDS)]
    cases += [("1.1", moment, end) for moment, end in zip(AFTERWARDS, ENDS, strict=True)]
    for speaks, moment, end in trial.each(cases):
        trial.peer.close_all()
        it = ImageSession(trial)
        sets = it.look(
            *([set_time(odd)] if span else []), **({"intrinsics": lens} if has_lens else {})
        )
        if has_lens and (wrong := in_force(sets.frame, scaled(lens, size))):
            trial.not_observable(f"intrinsics were sent, and of the frame's camera {wrong} (CAM-5)")
        heir = trial.dial("msg") if speaks == "1.0" else further(trial, it.poser)
        if not trial.answers(heir) or it.poser.ended:
            trial.not_observable("the server serves one message connection at a time")
        if moment == POSED:
            trial.viewer.say(heir, camera_pose((0.5, 0.25, -1.5)))
            trial.answers(heir)
        leave(it.poser, end)
        nudges = Nudging(trial, it.frames, it.capture.new)
        if not nudges.shown(heir):
            trial.violated(
                "control-not-passed-on",
                "control did not pass on: no frame shows what the next client moved",
            )
        seen = it.frames[-1]
        what = f"its client had {end}, and a client of {speaks} had {moment}:"
        wrong = in_force(seen, own)
        trial.expect(not (has_lens and wrong), "intrinsics-kept", f"{what} of intrinsics {wrong}")
        stays = span and seen.get("time") == sets.frame["time"]
        trial.expect(not stays, "time-kept", f"{what} time is still {seen.get('time')}")
        trial.delivered += 1
