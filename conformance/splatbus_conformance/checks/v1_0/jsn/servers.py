"""Checks on how servers take the text of payloads (spec 1.0 section 2.2)."""

from collections.abc import Sequence
from operator import itemgetter
from typing import NamedTuple

from hypothesis import strategies as st

from splatbus_conformance.cases.malformed.poses import broken_poses
from splatbus_conformance.cases.malformed.text import BrokenText, broken_texts
from splatbus_conformance.checks import check
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.messages import Json, camera_pose, encode, hello
from splatbus_conformance.wire.packets import packet

SPARE = 12
"""Broken texts that the quick profile delivers beside one of each kind, where each takes long."""
UNKNOWN: Json = {"type": "weather_report", "sunny": True}

REQUESTS: tuple[Json, ...] = (
    VIEWPORT_REQUEST,
    {"type": "get_camera_pose", "cam_idx": 0},
    {"type": "get_camera_pose", "cam_idx": -9_007_199_254_740_991},
    {"type": "get_camera_pose", "cam_idx": 1_000_000, "timestamp": 1_700_000_000.25},
    {"type": "get_viewport_size", "timestamp": 5e-324},
)
FAR: Json = camera_pose((30.5, -20.25, 10.125), (0.5, -0.5, 0.5, 0.5))
"""A good pose that no check asks for otherwise."""
NEAR: Json = camera_pose((-1.0153546333312988, 0.0, 2.5e-7), (0.0, 0.6, 0.0, 0.8))

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


@check("JSN-8", observable="the server does not answer such a request", may_crash=True)
def check_does_not_answer_broken_text(trial: ServerTrial) -> None:
    """Requests whose text breaks JSN-1 to JSN-5 one at a time, and `hello` too: whoever reads them
    leniently answers.
    """
    texts = [text for good in (REQUESTS[3], hello([])) for text in broken_texts(good)]
    connection = trial.dial("msg")
    for text in trial.each(texts, kind=kind_of):
        connection = trial.dial("msg") if connection.ended else connection
        outcome = trial.outcome_on_msg(connection, packet(text.payload))
        trial.judge(outcome, named([text]))


@check(
    "JSN-8",
    observable="no frame shows the camera of such a pose",
    needs=("frames",),
    may_crash=True,
)
def check_does_not_move_by_broken_text(trial: ServerTrial) -> None:
    """Poses whose text breaks JSN-1 to JSN-5: afterwards the camera is where it was."""
    steering, poser = CameraControl(trial), trial.dial("msg")
    trial.expect(steering.shows(poser, camera_pose()), "not-applied", "no frame shows a good pose")
    for text in trial.each(broken_texts(FAR), kind=kind_of, spare=SPARE):
        poser = trial.dial("msg") if poser.ended else poser
        outcome = steering.outcome_of(poser, text.payload)
        trial.judge("ignores" if outcome == "keeps" else outcome, f"a pose with {named([text])}")


@check(
    "JSN-9",
    observable="the server answers the request that follows",
    may_crash=True,
)
def check_handles_the_next_packet(trial: ServerTrial) -> None:
    """After each text that breaks a rule, and after three of them at once, comes a good request;
    a server that closes the connection instead has ignored nothing.
    """
    texts = broken_texts(UNKNOWN)
    rows = [[text] for text in texts] + [texts[i : i + 3] for i in range(0, len(texts), 3)]
    connection, ignored = trial.dial("msg"), 0
    for row in trial.each(rows, kind=lambda it: (len(it), kind_of(it[0]))):
        connection = trial.dial("msg") if connection.ended else connection
        outcome = trial.outcome_on_msg(connection, b"".join(packet(text.payload) for text in row))
        if outcome != "closes":
            answered = outcome in ("ignores", "replies", "reports")
            trial.judge("accepts" if answered else outcome, f"the request after {named(row)}")
            ignored += 1
    if not ignored:
        trial.not_observable("the server closes the connection on all such texts: it ignores none")


@check(
    "JSN-9",
    observable="the server answers the hello that follows, by welcome",
    needs=("1.1",),
    may_crash=True,
)
def check_handles_the_next_packet_on_ipc(trial: ServerTrial) -> None:
    """The same with `hello`, on the IPC channel."""
    trial.greeted("ipc").close()
    ignored = 0
    for text in trial.each(broken_texts(UNKNOWN), kind=kind_of, spare=SPARE):
        connection = trial.before_hello("ipc")
        dealings = trial.viewer.with_(connection)
        connection.send(packet(text.payload))
        trial.viewer.greet(connection)
        trial.wait(lambda: dealings.welcome or connection.ended)  # noqa: B023
        if not connection.ended or trial.fate():
            outcome = "accepts" if dealings.welcome else trial.fate() or "ignores"
            trial.judge(outcome, f"the hello after {named([text])} on the IPC channel")
            ignored += 1
        connection.close()
        trial.delivered += 1
    if not ignored:
        trial.not_observable("the server closes the connection on all such texts: it ignores none")


@check(
    "JSN-10",
    observable="the process lives and answers the request that follows, or the next client",
    may_crash=True,
)
def check_survives_broken_payloads(trial: ServerTrial) -> None:
    """Broken texts, broken poses, messages that miss or mistype members, and payloads of any
    bytes, on the message channel.
    """
    poses = [PayloadCase(pose.requirement, pose.payload) for pose in broken_poses(FAR)]
    connection = trial.dial("msg")
    listed = [*odd_payloads(FAR), *poses]
    for _, payload in trial.each(listed, mangled(), kind=KIND, quick=60, full=3000):
        connection = trial.dial("msg") if connection.ended else connection
        outcome = trial.outcome_on_msg(connection, packet(payload))
        answered = outcome in ("replies", "reports")
        trial.judge("ignores" if answered else outcome, f"the payload {shown(payload)}")


@check(
    "JSN-10",
    observable="the process lives, and goes on or serves the next client",
    may_crash=True,
)
def check_survives_broken_payloads_on_ipc(trial: ServerTrial) -> None:
    """The same, all of them on one IPC connection as long as that lasts."""
    connection, sent = trial.dial("ipc"), b""
    listed = odd_payloads(hello(["host_shm"]))
    for _, payload in trial.each(listed, mangled(), kind=KIND, quick=60, full=1000):
        if connection.ended:
            _expect_alive(trial, sent)
            connection.close()
            connection = trial.dial("ipc")
        sent = payload
        connection.send(packet(sent))
        trial.rest(0.0)
        _expect_alive(trial, sent)
        trial.delivered += 1
    served = trial.serves()
    trial.judge("ignores" if served else trial.fate() or "hangs", "broken payloads in a row")
    connection.close()
    if trial.facts.welcome["ipc"] is not None:
        trial.expect(
            trial.viewer.with_(trial.greeted("ipc")).welcome,
            "no-welcome",
            "the next IPC client has no welcome",
        )


def _expect_alive(trial: ServerTrial, payload: bytes) -> None:
    if fate := trial.fate():
        trial.judge(fate, f"the payload {shown(payload)} on the IPC channel")


@check(
    "JSN-11",
    observable="a frame shows all of such a pose, or none of it, or the connection is closed",
    needs=("frames",),
    may_crash=True,
)
def check_takes_strings_for_numbers_or_not(trial: ServerTrial) -> None:
    """A pose of a 1.0 client, with every number as a string: taken, or not."""
    steering, poser = CameraControl(trial), trial.dial("msg")
    trial.expect(steering.shows(poser, camera_pose()), "not-applied", "no frame shows a good pose")
    for pose in trial.each(
        (FAR, camera_pose((-1.0153546333312988, 0.0, 2.5e-7), (0, 0.6, 0, 0.8)))
    ):
        poser = trial.dial("msg") if poser.ended else poser
        texts = {part: _as_strings(pose[part]) for part in ("position", "rotation")}
        outcome = steering.outcome_of(poser, encode(pose | texts))
        if outcome == "applies" and steering.shows_now(pose):
            outcome = "accepts"
        trial.judge(outcome, "a pose whose numbers are strings")


class PayloadCase(NamedTuple):
    """Something to send, and what it is one of."""

    kind: object
    payload: bytes


KIND = itemgetter(0)


def odd_payloads(good: Json) -> list[PayloadCase]:
    """Payloads that break a rule of their text, or of their message."""
    found = [PayloadCase(text.kind, text.payload) for text in broken_texts(good)]
    return [*found, *(PayloadCase(str(it.get("type")), encode(it)) for it in ODD_MESSAGES)]


def mangled() -> st.SearchStrategy[tuple[object, bytes]]:
    """Payloads that were good before some of their bytes were lost, doubled or changed."""
    goods = [encode(message) for message in (*REQUESTS, FAR, hello(["host_shm"]))]
    edit = st.tuples(st.integers(0, 200), st.binary(max_size=3), st.integers(0, 3))
    whole = st.tuples(st.sampled_from(goods), st.lists(edit, min_size=1, max_size=4))
    edited = whole.map(lambda drawn: _edited(*drawn)) | st.binary(min_size=1, max_size=64)
    return st.tuples(st.none(), edited)


def shown(payload: bytes) -> str:
    """A payload, cut when it is long."""
    return shorten(repr(payload)[1:], 300)


def kind_of(text: BrokenText) -> str:
    """What a broken text is one of."""
    return text.kind


def named(row: Sequence[BrokenText]) -> str:
    """What is wrong with texts."""
    return " and ".join(f"{text.what} ({text.requirement})" for text in row)


def _as_strings(part: Json) -> Json:
    return {name: repr(value) for name, value in part.items()}


def _edited(payload: bytes, edits: Sequence[tuple[int, bytes, int]]) -> bytes:
    for place, put, gone in edits:
        at = place % len(payload) if payload else 0
        payload = payload[:at] + put + payload[at + gone :]
    return payload or b"\x00"
