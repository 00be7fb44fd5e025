"""Requests and replies: what a server answers, and a client understands (spec 1.0 chapter 6)."""

import itertools
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS, examples

from splatbus_conformance.cases.malformed.replies import BAD_REPLIES as BAD_REPLIES_OF_1_1
from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.cases.valid.numbers import hard_numbers
from splatbus_conformance.cases.valid.poses import Pose, poses
from splatbus_conformance.checks import CLIENT, SERVER, Cases, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.controls import CAMERA_REQUEST, VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.exchanges.answered import every_request, replies_after
from splatbus_conformance.trials.moves.exchanges.asking import asking
from splatbus_conformance.trials.moves.exchanges.exchange import in_use
from splatbus_conformance.trials.moves.exchanges.odd_replies import OddReplies
from splatbus_conformance.trials.moves.exchanges.reading import answer_all, outcome_of_reading
from splatbus_conformance.trials.moves.pose_error import (
    PoseError,
    engine_of,
    misread,
    rotation_budget,
    why,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.adapter import AdapterBroken, Declined
from splatbus_conformance.trials.testee.adapter_smoke import GIVING_UP_SECONDS
from splatbus_conformance.trials.trial import JITTER_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire import messages
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.message_kinds import CAPABILITIES, REPLY_TO, REQUESTS_1_0
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet

SAFE: int = LIMITS["max_safe_integer"]
ASKED = 1024
"""Cameras to ask for, to learn how many there are."""
MANY_PACKETS = 1000
"""On one connection; what came later would take long to look through again and again."""
FAR_INDICES = (-1, -2, -3, -1024, -(2**31), 2**31, 2**32, 2**32 + 1, 2**53 - 2, SAFE, -SAFE)
BAD_INDICES: tuple[Any, ...] = (
    *(None, True, "0", "", [], [0], {}, 0.5, -0.5, 1e-9, 1e300, -1e300),
    *(SAFE + 1, -SAFE - 1, 2**63, 2**64, 10**300, float(2**60)),
)
BAD_REQUESTS = [
    *(CAMERA_REQUEST | {"cam_idx": index} for index in BAD_INDICES),
    *({"type": "get_camera_pose"}, {"type": "get_camera_pose", "camIdx": 0}),
]
UNKNOWN_TYPES: tuple[Any, ...] = (
    *("weather_report", "", " ", "GET_VIEWPORT_SIZE", "get_viewport_size ", "get_viewport", "\x00"),
    *("viewport_size", "welcome", "error", "frame", "init_packet", "t" * 10_000, "🙂", "__class__"),
    "get_scene",
    *(None, True, 0, 1e308, [], ["get_viewport_size"], {}, {"type": "get_viewport_size"}),
)
UNKNOWN: tuple[Json, ...] = (
    *({"type": kind} for kind in UNKNOWN_TYPES),
    *({}, {"Type": "get_viewport_size"}, {"cam_idx": 0}),
    *(camera_pose() | {"type": kind} for kind in ("pose", "Camera_Pose", None, ["camera_pose"])),
    *(CAMERA_REQUEST | {"type": kind} for kind in ("camera", None, ["get_camera_pose"])),
    {"viewport_size": [64, 48], "type": None},
    {name: value for name, value in camera_pose().items() if name != "type"},
)
MESSAGES: dict[str, Json] = {
    "size": VIEWPORT_REQUEST,
    "camera": CAMERA_REQUEST,
    "unknown": {"type": "weather_report"},
    "pose": camera_pose(),
}
BAD_CAMERAS: tuple[Json, ...] = (
    {"position": [0, 0, 1e39], "rotation": [0, 0, 0, 1]},
    {"position": [0, 0, 0]},
    {"rotation": [0, 0, 0, 1]},
    {"position": [0, 0], "rotation": [0, 0, 0, 1]},
    {"position": {"x": 0, "y": 0, "z": 0}, "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}},
    {"position": [0, 0, None], "rotation": [0, 0, 0, 1]},
    {"position": ["0", "0", "0"], "rotation": ["0", "0", "0", "1"]},
    {"position": [0, 0, 0], "rotation": [0, 0, 0, 0]},
    {"position": [0, 0, 0], "rotation": [0.5, 0.5, 0, 0]},
    {"position": [0, 0, 0], "rotation": [0, 0, 0, 1, 0]},
    {"position": [0, 0, 0], "rotation": [0, 0, 1]},
    {"position": [0, 0, 0], "rotation": []},
    {"position": None, "rotation": None},
)
AGAIN = 3
"""Times that a client is told [0,0] which asks again."""
TOGETHER = 8
"""Cameras that are asked for at once."""
NEXT_SECONDS = 0.05
"""A client that asks for more before it waits does so within this time."""
OWN_SECONDS = 0.3
"""For what the client asks by itself."""
CAMERAS = [
    Pose((float(n), -2.0 * n, 0.5 * n), (0.0, 0.6, 0.0, 0.8) if n % 2 else (0.8, 0.0, 0.0, 0.6))
    for n in range(1, 1 + TOGETHER)
]
REQUESTS = st.lists(
    st.one_of(
        st.just("viewport_size"),
        st.integers(-TOGETHER, 2 * TOGETHER - 1).map(lambda index: {"camera": index}),
    ),
    min_size=2,
    max_size=TOGETHER,
)
SAYS = {
    **dict.fromkeys(("camera_pose", "point_cloud_pose", "get_camera_pose"), ""),
    "get_viewport_size": "",
    "object_pose": "objects",
    "set_time": "time",
    "get_scene": "scene",
    "ping": "ping",
    "subscribe_telemetry": "telemetry",
}
"""Messages of clients that change no size, and the capability of each."""
BORNE = dict.fromkeys(("ignores", "reports", "replies", "closes"), "accepts")
"""Of what may come; whether it was understood is for other sentences to ask."""
ASKS_WHEN_TOLD = {CLIENT: ("msg", "adapter:ask")}


# What a server answers


@check("REQ-6", on={SERVER: ()})
def check_camera_index_is_taken_modulo(trial: ServerTrial) -> None:
    """A thousand cameras are asked for, which shows after how many they come again; then indices
    that are negative, and as large as they may be.
    """
    first = cameras(trial, range(ASKED))
    period = next((n for n in range(1, ASKED // 2 + 1) if first[n:] == first[:-n]), None)
    if period is None:
        half = first[ASKED // 2 :]
        trial.expect(
            any(each != half[0] for each in half),
            "cameras-alike",
            f"every camera from index {ASKED // 2} to {ASKED - 1} is the same",
        )
        trial.not_observable(f"the scene comes with more than {ASKED // 2} cameras")
    for index in trial.each(FAR_INDICES):
        (told,) = cameras(trial, [index])
        of = f"camera {index % period} of {period}"
        trial.expect(
            told == first[index % period], "another-camera", f"camera {index} is {told}, not {of}"
        )


def cameras(trial: ServerTrial, indices: range | list[int]) -> list[Json]:
    """The replies for these cameras; the requirement is violated if one does not come."""
    connection = trial.dial("msg")
    requests = [packet(encode(CAMERA_REQUEST | {"cam_idx": index})) for index in indices]
    connection.send(b"".join(requests))
    told = replies_after(trial, connection, 0, len(requests))
    asked = f"{len(requests)} requests for a camera, from {indices[0]} to {indices[-1]}"
    trial.expect(len(told) >= len(requests), "no-reply", f"{len(told)} replies to {asked}")
    other = [each for each in told if "position" not in each]
    trial.expect(
        not other,
        "another-answer",
        f"the reply to one of {asked} tells of no camera: {show(other[:1])}",
    )
    connection.close()
    return told


@check(
    "REQ-7",
    on={SERVER: ()},
    cases=Cases(
        [["size", "camera", "camera", "size", "pose", "unknown"] * 40],
        st.lists(st.sampled_from(("size", "camera", "unknown", "pose")), min_size=1, max_size=40),
        quick=30,
        full=1000,
    ),
)
def check_one_reply_each_in_order(trial: ServerTrial, kinds: list[str]) -> None:
    """Requests of both kinds in any order, with poses and unknown messages among them, in one
    write.
    """
    connection = in_use(trial)
    if len(connection.messages) > MANY_PACKETS:
        connection.close()
        connection = trial.dial("msg")
    before = len(trial.replies(connection))
    sent = [*kinds, "size"]
    asked = [kind for kind in sent if kind in ("size", "camera")]
    connection.send(b"".join(packet(encode(MESSAGES[kind])) for kind in sent))
    replies = replies_after(trial, connection, before, len(asked))
    told = ["size" if "viewport_size" in each else "camera" for each in replies]
    what = f"{len(told)} replies {show(told)} to {len(asked)} requests {show(asked)}"
    trial.expect(told == asked, "other-replies", what)


@check("REQ-7", on={SERVER: ()}, cases=Cases((1, 2, 50)), may_crash=True)
def check_answers_what_came_before_a_broken_request(trial: ServerTrial, count: int) -> None:
    """Good requests and then a broken one, for which the connection may be closed (REQ-9)."""
    connection = trial.dial("msg")
    good = [(VIEWPORT_REQUEST, CAMERA_REQUEST)[number % 2] for number in range(count)]
    broken = CAMERA_REQUEST | {"cam_idx": "0"}
    connection.send(b"".join(packet(encode(each)) for each in (*good, broken)))
    told = replies_after(trial, connection, 0, count)
    what = f"{len(told)} replies to {count} requests and a broken one behind them"
    trial.expect(len(told) == count, "wrong-count", what)
    connection.close()


def _unknown(trial: ServerTrial) -> Cases:
    """The `hello` of a client of 1.1 is one where the server speaks 1.0 alone."""
    hello = messages.hello([*CAPABILITIES["msg"]], None)
    return Cases([*([hello] if trial.facts.version() == "1.0" else []), *UNKNOWN])


@check("REQ-8", on={SERVER: ()}, cases=_unknown, may_crash=True)
def check_unknown_messages_are_ignored(trial: ServerTrial, message: Json) -> None:
    """Types that nobody knows before `hello`, or that are no strings, and messages without any;
    `hello`, where the server speaks 1.0 alone.
    """
    outcome = trial.outcome_on_msg(in_use(trial), packet(encode(message)))
    trial.judge(outcome, f"the message {shorten(str(message))}")


@check(
    "REQ-9",
    on={SERVER: ()},
    cases=lambda trial: Cases(
        list(itertools.product([False, True][: 1 + bool(trial.facts.welcome["msg"])], BAD_REQUESTS))
    ),
    may_crash=True,
)
def check_broken_requests_have_no_reply(trial: ServerTrial, case: tuple[bool, Json]) -> None:
    """Requests for a camera without an index, or with one that is no integer or out of range, of a
    client of 1.0, and of one of 1.1 that gives them ids; an `error` is no reply (1.1 section 2.6).
    """
    greets, asked = case
    connection = in_use(trial)
    if greets:
        asked = asked | {"id": 7}
        if trial.with_(connection).welcome is None:
            connection.close()
            connection = trial.greeted("msg")
    outcome = trial.outcome_on_msg(connection, packet(encode(asked)))
    reported = greets and outcome == "reports"
    trial.judge("ignores" if reported else outcome, f"the request {shorten(str(asked))}")


@check("REQ-10", on={SERVER: ()}, cases=Cases(range(3)))
def check_replies_do_not_wait_for_an_image(trial: ServerTrial, number: int) -> bool:
    """A pose and requests of every kind, from a client that is the only one: no image is due for
    anybody. A server that renders all the time and holds each reply until then is not seen to.
    """
    trial.peer.close_all()
    connection = trial.greeted("msg") if trial.facts.welcome["msg"] else trial.dial("msg")
    trial.rest(REACTION_SECONDS)
    trial.viewer.say(connection, camera_pose((float(number), 0.0, 0.0)))
    answers = []
    for request in every_request(trial, connection):
        if request["type"] != "set_viewport":  # a size is had when there is memory of it
            told = trial.ask(connection, request)
            trial.expect(told is not None, "no-reply", f"no reply to {request} without an image")
            answers.append(told)
    return any(told and told.get("type") != "error" for told in answers)


# What a client makes of it


@check("REQ-12", on={CLIENT: ("asks",)})
def check_asks_again_after_a_while(trial: ClientTrial) -> None:
    """The size is [0,0] at first; of the requests that follow the soonest counts, since a busy
    machine makes each later.
    """
    trial.role.has_image = False
    connection = trial.connection("msg")

    def asked() -> list[float]:
        requests = (it for it in connection.messages if it.type == "get_viewport_size")
        return [connection.arrived(it) for it in requests]

    trial.wait(lambda: asked() or connection.ended)
    before = len(asked())
    if not before:
        trial.not_observable("the testee does not ask for the size when it connects")
    trial.wait(lambda: len(asked()) >= before + AGAIN or connection.ended)
    trial.role.has_image = True
    times = asked()[before - 1 :]
    if len(times) == 1:
        trial.expect(not trial.fate(), "ended", "told [0,0], it did not go on")
        trial.not_observable("the testee does not ask again: it may not need the size")
    seconds = min(later - told for told, later in itertools.pairwise(times))
    least = LIMITS["ask_again_min_seconds"]
    told = f"it asked again {1000 * seconds:.0f} ms later; {1000 * least:.0f} are asked for"
    trial.expect(seconds >= least - JITTER_SECONDS, "too-soon", told)


def bad_replies(trial: ClientTrial) -> Cases:
    """Replies that break REQ-3 or REQ-5, and what each is an example of. Some clients stop when a
    size is not their own: what can be read of a broken one is.
    """
    width, height = trial.role.width, trial.role.height
    odd: list[object] = [
        *([width], [width, height, 1], [-width, height], [str(width), str(height)]),
        *([[width, height]], [True, True], f"{width}x{height}", {"w": width, "h": height}),
    ]
    none: list[object] = [None, [width + 0.5, height], [float(width), float(height)]]
    none += [[1e300, 1e300], [2**63, 2**64], [None, None]]
    others = [{}, *({"viewport_size": size} for size in none), *BAD_CAMERAS]
    return Cases(
        [
            *(("odd", {"viewport_size": size}) for size in odd),
            *((json.dumps(bad), bad) for bad in others),
        ],
        kind=lambda case: case[0],
    )


@check("REQ-13", on={CLIENT: ("asks",)}, cases=bad_replies, may_crash=True)
def check_survives_bad_replies(trial: ClientTrial, case: tuple[str, Json]) -> bool:
    """A request is answered with a reply that breaks its form, one way after another; of the size
    or of the camera, where the testee asks for both.
    """
    _, bad = case
    about = "position" if {"position", "rotation"} & bad.keys() else "viewport_size"
    request = "get_camera_pose" if about == "position" else "get_viewport_size"
    return _survives(trial, bad, lambda it: about in it or request not in trial.facts.asks)


def _of_1_1(trial: ClientTrial) -> Cases:
    kinds = sorted(REPLY_TO[request] for request in trial.facts.asks - set(REQUESTS_1_0))
    if not kinds:
        trial.not_observable("the testee makes no request of 1.1 when it connects")
    return Cases([(kind, broken) for kind in kinds for broken in BAD_REPLIES_OF_1_1[kind]])


@check("JSN-10", on={CLIENT: ("hello:msg", "asks", "returns:msg")}, cases=_of_1_1, may_crash=True)
def check_survives_bad_replies_of_1_1(trial: ClientTrial, case: tuple[str, Json]) -> bool:
    """Requests of 1.1 that the testee makes by itself are answered with members that are missing,
    of another type, or of values that cannot be.
    """
    kind, bad = case
    return _survives(trial, bad, lambda reply: reply["type"] == kind)


def _told(trial: ClientTrial) -> Cases:
    kinds = {"camera", "scene"} & {REPLY_TO[request] for request in trial.facts.asks}
    if not kinds:
        trial.not_observable("the testee asks for no camera and no scene when it connects")
    found = [(it, each.message) for it in sorted(kinds) for each in examples(it, "1.1")[0]]
    # Only images show of what size a lens has to be [CAM-8].
    return Cases([(kind, message) for kind, message in found if "intrinsics" not in message])


def _said(trial: ServerTrial) -> Cases:
    mine = [kind for kind, of in SAYS.items() if not of or trial.facts.grants(of)]
    found = [(kind, each.message) for kind in mine for each in examples(kind, "1.1")[0]]
    return Cases([(kind, said) for kind, said in found if "intrinsics" not in said])


@check(
    "NEG-42",
    on={CLIENT: ("hello:msg", "asks", "returns:msg"), SERVER: ("1.1",)},
    cases={CLIENT: _told, SERVER: _said},
    may_crash=True,
)
def check_bears_what_may_come(trial: ClientTrial | ServerTrial, case: tuple[str, Json]) -> bool:
    """Messages that break nothing: null where that is allowed, members that are not known, the
    least and the greatest of numbers and texts; to a client in reply to what it asks by itself.
    """
    kind, allowed = case
    if isinstance(trial, ClientTrial):
        members = {name: it for name, it in allowed.items() if name not in ("type", "id")}
        return _survives(trial, members, lambda reply: reply.get("type") == kind, BORNE)
    newest = trial.peer.newest("msg", lambda it: not it.gone and trial.with_(it).welcome)
    outcome = trial.outcome(newest or trial.greeted("msg"), packet(encode(allowed)))
    trial.judge(BORNE.get(outcome, outcome), shorten(json.dumps(allowed), 400))
    return outcome in BORNE


def _survives(
    trial: ClientTrial,
    bad: Json,
    spoils: Callable[[Json], bool],
    called: Mapping[str, str] = MappingProxyType({}),
) -> bool:
    """The next reply to which that applies has these members and no others, and no later one: who
    closes for it, and comes back, is told what is right. Outcomes may be called otherwise.
    """
    replied: list[Json] = []

    def spoilt(reply: Json) -> Json:
        if replied or not spoils(reply):
            return reply
        replied.append({n: reply[n] for n in ("type", "id") if n in reply} | bad)
        return replied[-1]

    connection = asking(trial)
    trial.role.spoil = spoilt
    answer_all(trial, connection)
    what = f"the reply {shorten(json.dumps(bad), 400)}"
    if not trial.wait(lambda: replied or connection.ended):
        trial.not_observable(f"the testee did not ask again for what has {what}")
    before = trial.controls
    outcome = outcome_of_reading(trial, connection)
    trial.judge(called.get(outcome, outcome), what)
    return trial.controls > before


@contextmanager
def odd_replies(trial: ClientTrial) -> Iterator[OddReplies]:
    """A client that asks what it is told to; what is measured of it has to keep its budgets."""
    answering = OddReplies(trial)
    trial.connection("msg")
    trial.rest(OWN_SECONDS)
    yield answering
    trial.expect_within_budgets()


def fewer(case: list[Any]) -> list[list[Any]]:
    """Shorter lists, but not the empty one."""
    return [shorter for shorter in without_one(case) if shorter]


def poses_together(trial: ClientTrial, answering: OddReplies) -> Cases:
    """Poses on the wire, near every edge of what is allowed."""
    search = f"{trial.requirement.id} replies"
    pose = poses(search, single=trial.greeting.single).map(Pose.as_lists)
    drawn = st.lists(pose, min_size=TOGETHER, max_size=TOGETHER)
    return Cases(drawn=drawn, quick=6, full=100, simpler=fewer, search=search)


def made_of_replies(trial: ClientTrial, answering: OddReplies, requests: list[Any]) -> list[Json]:
    """What the client made of the replies to requests that it was told to make. One that was sent
    every reply, and yet waits for one until it closes, breaks REQ-11; other checks can say nothing
    then.
    """
    try:
        replies: list[Json] = trial.take("ask")["replies"]
    except Declined as problem:
        if answering.took > GIVING_UP_SECONDS / 2:
            trial.not_observable(f"on a busy machine its replies came late: {problem}")
        if answering.waiting or not trial.wait(trial.role.is_given_up, GIVING_UP_SECONDS):
            raise
        untaken = (
            f"its requests were answered, and it waited for a reply until it closed: {problem}"
        )
        if trial.requirement.id == "REQ-11":
            trial.violated("reply-not-taken", untaken)
        trial.not_observable(f"{untaken} (REQ-11)")
    if len(replies) != len(requests):
        raise AdapterBroken(f"asked for {len(requests)} replies, it told {len(replies)}")
    return replies


def understood(
    trial: ClientTrial, answering: OddReplies, index: int, reply: Json
) -> tuple[Pose, PoseError]:
    """The pose on the wire that the client made this of, and how far it is off."""
    engine = engine_of(trial.greeting, "camera_pose")
    if "position" not in reply:
        trial.violated("not-a-pose", f"the reply to get_camera_pose was taken for {reply}")
    got = Pose(tuple(reply["position"]), tuple(reply["rotation"]))
    size = trial.role.width, trial.role.height

    def error(wire: Pose) -> PoseError:
        return misread(got, wire, engine, single=trial.greeting.single, size=size)

    found = ((wire, error(wire)) for wire in answering.possible(index))
    # Of two that are as near, such as of which one number is tiny, the worst number tells.
    return min(found, key=lambda it: (it[1].angle + it[1].distance, it[1].position))


def all_understood(
    trial: ClientTrial, answering: OddReplies, count: int
) -> Iterator[tuple[Pose, Json, PoseError]]:
    """The client asks for so many cameras: the pose of each, and what it made of that."""
    requests = [{"camera": index} for index in range(count)]
    answering.ask(requests)
    for index, reply in enumerate(made_of_replies(trial, answering, requests)):
        wire, found = understood(trial, answering, index, reply)
        yield wire, reply, found


@check(
    "REQ-11",
    on=ASKS_WHEN_TOLD,
    given=odd_replies,
    cases=Cases(drawn=REQUESTS, quick=15, full=60, simpler=fewer),
)
def check_matches_replies_by_their_order(
    trial: ClientTrial, answering: OddReplies, requests: list[Any]
) -> None:
    """Requests of both kinds, as many at a time as the client sends before it waits; each camera
    has another pose, and the replies come in order, all at once.
    """
    answering.cameras, answering.holds = CAMERAS, True
    answering.ask(requests)
    _gather(trial, answering, len(requests))
    answering.answer_all()
    replies = made_of_replies(trial, answering, requests)
    for number, (request, reply) in enumerate(zip(requests, replies, strict=True), 1):
        trial.expect(
            _answers(trial, answering, request, reply),
            "another-reply",
            f"of {requests} number {number}, {request}, was given {reply}: the reply to another",
        )


def _gather(trial: ClientTrial, answering: OddReplies, most: int) -> None:
    """Wait for requests for as long as more of them come."""
    known = len(answering.waiting)
    if known < most and trial.wait(lambda: len(answering.waiting) > known, NEXT_SECONDS):
        _gather(trial, answering, most)


def _answers(trial: ClientTrial, answering: OddReplies, request: Any, reply: Json) -> bool:
    if request == "viewport_size":
        size = reply.get("width"), reply.get("height")
        return size == (trial.role.width, trial.role.height)
    if "position" not in reply:
        return False
    return not understood(trial, answering, request["camera"], reply)[1].far


@check("CNV-1", on=ASKS_WHEN_TOLD, given=odd_replies, cases=poses_together)
def check_understands_cameras(trial: ClientTrial, answering: OddReplies, case: list[Any]) -> bool:
    """Poses in replies to `get_camera_pose`, near every edge of what is allowed."""
    answering.cameras = [*map(Pose.of, case)]
    for wire, reply, found in all_understood(trial, answering, len(case)):
        if found.far:
            taken = Pose(tuple(reply["position"]), tuple(reply["rotation"]))
            engine = engine_of(trial.greeting, "camera_pose")
            reason = why(wire, taken, engine, "in") or f"it is {found.away_by} away"
            trial.violated("another-pose", f"the camera {wire} was taken for {reply}: {reason}")
    return bool(answering.told)


@check("ACC-7", on=ASKS_WHEN_TOLD, given=odd_replies, cases=poses_together)
def check_axes_change_exactly_on_the_way_in(
    trial: ClientTrial, answering: OddReplies, case: list[Any]
) -> bool:
    """Poses in replies, from the wire's axes to the engine's: positions exact, or within half an
    ULP where they are scaled; quaternions within 4u.
    """
    answering.cameras = [*map(Pose.of, case)]
    scaled = engine_of(trial.greeting, "camera_pose").scale != 1
    quaternions = rotation_budget(trial.greeting, "camera_pose")
    for wire, _, found in all_understood(trial, answering, len(case)):
        trial.measured("position", found.position, scaled / 2, "ULP", str(wire))
        trial.measured("quaternion", found.rotation, quaternions, "u", str(wire))
        trial.measured("angle", found.angle, None, "rad", str(wire))
    return bool(answering.told)


@check(
    "ACC-14",
    on=ASKS_WHEN_TOLD,
    given=odd_replies,
    cases=Cases(drawn=st.tuples(*[hard_numbers()] * 3), quick=40, full=1000, search="ACC-14"),
)
def check_numbers_are_read_to_the_last_bit(
    trial: ClientTrial, answering: OddReplies, texts: tuple[str, ...]
) -> bool:
    """Cameras whose positions are decimals next to halfway between two doubles, exact, and of 17
    digits; where the engine scales positions or holds them in single precision, after that.
    """
    answering.position = texts
    budget = float(engine_of(trial.greeting, "camera_pose").scale != 1)
    for _, _, found in all_understood(trial, answering, 1):
        trial.measured("position", found.position, budget, "ULP", f"({', '.join(texts)})")
    return bool(answering.told)
