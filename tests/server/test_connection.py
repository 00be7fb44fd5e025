from __future__ import annotations

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_schemas import LIMITS
from splatbus_server.connection import (
    Connection,
    Refusal,
    Terms,
)
from splatbus_wire.messages import (
    CameraPose,
    Channel,
    GetViewportSize,
    Hello,
    Opened,
    ViewportSize,
)

from tests.peers.raw_client import camera_pose, hello, packet
from tests.server.talk import GUARDED, OPEN, REQUEST, events, greeted, sent


def test_messages_come_out_however_the_bytes_come_in() -> None:
    """[FRM-4]"""
    connection = Connection("msg", OPEN, 0.0)
    stream = REQUEST + packet(camera_pose(1.0)) + REQUEST
    found = [event for byte in stream for event in events(connection, bytes([byte]))]
    assert [type(event) for event in found] == [GetViewportSize, CameraPose, GetViewportSize]
    assert events(connection, stream) == found


@settings(deadline=None)
@given(st.data())
def test_no_division_of_the_stream_changes_what_is_understood(data: st.DataObject) -> None:
    """[FRM-4]"""
    messages = [
        {"type": "get_viewport_size"},
        camera_pose(2.0),
        hello(),
        {"type": "nope"},
        {"type": "get_camera_pose", "cam_idx": 1, "id": 3},
        b"[]",
    ]
    chosen = data.draw(st.lists(st.sampled_from(messages), max_size=8))
    stream = b"".join(map(packet, chosen))
    cuts = data.draw(st.lists(st.integers(0, len(stream)), max_size=8).map(sorted))
    whole, divided = (Connection("msg", OPEN, 0.0) for _ in range(2))
    found = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        if start < end:
            found += events(divided, stream[start:end])
    assert found == (events(whole, stream) if stream else [])
    assert divided.unsent == whole.unsent
    assert divided.ending == whole.ending


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["x", "y", "z", "w", "id"]) | st.text(), inner, max_size=5
        )
    ),
    max_leaves=12,
)


TYPES = [
    *("camera_pose", "point_cloud_pose", "get_viewport_size", "get_camera_pose", "hello"),
    *("opened", "open_failed", "closed", "release", "subscribe", "welcome", "frame"),
]


MEMBERS = [
    *("position", "rotation", "timestamp", "cam_idx", "versions", "client", "capabilities"),
    *("token", "generation", "seq", "reason", "channels", "id"),
]


objects = st.builds(
    lambda kind, members: text_of({"type": kind, **members}),
    st.sampled_from(TYPES),
    st.dictionaries(st.sampled_from(MEMBERS), json_values, max_size=6),
)


def text_of(message: object) -> bytes:
    return json.dumps(message).encode("utf-8", "surrogatepass")


@settings(deadline=None, max_examples=150)
@given(
    st.sampled_from(["ipc", "msg"]),
    st.booleans(),
    st.lists(
        objects | st.binary(min_size=1, max_size=40) | json_values.map(text_of),
        min_size=1,
        max_size=5,
    ),
)
def test_no_payload_is_a_surprise(channel: Channel, greets: bool, payloads: list[bytes]) -> None:
    """[JSN-10, CHN-7, NEG-22, NEG-26]: what arrives is understood, or refused."""
    connection = greeted(channel, "frames") if greets else Connection(channel, OPEN, 0.0)
    events(connection, b"".join(map(packet, payloads)))
    codes = [message.get("code", "welcome") for message in sent(connection)]
    first = codes[:1]
    if greets:
        assert connection.ending is None
    elif channel == "ipc":
        assert (connection.ending is not None) == (first not in ([], ["welcome"]))
    assert greets or first in ([], ["welcome"], ["unsupported_version"], ["invalid_message"])


def test_hello_is_answered_before_what_follows_it() -> None:
    """[NEG-6, NEG-7]"""
    connection = Connection("ipc", OPEN, 0.0)
    data = packet(hello("frames", "x-unknown")) + packet({"type": "opened", "generation": 3})
    first, second = events(connection, data)
    assert isinstance(first, Hello)
    assert second == Opened(3)
    (welcome,) = sent(connection)
    assert welcome["capabilities"] == ["frames"]
    assert connection.has("frames")
    assert not connection.has("host_shm")


def test_a_server_names_what_it_supports_and_closes() -> None:
    """[NEG-10]"""
    connection = Connection("msg", OPEN, 0.0)
    (refusal,) = events(connection, packet(hello(versions=["9.0"])))
    assert isinstance(refusal, Refusal)
    (error,) = sent(connection)
    assert error["code"] == "unsupported_version"
    assert error["supported"] == ["1.0", "1.1"]
    assert connection.ending is not None


@pytest.mark.parametrize("channel", ["ipc", "msg"])
@pytest.mark.parametrize("token", [{}, {"token": "wrong"}, {"token": "secret "}])
def test_a_wrong_token_is_refused(channel: Channel, token: dict[str, str]) -> None:
    """[NEG-18]"""
    connection = Connection(channel, GUARDED, 0.0)
    stream = packet(hello(**token)) + packet(hello(token="secret")) + REQUEST
    (refusal,) = events(connection, stream)
    assert isinstance(refusal, Refusal)
    assert [message["code"] for message in sent(connection)] == ["unauthorized"]
    assert connection.welcome is None
    assert connection.ending is not None


def test_without_its_hello_a_guarded_server_is_deaf() -> None:
    """[NEG-19]"""
    connection = Connection("msg", GUARDED, 0.0)
    stream = REQUEST + packet(camera_pose()) + packet(b"[") + packet({"type": "nope"})
    assert all(isinstance(event, Refusal) for event in events(connection, stream))
    assert not connection.unsent
    assert connection.ending is None
    events(connection, packet(hello(token="secret")))
    assert events(connection, REQUEST) == [GetViewportSize()]


def test_a_guarded_server_awaits_hello_for_ten_seconds() -> None:
    """[NEG-12]"""
    connection = Connection("ipc", GUARDED, 100.0)
    assert connection.deadline == 100.0 + LIMITS["hello_seconds"]
    connection.expire(connection.deadline)
    assert "NEG-12" in str(connection.ending)
    assert Connection("ipc", OPEN, 100.0).deadline == math.inf
    events(greeting := Connection("ipc", GUARDED, 100.0), packet(hello(token="secret")))
    assert greeting.deadline == math.inf


def test_the_ipc_channel_is_never_closed_for_what_it_says_before_hello() -> None:
    """[CHN-7, NEG-22]"""
    connection = Connection("ipc", OPEN, 0.0)
    for payload in (b"\xff", b"[]", b"{", b'{"type":1}', b'{"type":"get_viewport_size"}'):
        (refusal,) = events(connection, packet(payload))
        assert isinstance(refusal, Refusal)
    assert not connection.unsent
    assert connection.ending is None


@pytest.mark.parametrize("channel", ["ipc", "msg"])
def test_a_hello_that_cannot_be_read_is_answered_and_the_last_word(channel: Channel) -> None:
    """[NEG-35, NEG-22]"""
    connection = Connection(channel, OPEN, 0.0)
    (refusal,) = events(connection, packet(hello(versions=[])) + REQUEST)
    assert isinstance(refusal, Refusal)
    (error,) = sent(connection)
    assert (error["type"], error["code"], error["pointer"]) == (
        "error", "invalid_message", "/versions",
    )  # fmt: skip
    assert "NEG-35" in str(connection.ending)


def test_a_second_hello_that_cannot_be_read_is_no_reason_to_close() -> None:
    """[NEG-26, NEG-35]"""
    connection = greeted()
    events(connection, packet({"type": "hello"}) + REQUEST)
    assert [message["code"] for message in sent(connection)] == ["invalid_message"]
    assert connection.ending is None


@pytest.mark.parametrize("terms", [OPEN, GUARDED])
def test_who_agrees_upon_1_0_has_what_1_0_has(terms: Terms) -> None:
    """[NEG-33, NEG-31]"""
    connection = Connection("msg", terms, 0.0)
    first = hello("frames", versions=["1.0", "1.1"], token="secret")
    greeting, *later = events(connection, packet(first) + packet({"type": "nope"}) + REQUEST)
    assert isinstance(greeting, Hello)
    assert [type(event) for event in later] == [Refusal, GetViewportSize]
    (welcome,) = sent(connection)
    assert (welcome["version"], welcome["capabilities"]) == ("1.0", [])
    assert connection.welcome is None
    assert not connection.has("frames")
    connection.send(ViewportSize(4, 2))
    assert sent(connection) == [{"viewport_size": [4, 2]}]
    (refusal,) = events(connection, packet(hello(token="secret")))
    assert isinstance(refusal, Refusal)
    assert sent(connection) == []
    assert connection.deadline == math.inf


@pytest.mark.parametrize(
    "payload",
    [
        b'{"type":"get_camera_pose"}',
        b'{"type":"get_camera_pose","cam_idx":"0"}',
        b'{"type":"get_camera_pose","cam_idx":0.5}',
        b'{"type":"get_camera_pose","cam_idx":9007199254740992}',
    ],
)
def test_a_client_that_awaits_a_reply_in_vain_is_told_by_a_close(payload: bytes) -> None:
    """[REQ-9]"""
    connection = Connection("msg", OPEN, 0.0)
    (refusal,) = events(connection, packet(payload) + REQUEST)
    assert isinstance(refusal, Refusal)
    assert not connection.unsent
    assert "REQ-9" in str(connection.ending)


@pytest.mark.parametrize("identifier", [0, 7, 7.0, 2**53 - 1])
def test_after_hello_a_bad_request_is_answered_with_its_id(identifier: float) -> None:
    """[NEG-26, NEG-29, JSN-6]"""
    connection = greeted()
    events(connection, packet({"type": "get_camera_pose", "id": identifier}) + REQUEST)
    (error,) = sent(connection)
    assert error["type"] == "error"
    assert error["code"] == "invalid_message"
    assert repr(error["id"]) == repr(int(identifier))
    assert error["pointer"] == "/cam_idx"
    assert connection.ending is None


@pytest.mark.parametrize("identifier", [-1, 7.5, 2**53, 1e300, "7", True, None, [7]])
def test_what_is_no_id_is_not_sent_back(identifier: object) -> None:
    """[NEG-27]"""
    connection = greeted()
    events(connection, packet({"type": "get_viewport_size", "id": identifier}))
    (error,) = sent(connection)
    assert error["pointer"] == "/id"
    assert "id" not in error


@pytest.mark.parametrize("channel", ["msg", "ipc"])
@pytest.mark.parametrize("kind", ["camera_pose", "set_time", "weather", None, ["ping"]])
def test_an_error_about_no_request_has_no_id(channel: Channel, kind: object) -> None:
    """[NEG-23]: a client would take it for the answer to its request."""
    connection = greeted(channel)
    events(connection, packet({"type": kind, "id": 7}))
    (error,) = sent(connection)
    assert error["type"] == "error"
    assert "id" not in error


@pytest.mark.parametrize(
    ("message", "code"),
    [
        (b'{"type":', "malformed_json"),
        (b"[1, 2]", "not_an_object"),
        ({"type": "teleport"}, "unknown_type"),
        (camera_pose(1e39), "invalid_number"),
        (camera_pose(rotation=dict.fromkeys("xyzw", 1.0)), "invalid_rotation"),
    ],
)
def test_an_error_has_the_code_of_what_was_wrong_and_the_connection_goes_on(
    message: object, code: str
) -> None:
    """[NEG-26]"""
    connection = greeted()
    assert events(connection, packet(message) + REQUEST)[1:] == [GetViewportSize()]
    assert [error["code"] for error in sent(connection)] == [code]
    assert connection.ending is None


def test_a_second_hello_is_refused_and_the_first_stays() -> None:
    """[NEG-3]"""
    connection = greeted("ipc", "frames")
    events(connection, packet(hello()))
    (error,) = sent(connection)
    assert (error["code"], "NEG-3" in str(error["message"])) == ("invalid_message", True)
    assert connection.has("frames")


@pytest.mark.parametrize(
    ("header", "code"), [(0, "malformed_packet"), (0xFFFFFFFF, "packet_too_large")]
)
def test_a_bad_header_ends_the_connection_after_what_came_before(header: int, code: str) -> None:
    """[FRM-3, NEG-25]"""
    connection = greeted()
    first, refusal = events(connection, REQUEST + header.to_bytes(4, "little") + REQUEST)
    assert first == GetViewportSize()
    assert isinstance(refusal, Refusal)
    assert [message["code"] for message in sent(connection)] == [code]
    assert connection.ending is not None
