"""Checks on how servers take the text of payloads (spec 1.0 section 2.2)."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from operator import attrgetter, itemgetter

from hypothesis import strategies as st

from splatbus_conformance.cases.malformed.poses import broken_poses
from splatbus_conformance.cases.malformed.text import BrokenText, broken_texts
from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.checks.v1_0.jsn.next_packet import SPARE, named
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.moves.exchanges.exchange import in_use
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.messages import Json, camera_pose, encode, hello
from splatbus_conformance.wire.packets import packet

REQUESTS: tuple[Json, ...] = (
    VIEWPORT_REQUEST,
    {"type": "get_camera_pose", "cam_idx": 0},
    {"type": "get_camera_pose", "cam_idx": -9_007_199_254_740_991},
    {"type": "get_camera_pose", "cam_idx": 1_000_000, "timestamp": 1_700_000_000.25},
    {"type": "get_viewport_size", "timestamp": 5e-324},
)
FAR: Json = camera_pose((30.5, -20.25, 10.125), (0.5, -0.5, 0.5, 0.5))
"""A good pose that no check asks for otherwise."""
NEAR: Json = camera_pose((-1.0153546333312988, 0.0, 2.5e-7), (0, 0.6, 0, 0.8))

ODD_MESSAGES: tuple[Json, ...] = (
    {"type": "hello"},
    {"type": "hello", "versions": 1.1, "client": None, "capabilities": {}},
    {"type": "hello", "versions": [[]], "client": {"name": 5}, "capabilities": [None]},
    {"type": "get_camera_pose"},
    {"type": "get_camera_pose", "cam_idx": [0]},
    {"type": "get_camera_pose", "cam_idx": 1.5},
    {"type": "get_camera_pose", "cam_idx": 10**300},
    {"type": "get_viewport_size", "timestamp": "now"},
    {"type": "get_viewport_size", "id": {"": []}},
    {"type": "opened", "generation": -1},
    {"type": "release", "generation": "1", "seq": None},
    {"type": "closed"},
    {"type": "open_failed", "generation": 1e300, "reason": 5},
    {"type": "subscribe", "channels": "color"},
    {"type": {"type": "camera_pose"}},
    {"type": "\x00" * 1000},
    {"type": "weather_report", "report": "r" * 1_000_000},
    {"type": "object_pose", "object": {}, "scale": "large"},
    camera_pose() | {"intrinsics": [], "tag": 5},
    camera_pose() | {"intrinsics": {"fx": 1e300, "width": -1}},
    {"type": "set_time", "time": None},
    {"type": "set_viewport", "width": 1e300, "height": 0.5},
    {"type": "subscribe_telemetry", "names": {"all": True}},
    {"type": "ping", "t": []},
)
"""Messages that break rules of their own."""


Payload = tuple[object, bytes]
"""What it is one of, and its text."""


@contextmanager
def steering(trial: ServerTrial) -> Iterator[CameraControl]:
    """Frames that show a good pose, of the message connection in use."""
    control = CameraControl(trial)
    shown = control.shows(in_use(trial), camera_pose())
    trial.expect(shown, "not-applied", "no frame shows a good pose")
    yield control


def odd_payloads(good: Json) -> list[Payload]:
    """Payloads that break a rule of their text, or of their message."""
    found: list[Payload] = [(text.kind, text.payload) for text in broken_texts(good)]
    return [*found, *((str(it.get("type")), encode(it)) for it in ODD_MESSAGES)]


def mangled() -> st.SearchStrategy[Payload]:
    """Payloads that were good before some of their bytes were lost, doubled or changed."""
    goods = [encode(message) for message in (*REQUESTS, FAR, hello(["host_shm"]))]
    edit = st.tuples(st.integers(0, 200), st.binary(max_size=3), st.integers(0, 3))
    whole = st.tuples(st.sampled_from(goods), st.lists(edit, min_size=1, max_size=4))
    edited = whole.map(lambda drawn: _edited(*drawn)) | st.binary(min_size=1, max_size=64)
    return st.tuples(st.none(), edited)


def _edited(payload: bytes, edits: Sequence[tuple[int, bytes, int]]) -> bytes:
    for place, put, gone in edits:
        at = place % len(payload) if payload else 0
        payload = payload[:at] + put + payload[at + gone :]
    return payload or b"\x00"


@check(
    "JSN-8",
    on={SERVER: ()},
    observable="the server does not answer such a request",
    cases=Cases([*broken_texts(REQUESTS[3]), *broken_texts(hello([]))], kind=attrgetter("kind")),
    may_crash=True,
)
def check_does_not_answer_broken_text(trial: ServerTrial, text: BrokenText) -> None:
    """Requests whose text breaks JSN-1 to JSN-5 one at a time, and `hello` too: whoever reads them
    leniently answers.
    """
    outcome = trial.outcome_on_msg(in_use(trial), packet(text.payload))
    trial.judge(outcome, named([text]))


@check(
    "JSN-8",
    observable="no frame shows the camera of such a pose",
    on={SERVER: ("frames",)},
    given=steering,
    cases=Cases(broken_texts(FAR), kind=attrgetter("kind"), spare=SPARE),
    may_crash=True,
)
def check_does_not_move_by_broken_text(
    trial: ServerTrial, given: CameraControl, text: BrokenText
) -> None:
    """Poses whose text breaks JSN-1 to JSN-5: afterwards the camera is where it was."""
    outcome = given.outcome_of(in_use(trial), text.payload)
    trial.judge("ignores" if outcome == "keeps" else outcome, f"a pose with {named([text])}")


@check(
    "JSN-10",
    on={SERVER: ()},
    observable="the process lives and answers the request that follows, or the next client",
    cases=Cases(
        [*odd_payloads(FAR), *((it.requirement, it.payload) for it in broken_poses(FAR))],
        *(mangled(), itemgetter(0)),
        quick=60,
        full=3000,
    ),
    may_crash=True,
)
def check_survives_broken_payloads(trial: ServerTrial, case: Payload) -> None:
    """Broken texts, broken poses, messages that miss or mistype members, and payloads of any
    bytes, on the message channel.
    """
    _, payload = case
    outcome = trial.outcome_on_msg(in_use(trial), packet(payload))
    answered = outcome in ("replies", "reports")
    trial.judge("ignores" if answered else outcome, f"the payload {shown(payload)}")


@check(
    "JSN-10",
    on={SERVER: ()},
    observable="the process lives, and goes on or serves the next client",
    may_crash=True,
)
def check_survives_broken_payloads_on_ipc(trial: ServerTrial) -> None:
    """The same, all of them on one IPC connection as long as that lasts."""
    connection, sent = trial.dial("ipc"), b""
    good = hello(["host_shm"])
    listed = odd_payloads(good)
    for _, payload in trial.each(listed, mangled(), kind=itemgetter(0), quick=60, full=1000):
        if connection.ended:
            _expect_alive(trial, sent)
            connection.close()
            connection = trial.dial("ipc")
        sent = payload
        connection.send(packet(sent))
        trial.rest(0.0)
        _expect_alive(trial, sent)
        trial.delivered += 1
    if trial.facts.welcome["ipc"] is not None and not connection.ended:
        connection.send(packet(encode(good)))
        trial.is_welcomed(connection)  # or it is ended: the server has come to the last of them
        _expect_alive(trial, sent)
    served = trial.serves()
    trial.judge("ignores" if served else "hangs", "broken payloads in a row")
    connection.close()
    if trial.facts.welcome["ipc"] is not None:
        _, answer = trial.answered("ipc")
        welcomed = answer is not None and answer["type"] == "welcome"
        trial.expect(welcomed, "no-welcome", "the next IPC client has no welcome")


def _expect_alive(trial: ServerTrial, payload: bytes) -> None:
    if fate := trial.fate():
        trial.judge(fate, f"the payload {shown(payload)} on the IPC channel")


@check(
    "JSN-11",
    observable="a frame shows all of such a pose, or none of it, or the connection is closed",
    on={SERVER: ("frames",)},
    given=steering,
    cases=Cases((FAR, NEAR)),
    may_crash=True,
)
def check_takes_strings_for_numbers_or_not(
    trial: ServerTrial, given: CameraControl, pose: Json
) -> None:
    """A pose of a 1.0 client, with every number as a string: taken, or not."""
    outcome = given.outcome_of(in_use(trial), encode(in_strings(pose)))
    if outcome == "applies" and given.shows_now(pose):
        outcome = "accepts"
    trial.judge(outcome, "a pose whose numbers are strings")


def shown(payload: bytes) -> str:
    """A payload, cut when it is long."""
    return shorten(repr(payload)[1:], 300)


def in_strings(pose: Json) -> Json:
    """A pose with every number as a string."""
    parts = ("position", "rotation")
    return pose | {part: {n: repr(v) for n, v in pose[part].items()} for part in parts}
