"""Checks on control of the scene, among several clients (spec 1.1 section 6.3)."""

from splatbus_conformance.checks import check
from splatbus_conformance.checks.server.clocks import set_time
from splatbus_conformance.checks.server.lenses import in_force, lens_of
from splatbus_conformance.messages import Json, camera_pose
from splatbus_conformance.peer import Connection
from splatbus_conformance.photographer import AT_REST
from splatbus_conformance.pinhole import placed_in
from splatbus_conformance.server_introduction import DEFAULT
from splatbus_conformance.server_trial import ServerTrial
from splatbus_conformance.steering import Steering, camera_of
from splatbus_conformance.studio import LENS, Studio, answers, at_rest, further, placed
from splatbus_conformance.survey import first_view
from splatbus_conformance.trial import EFFECT_SECONDS

SPEAKS = ("1.1",)
AGAIN = 20
"""How often a client that has no control poses."""


def poses(trial: ServerTrial, place: float) -> dict[str, Json]:
    """A pose of each kind that the server grants, and the messages of 1.0."""
    found = {
        "camera_pose": camera_pose((place, 0.5, -3.0)),
        "point_cloud_pose": camera_pose((0.0, 0.0, place / 8), kind="point_cloud_pose"),
    }
    if trial.facts.lacks("capability:objects") is None:
        found["object_pose"] = placed(DEFAULT, AT_REST, 1.0 + abs(place) / 8)
    if trial.facts.lacks("capability:time") is None:
        found["set_time"] = set_time((trial.facts.time_range() or (0.0, 1.0))[1])
    return found


def controlling(trial: ServerTrial) -> Connection:
    """A connection that has control: it was the first to pose, and was not told `busy`."""
    found: list[Connection] = []

    def given() -> bool:
        """A server may still have to notice that whoever had control is gone."""
        first = trial.commanding()
        trial.move()
        found.append(first)
        has = answers(trial, first) and busy(trial, first) == 0
        if not has:
            first.close()
        return has

    if not trial.peer.until(given, EFFECT_SECONDS):
        trial.not_observable("no connection is given control")
    return found[-1]


def busy(trial: ServerTrial, connection: Connection) -> int:
    """How often this connection was told `busy`."""
    return trial.viewer.with_(connection).errors().count("busy")


@check("CTL-1", observable="the error after the first pose of a second client", needs=SPEAKS)
def check_tells_who_has_no_control(trial: ServerTrial) -> None:
    """One client has control; others send a pose, each of another kind, the first of them after one
    that is broken.
    """
    first = controlling(trial)
    for number, (kind, pose) in enumerate(trial.each(list(poses(trial, 2.0).items()))):
        other = further(trial, first)
        if number == 0:
            trial.viewer.say(other, {"type": "camera_pose", "position": {}})
        trial.viewer.say(other, pose)
        answered = answers(trial, other)
        trial.expect(answered, f"no answer to a client without control that sent {kind}")
        told = trial.viewer.with_(other).errors()
        trial.expect("busy" in told, f"{kind} of a second client: {', '.join(told) or 'no error'}")
        other.close()
        trial.delivered += 1
    trial.expect(busy(trial, first) == 0, "the client in control was told busy")


@check("CTL-4", observable="who has control after poses that are refused", needs=SPEAKS)
def check_refused_poses_count_for_nothing(trial: ServerTrial) -> None:
    """A client sends a pose that is refused, before anybody has control, and then others pose; the
    same after one has it.
    """
    for what, refused in trial.each(list(refused_poses(trial).items())):
        trial.peer.close_all()
        early = trial.greeted("msg")
        trial.viewer.say(early, refused)
        trial.expect(answers(trial, early), f"{what}: the next request was not answered")
        first = controlling(trial)
        if early.ended:
            trial.not_observable("the server serves one connection at a time")
        trial.viewer.say(early, refused)
        answers(trial, early)
        trial.expect(not busy(trial, early), f"{what}, refused, was answered busy as well")
        trial.viewer.say(early, camera_pose())
        answers(trial, early)
        trial.expect(
            busy(trial, early), f"after {what}, a good pose beside a client in control: no busy"
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
    if trial.facts.lacks("capability:objects") is None:
        found["a pose of an unknown object"] = placed("no such object", AT_REST)
        found["a pose of an object without size"] = placed(DEFAULT, AT_REST, 0.0)
    if trial.facts.lacks("capability:time") is None:
        found["a time that is no number"] = {"type": "set_time", "time": "now"}
    if trial.facts.lacks("capability:intrinsics") is None and trial.facts.first is not None:
        width, height = trial.facts.size
        lens = lens_of(trial.facts.first, width, 2 * height + 2, 1.0, 1.0, 0.0, 0.0)
        found["a pose with intrinsics of another shape"] = camera_pose() | {"intrinsics": lens}
    return found


@check("CTL-2", observable="how many errors come of many poses", needs=SPEAKS)
def check_tells_it_once(trial: ServerTrial) -> None:
    """Two clients without control send poses of every kind, many times, beside one of 1.0; then
    control passes to one of them, which poses on.
    """
    first = controlling(trial)
    others = [further(trial, first) for _ in range(2)]
    old = trial.dial("msg")
    for number in trial.each(range(AGAIN)):
        for place, other in enumerate((*others, old), 2):
            for pose in poses(trial, place + number / 16).values():
                trial.viewer.say(other, pose)
            if number == 0:
                trial.expect(answers(trial, other) or other is old, "a pose, and no more answers")
        trial.delivered += 1
    for number, other in enumerate(others, 2):
        answers(trial, other)
        told = busy(trial, other)
        trial.expect(told <= 1, f"client {number} was told busy {told} times")
    first.close()
    heir, rest = others
    for _ in range(AGAIN):
        trial.viewer.say(heir, poses(trial, 9.0)["camera_pose"])
        trial.viewer.say(rest, poses(trial, 8.0)["camera_pose"])
        answers(trial, heir)
    for number, other in enumerate(others, 2):
        told = busy(trial, other)
        trial.expect(told <= 1, f"after control had passed, client {number} has {told} times busy")
    trial.delivered += 1


@check(
    "CTL-5",
    observable="the first frames after control passed on, and nobody posed",
    needs=("1.1", "frames"),
)
def check_control_passes_with_the_newest_poses(trial: ServerTrial) -> None:
    """Three clients, of 1.1, 1.0 and 1.1, pose many times; the first closes, then the next."""
    steering, first = Steering(trial), trial.commanding()
    trial.expect(steering.shows(first, camera_pose((0.0, 0.0, 3.0))), "no frame shows a good pose")
    old = trial.dial("msg")
    trial.answers(old)
    third = further(trial, first, old)
    clients = ((old, -1.0), (third, -4.0))
    for number in range(3):
        for client, place in clients:
            for pose in (camera_pose((place, number, 0.0)), _cloud(place + number)):
                trial.viewer.say(client, pose)
            trial.answers(client)
    left = first
    for client, place in trial.each(clients):
        wanted, since = camera_of(camera_pose((place, 2.0, 0.0))), steering.count
        left.close()
        what = f"control passed to a client of {'1.0' if client is old else '1.1'};"
        trial.expect(
            trial.wait(lambda: any(it.shows(wanted) for it in steering.cameras(since))),  # noqa: B023
            f"{what} no frame shows the newest camera that it sent",
        )
        trial.wait(lambda: _depth_of_cloud(trial, steering) == place + 2.0, EFFECT_SECONDS)  # noqa: B023
        z = _depth_of_cloud(trial, steering)
        trial.expect(
            z == place + 2.0,
            f"{what} the Gaussians are at z = {z}, and its newest pose of them has {place + 2.0}",
        )
        left = client
        trial.delivered += 1
    steering.shows(third, camera_pose((0.0, 0.0, 3.0)))
    trial.viewer.say(third, at_rest())
    trial.answers(third)


def _depth_of_cloud(trial: ServerTrial, steering: Steering) -> float:
    """Where the newest frame has the Gaussians, along z, which is a small integer here."""
    newest = trial.viewer.with_(steering.reader).frames[-1]
    return round(float(placed_in(newest, DEFAULT).pose.position[2]), 4)


def _cloud(z: float) -> Json:
    return camera_pose((0.0, 0.0, z), kind="point_cloud_pose")


@check(
    "CTL-3",
    observable="the cameras and times of frames after the client that set them has gone",
    needs=("1.1", "frames", "pixels"),
)
def check_lens_and_time_end_with_their_client(trial: ServerTrial) -> None:
    """A client sets intrinsics and time and closes; one of 1.0, then one of 1.1 poses after it."""
    first = first_view(trial, 0.0)
    own = {name: first.frame["camera"][name] for name in LENS}
    size = first.camera.width, first.camera.height
    lens = lens_of(first, *size, 0.5, 0.5, 0.1, 0.1)
    has_lens = trial.facts.lacks("capability:intrinsics") is None
    span = trial.facts.time_range()
    if trial.facts.lacks("capability:time") is not None:
        span = None
    if not (has_lens or span):
        trial.not_observable("the server grants neither intrinsics nor time")
    odd = 0.0 if span is None else span[0] + 0.3718281828 * (span[1] - span[0])
    for next_speaks in trial.each(("1.0", "1.1")):
        trial.peer.close_all()
        studio = Studio(trial)
        sets = studio.look(
            *([set_time(odd)] if span else []), **({"intrinsics": lens} if has_lens else {})
        )
        waiting = trial.dial("msg") if next_speaks == "1.0" else further(trial, studio.poser)
        pose = camera_pose((0.5, 0.25, -1.5))
        trial.viewer.say(waiting, pose)
        trial.answers(waiting)
        studio.poser.close()
        seen = trial.sees(studio.photographer.reader, pose)
        if seen is None:
            trial.not_observable("control did not pass on")
        studio.photographer.new()
        wrong = in_force(seen, own)
        what = f"its client had closed, a client of {next_speaks} posed the camera"
        trial.expect(not (has_lens and wrong), f"{what}, and of intrinsics {wrong}")
        trial.expect(
            not span or seen["time"] != sets.frame["time"],
            f"{what}, and time is still {seen['time']}",
        )
        trial.delivered += 1
