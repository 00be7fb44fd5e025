"""Checks on control of the scene, among several clients, and on what each says again when it has
come back (spec 1.1 section 6.3).
"""

from collections.abc import Callable

from splatbus_conformance.checks import CLIENT, CLIENT_IPC, CLIENT_MSG, SERVER, Cases, check
from splatbus_conformance.images.pinhole import placed_in, told_of
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.camera_control import CameraControl, camera_in, camera_of
from splatbus_conformance.trials.moves.clocks import near, set_time
from splatbus_conformance.trials.moves.control import busy, controlling, in_control
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.moves.given_poses import COMMANDS, said_again
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
from splatbus_conformance.trials.moves.listening import heard
from splatbus_conformance.trials.moves.nudging import Nudging
from splatbus_conformance.trials.moves.survey import first_view
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import DEFAULT
from splatbus_conformance.wire.json_values import show, within
from splatbus_conformance.wire.message_kinds import POSES
from splatbus_conformance.wire.messages import Json, camera_pose
from splatbus_conformance.wire.recording import WORDS, Channel
from splatbus_conformance.wire.sockets import Connection

SPEAKS = ("1.1",)
AGAIN = 20
"""How often a client that has no control poses."""
NEWEST_TAG = "heir 2"
SEEN_THROUGH = (*LENS, "width", "height")
POSED, MOVED = "posed the camera", "moved the Gaussians alone"
"""What may end what a client has left behind, and must not need to."""


def send_no_header(client: Connection) -> None:
    """Give the server cause to end the connection (FRM-3)."""
    client.send(bytes(4))
    client.end_stream()


LEAVES: dict[str, Callable[[Connection], None]] = {
    "closed": Connection.close,
    "reset its connection": Connection.reset,
    "sent a header that is none": send_no_header,
}
"""How a client may go."""
DEPARTURES = (
    ("1.0", POSED, "closed"),
    ("1.0", MOVED, "closed"),
    ("1.1", POSED, "closed"),
    ("1.1", MOVED, "closed"),
    ("1.1", POSED, "reset its connection"),
    ("1.1", MOVED, "sent a header that is none"),
)
"""The version of the client that comes next, what it has done, and how the first went."""


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


def expect_an_answer(trial: ServerTrial, other: Connection, kind: str, pose: Json) -> None:
    """A client without control sends a pose, and then a request that is answered."""
    trial.viewer.say(other, pose)
    what = f"no answer to a client without control that sent {kind}"
    trial.expect(answers(trial, other), "no-reply", what)


@check(
    "CTL-1",
    on={SERVER: SPEAKS},
    given=controlling,
    cases=lambda trial, first: Cases(list(poses(trial, 2.0).items())),
)
def check_tells_who_has_no_control(
    trial: ServerTrial, first: Connection, case: tuple[str, Json]
) -> None:
    """One client has control; others send a pose, each of another kind, the first of them after one
    that is broken.
    """
    other = further(trial, first)
    if trial.number == 0:
        trial.viewer.say(other, {"type": "camera_pose", "position": {}})
        other = other if answers(trial, other) else further(trial, first)
    expect_an_answer(trial, other, *case)
    told = trial.with_(other).errors()
    what = f"{case[0]} of a second client: {', '.join(told) or 'no error'}"
    trial.expect("busy" in told, "not-told-busy", what)
    other.close()
    trial.expect(busy(trial, first) == 0, "wrongly-busy", "the client in control was told busy")


@check(
    "CTL-4",
    on={SERVER: SPEAKS},
    cases=lambda trial: Cases(list(refused_poses(trial).items())),
)
def check_refused_poses_count_for_nothing(trial: ServerTrial, case: tuple[str, Json]) -> bool:
    """A client sends a pose that is refused, before anybody has control, and then others pose; the
    same after one has it.
    """
    what, refused = case
    trial.peer.close_all()
    early = trial.greeted("msg")
    trial.viewer.say(early, refused)
    goes_on = answers(trial, early)
    trial.expect(goes_on or early.ended, "no-reply", f"{what}: the next request was not answered")
    first = in_control(trial)
    if first is None:
        early.close()
        controlling(trial)
        trial.violated(
            "refused-pose-gave-control", f"{what}, refused, gave control to its connection"
        )
    if early.ended and goes_on:
        trial.not_observable("the server serves one connection at a time")
    stays = not early.ended  # else it was closed for what it sent, as it may be (POS-6)
    if stays:
        _judge_beside_control(trial, early, what, refused)
    first.close()
    return stays


def _judge_beside_control(trial: ServerTrial, early: Connection, what: str, refused: Json) -> None:
    trial.viewer.say(early, refused)
    answers(trial, early)
    trial.expect(not busy(trial, early), "wrongly-busy", f"{what}, refused, was answered busy too")
    trial.viewer.say(early, camera_pose())
    answers(trial, early)
    told = f"after {what}, a good pose beside a client in control: no busy"
    trial.expect(busy(trial, early), "not-told-busy", told)


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


@check("CTL-2", on={SERVER: SPEAKS})
def check_tells_it_once(trial: ServerTrial) -> None:
    """Two clients without control send poses of every kind, many times, and some that are refused,
    beside one of 1.0; then control passes to one of them, which poses on.
    """
    first = controlling(trial)
    others = heir, rest = further(trial, first), further(trial, first)
    old = trial.dial("msg")
    stranger = {"type": "weather_report"}
    if trial.facts.grants("objects"):
        stranger = placed("no such object", AT_REST)

    def expect_told_once(when: str) -> None:
        for number, other in enumerate(others, 2):
            answers(trial, other)
            told = busy(trial, other)
            what = f"{when}client {number} was told busy {told} times"
            trial.expect(told <= 1, "busy-again", what)

    for number in trial.each(range(AGAIN)):
        if number == 1:  # another error is no reason to say it again
            for other in others:
                trial.viewer.say(other, stranger)
        for place, other in enumerate((*others, old), 2):
            trial.viewer.say(other, *poses(trial, place + number / 16).values())
            if number == 0:
                answered = answers(trial, other) or other is old
                trial.expect(answered, "no-reply", "a pose, and no more answers")
        for other in others:
            trial.viewer.say(other, *refused_poses(trial).values())
            if not answers(trial, other):
                trial.not_observable("the server ends the connection of who sends a broken pose")
    expect_told_once("")
    first.close()
    for _ in range(AGAIN):
        trial.viewer.say(heir, poses(trial, 9.0)["camera_pose"])
        trial.viewer.say(rest, poses(trial, 8.0)["camera_pose"])
        answers(trial, heir)
    expect_told_once("after control had passed, ")


@check("CTL-5", on={SERVER: ("1.1", "frames")})
def check_control_passes_with_the_newest_poses(trial: ServerTrial) -> None:
    """Three clients, of 1.1, 1.0 and 1.1, pose many times, the last with all that it may say, its
    intrinsics only once (CAM-7); the first closes, then the next.
    """
    steering, left = CameraControl(trial), trial.commanding()
    start = camera_pose((0.0, 0.0, 3.0))
    trial.expect(steering.shows(left, start), "not-applied", "no frame shows a good pose")
    frames = trial.with_(steering.reader).frames
    old = trial.dial("msg")
    trial.answers(old)
    third = further(trial, left, old)
    lens: Json | None = None
    if trial.facts.grants("intrinsics"):
        camera = frames[-1]["camera"]
        lens = {name: camera[name] for name in SEEN_THROUGH} | {"fx": 1.5 * camera["fx"]}
    time = (trial.facts.time_range() or (0.0, 0.0))[1] if trial.facts.grants("time") else None
    for number in range(3):
        for client, place in ((old, -1.0), (third, -4.0)):
            camera = camera_pose((place, number, 0.0))
            cloud = camera_pose((0.0, 0.0, place + number), kind="point_cloud_pose")
            said = [camera, cloud]
            if client is third:
                camera |= {"tag": f"heir {number}"}
                camera |= {"intrinsics": lens} if lens and number == 0 else {}
                said += [] if time is None else [set_time(time)]
            trial.viewer.say(client, *said)
            trial.answers(client)
    for client, place in trial.each(((old, -1.0), (third, -4.0))):
        since = steering.count
        left.close()
        left, what = client, f"control passed to a client of {'1.0' if client is old else '1.1'};"
        _expect_poses(trial, steering, what, since, place)
        if client is third:
            _expect_the_rest(trial, frames[since:], what, lens, time)
    steering.shows(third, start)
    trial.viewer.say(third, at_rest())
    trial.answers(third)


def _expect_poses(
    trial: ServerTrial, steering: CameraControl, what: str, since: int, place: float
) -> None:
    """Camera and Gaussians are put where the client had posed them last."""
    wanted, depth = camera_of(camera_pose((place, 2.0, 0.0))), place + 2.0
    shown = trial.wait(lambda: any(it.shows(wanted) for it in steering.cameras(since)))
    told = f"{what} no frame shows the newest camera that it sent"
    trial.expect(shown, "another-camera", told)

    def now() -> float:
        """Where the newest frame has the Gaussians, along z, which is a small integer here."""
        newest = trial.with_(steering.reader).frames[-1]
        return round(float(placed_in(newest, DEFAULT).pose.position[2]), 4)

    put = trial.wait(lambda: now() == depth)
    told = f"{what} the Gaussians are at z = {now()}, and its newest pose of them has {depth}"
    trial.expect(put, "another-placement", told)


def _expect_the_rest(
    trial: ServerTrial, frames: list[Json], what: str, lens: Json | None, time: float | None
) -> None:
    """Intrinsics, time and tag are those that the client had sent when it had no control."""
    wrong = in_force(frames[-1], scaled(lens, trial.facts.size)) if lens else ""
    trial.expect(not wrong, "other-intrinsics", f"{what} it had sent intrinsics, and {wrong}")
    seen = frames[-1].get("time")
    told = f"{what} it had set the time to {time}, and a frame has {show(seen)}"
    trial.expect(time is None or near(seen, time), "another-time", told)
    tags = [tag for it in frames if (tag := within(it, "camera", "tag")) is not None]
    told = f"{what} its newest tag is {NEWEST_TAG}, and {show(tags)} came"
    trial.expect(tags == [NEWEST_TAG], "another-tag", told)


@check("POS-11", on={SERVER: ("1.1", "frames", "pixels")})
def check_no_pose_of_another_is_applied(trial: ServerTrial) -> None:
    """A client has control and has set what it may; another sends a pose of each kind."""
    span = trial.facts.time_range() if trial.facts.grants("time") else None
    with image_session(trial) as it:
        other = further(trial, it.poser)
        for kind, pose in trial.each(list(poses(trial, 3.0).items())):
            before = it.look(at_rest(), *([set_time(span[0])] if span else [])).frame
            known = len(it.frames)
            expect_an_answer(trial, other, kind, pose)
            if kind == "camera_pose":
                moved = any(camera_in(frame) != camera_in(before) for frame in it.nudged(known))
            else:
                seen = it.look().frame
                moved = told_of(seen, DEFAULT) != told_of(before, DEFAULT)
                moved |= bool(span) and seen["time"] != before["time"]
            what = f"a client without control sent {kind}, and it was applied"
            trial.expect(not moved, "applied-without-control", what)


@check("CTL-3", on={SERVER: ("1.1", "frames", "pixels")})
def check_lens_and_time_end_with_their_client(trial: ServerTrial) -> None:
    """A client sets intrinsics and time and closes; then one of 1.0, or of 1.1, has control, which
    has posed the camera meanwhile, or never does.
    """
    first = first_view(trial, 0.0)
    own = {name: first.frame["camera"][name] for name in LENS}
    size = first.camera.width, first.camera.height
    lens = lens_of(first, *size, 0.5, 0.5, 0.1, 0.1) if trial.facts.grants("intrinsics") else None
    span = trial.facts.time_range() if trial.facts.grants("time") else None
    if not (lens or span):
        trial.not_observable("the server grants neither intrinsics nor time")
    times = [set_time(span[0] + 0.3718281828 * (span[1] - span[0]))] if span else []
    for speaks, moment, end in trial.each(DEPARTURES):
        trial.peer.close_all()
        it = ImageSession(trial)
        sets = it.look(*times, **({"intrinsics": lens} if lens else {}))
        if lens and (wrong := in_force(sets.frame, scaled(lens, size))):
            trial.not_observable(f"intrinsics were sent, and of the frame's camera {wrong} (CAM-5)")
        heir = trial.dial("msg") if speaks == "1.0" else further(trial, it.poser)
        if not trial.answers(heir) or it.poser.ended:
            trial.not_observable("the server serves one message connection at a time")
        if moment == POSED:
            trial.viewer.say(heir, camera_pose((0.5, 0.25, -1.5)))
            trial.answers(heir)
        LEAVES[end](it.poser)
        trial.expect(
            Nudging(trial, it.frames, it.capture.new).shown(heir),
            "control-not-passed-on",
            "control did not pass on: no frame shows what the next client moved",
        )
        seen = it.frames[-1]
        what = f"its client had {end}, and a client of {speaks} had {moment}:"
        wrong = in_force(seen, own)
        trial.expect(not (lens and wrong), "intrinsics-kept", f"{what} of intrinsics {wrong}")
        stays = span and seen.get("time") == sets.frame["time"]
        trial.expect(not stays, "time-kept", f"{what} time is still {seen.get('time')}")


LASTING: dict[Channel, frozenset[str]] = {
    "ipc": frozenset({"subscribe"}),
    "msg": frozenset({*POSES, "object_pose", "set_time", "subscribe_telemetry"}),
}
"""What a client says that is in force until it says otherwise, or its connection ends."""


@check(
    "CTL-6",
    on={
        CLIENT_IPC: ("hello:ipc", "says:subscribe", "reconnects:ipc"),
        CLIENT_MSG: ("hello:msg", "reconnects:msg"),
    },
)
def check_says_again_what_it_wants(trial: ClientTrial, channel: Channel) -> None:
    """A connection is lost, and another is made in its place: what the testee said by itself when
    it was first met, it says again.
    """
    wanted = trial.facts.says & LASTING[channel]
    if not wanted:
        trial.not_observable("the testee sends nothing by itself that it has to repeat")
    trial.greeted(channel)  # the next one takes its place
    connection = trial.greeted(channel)
    trial.wait(lambda: wanted <= heard(trial, connection) or connection.ended)
    left = wanted - heard(trial, connection)
    told = f"it came back to the {WORDS[channel]} channel, and said no {', '.join(sorted(left))}"
    trial.expect(not left, "not-said-again", told)


@check("CTL-6", on={CLIENT: ("hello:msg", "adapter:send_camera", "reconnects:msg")})
def check_says_its_poses_again(trial: ClientTrial) -> None:
    """The message channel is lost after a pose was sent, and comes back; of cameras, and of the
    splats where the adapter can move them.
    """
    for kind, command in COMMANDS.items():
        if command in trial.greeting.can:
            _, said = said_again(trial, kind)
            trial.expect(said, "not-said-again", f"it came back, and said no {kind} again")
