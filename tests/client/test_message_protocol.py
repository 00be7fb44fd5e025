"""The message channel's machine: bytes and times in, events and bytes out."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_client.events import (
    Ignored,
    MustClose,
    Negotiated,
    Refused,
    Replied,
    ServerError,
)
from splatbus_client.message_protocol import MessageProtocol
from splatbus_schemas import LIMITS
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import (
    CameraPose,
    CameraReply,
    GetCameraPose,
    GetViewportSize,
    Intrinsics,
    ObjectPose,
    Pose,
    Program,
    ViewportSize,
)

from tests.client.machines import HELLO, SIZE, machine_of_1_0, machine_of_1_1, receive
from tests.peers.fake_server import CAMERA_REPLY, LENS, POSITION, ROTATION, welcome
from tests.peers.raw_client import packet, packets

INTRINSICS = Intrinsics(**LENS)
POSE = Pose(POSITION, ROTATION)
BROKEN = [
    b"\xff",
    b"[]",
    b"{",
    b'{"viewport_size":[1,2],"viewport_size":[3,4]}',
    b'{"viewport_size":[NaN,2]}',
    b'{"viewport_size":[1e400,2]}',
    b'{"viewport_size":[1.5,2]}',
    b'{"viewport_size":[1]}',
    b'{"viewport_size":"1x2"}',
    b'{"position":[0,0,0],"rotation":[0,0,0,2]}',
    b'{"position":[0,0,0]}',
    b'{"a":' * 100 + b"1" + b"}" * 100,
    b'{"type":"no such type"}',
    b'{"type":7}',
    b'{"type":"error"}',
    b"\xef\xbb\xbf{}",
    b"9" * 5000,
]


def test_hello_comes_first_and_the_question_that_tells_versions_apart_second():
    hello, request = packets(MessageProtocol(HELLO).data_to_send(0.0))
    assert hello["type"] == "hello"
    assert request == {"type": "get_viewport_size"}


def test_a_reply_before_any_welcome_means_1_0():
    machine = MessageProtocol(HELLO)
    machine.data_to_send(0.0)
    events = receive(machine, packet(SIZE), 0.0)
    assert events == [Negotiated("1.0", None, frozenset()), Replied(0, ViewportSize(320, 240))]
    machine.ask(GetCameraPose(3))
    assert packets(machine.data_to_send(0.0)) == [{"type": "get_camera_pose", "cam_idx": 3}]


def test_a_welcome_before_the_reply_means_its_version():
    machine = MessageProtocol(HELLO)
    machine.data_to_send(0.0)
    (event,) = receive(machine, packet(welcome()), 0.0)
    assert event == Negotiated("1.1", Program("fake", "0"), frozenset())
    receive(machine, packet({"type": "viewport_size"} | SIZE), 0.0)
    ticket = machine.ask(GetCameraPose(3))
    (request,) = packets(machine.data_to_send(0.0))
    assert request == {"type": "get_camera_pose", "cam_idx": 3, "id": ticket}


@pytest.mark.parametrize("version", ["1.1", "1.2"])
def test_a_welcome_after_1_0_was_settled_changes_nothing(version):
    machine = machine_of_1_0()
    assert isinstance(receive(machine, packet(welcome(version=version)), 0.0)[0], Ignored)
    assert machine.version == "1.0"


def test_a_version_that_was_not_offered_closes():
    machine = MessageProtocol(HELLO)
    (event,) = receive(machine, packet(welcome(version="1.2")) + packet(SIZE), 0.0)
    assert isinstance(event, MustClose)
    assert "NEG-16" in event.reason


@pytest.mark.parametrize("machine", [machine_of_1_0(), machine_of_1_1()])
def test_requests_go_one_at_a_time_and_each_gets_its_own_reply(machine):
    first, second = machine.ask(GetCameraPose(0)), machine.ask(GetCameraPose(1))
    (request,) = packets(machine.data_to_send(0.0))
    assert request["cam_idx"] == 0
    assert machine.data_to_send(0.0) == b""
    typed = {"type": "camera", "id": first} if machine.version == "1.1" else {}
    assert receive(machine, packet(typed | CAMERA_REPLY), 0.0) == [
        Replied(first, CameraReply(POSE, typed.get("id")))
    ]
    (request,) = packets(machine.data_to_send(0.0))
    assert request["cam_idx"] == 1
    assert second != first


def test_an_equal_request_is_shared_until_it_is_sent():
    machine = machine_of_1_1()
    ticket = machine.ask(GetCameraPose(4))
    assert machine.ask(GetCameraPose(4)) == ticket
    machine.data_to_send(0.0)
    # What the server answers to the first may be older than this question.
    assert machine.ask(GetCameraPose(4)) != ticket


@pytest.mark.parametrize("broken", BROKEN)
def test_a_broken_packet_is_ignored_and_the_reply_after_it_taken(broken):
    machine = MessageProtocol(HELLO)
    machine.data_to_send(0.0)
    ignored, *rest = receive(machine, packet(broken) + packet(SIZE), 0.0)
    assert isinstance(ignored, Ignored)
    assert rest[-1] == Replied(0, ViewportSize(320, 240))


def test_a_broken_reply_never_makes_the_next_one_answer_another_request():
    machine = machine_of_1_0()
    machine.ask(GetCameraPose(0))
    machine.ask(GetCameraPose(1))
    machine.data_to_send(0.0)
    (event,) = receive(machine, packet(CAMERA_REPLY | {"rotation": [0, 0, 0, 1.5]}), 0.0)
    assert isinstance(event, Ignored)
    assert machine.data_to_send(0.0) == b"", "another request went out while one has no answer"


def test_a_reply_that_comes_late_closes():
    machine = MessageProtocol(HELLO)
    machine.data_to_send(5.0)
    due = machine.deadline()
    assert due < 5.0 + LIMITS["reply_seconds"]
    assert machine.expire(due - 0.001) == []
    (event,) = machine.expire(due)
    assert isinstance(event, MustClose)
    assert "CHN-15" in event.reason


def test_no_time_runs_while_nothing_is_asked():
    assert machine_of_1_0().deadline() == math.inf


def test_a_packet_that_is_not_completed_closes_however_slowly_it_drips():
    machine = machine_of_1_0()
    receive(machine, b"\x10", 100.0)
    receive(machine, b"\x00", 109.0)
    receive(machine, b"\x00\x00{", 109.9)
    (event,) = machine.expire(110.0)
    assert isinstance(event, MustClose)
    assert "FRM-5" in event.reason


def test_the_time_of_a_packet_begins_with_its_own_first_byte():
    machine = machine_of_1_0()
    whole = packet({"type": "x"})
    receive(machine, whole[:5], 100.0)
    receive(machine, whole[5:] + b"\x10", 109.0)
    assert machine.deadline() == 119.0


@pytest.mark.parametrize("header", [b"\0\0\0\0", b"\xff\xff\xff\xff", b"GET ", b"\x01\x00\x10\x00"])
def test_a_bad_header_closes_after_the_packets_before_it(header):
    machine = MessageProtocol(HELLO)
    machine.data_to_send(0.0)
    *events, last = receive(machine, packet(SIZE) + header, 0.0)
    assert events[-1] == Replied(0, ViewportSize(320, 240))
    assert isinstance(last, MustClose)
    assert "FRM-3" in last.reason


def test_a_size_that_is_not_known_is_asked_for_again_but_not_at_once():
    machine = MessageProtocol(HELLO)
    machine.data_to_send(0.0)
    receive(machine, packet({"viewport_size": [0, 0]}), 1.0)
    machine.ask(GetViewportSize())
    camera = machine.ask(GetCameraPose(0))
    (request,) = packets(machine.data_to_send(1.0))
    assert request["type"] == "get_camera_pose", "another request need not wait"
    assert receive(machine, packet(CAMERA_REPLY), 1.0) == [Replied(camera, CameraReply(POSE))]
    assert machine.data_to_send(1.0 + LIMITS["ask_again_min_seconds"]) == b""
    due = machine.deadline()
    assert packets(machine.data_to_send(due)) == [{"type": "get_viewport_size"}]


def test_an_error_with_the_request_s_id_answers_it():
    machine = machine_of_1_1()
    ticket = machine.ask(GetCameraPose(0))
    machine.data_to_send(0.0)
    error = {"type": "error", "code": "internal", "message": "no cameras today"}
    pose_refused, answered = receive(machine, packet(error) + packet(error | {"id": ticket}), 0.0)
    assert isinstance(pose_refused, ServerError)
    assert isinstance(answered, Refused)
    assert answered.ticket == ticket


def test_an_error_of_an_unknown_code_closes_nothing():
    machine = machine_of_1_1()
    (event,) = receive(machine, packet({"type": "error", "code": "new", "message": "?"}), 0.0)
    assert isinstance(event, ServerError)


def test_the_newest_pose_of_each_kind_replaces_one_that_is_unsent():
    machine = machine_of_1_0()
    for second in range(5):
        machine.tell(CameraPose(POSE, float(second)))
        if second == 2:
            machine.tell(ObjectPose("default", POSE, 1.0, 2.5))
    cloud, camera = packets(machine.data_to_send(0.0))
    assert (cloud["timestamp"], camera["timestamp"]) == (2.5, 4.0), "timestamps leave in order"
    assert machine.data_to_send(0.0) == b""


def test_a_pose_that_may_not_be_sent_is_refused_and_the_former_kept():
    machine = machine_of_1_0()
    machine.tell(CameraPose(POSE, 1.0))
    with pytest.raises(ProtocolError, match="POS-3"):
        machine.tell(CameraPose(POSE._replace(rotation=(0.0, 0.0, 0.0, 1.02)), 2.0))
    (sent,) = packets(machine.data_to_send(0.0))
    assert sent["timestamp"] == 1.0


@given(
    st.lists(st.floats(-3.4e38, 3.4e38) | st.floats(-3.0, 3.0, width=32), min_size=3, max_size=3)
)
def test_numbers_read_back_as_the_values_that_were_held(position):
    machine = machine_of_1_0()
    machine.tell(CameraPose(POSE._replace(position=tuple(position)), 0.0))
    (sent,) = packets(machine.data_to_send(0.0))
    assert list(sent["position"].values()) == position


def test_a_pose_may_come_in_numpy_s_numbers():
    machine = machine_of_1_0()
    machine.tell(CameraPose(Pose(tuple(np.float32([0.1, 2, 3])), tuple(np.eye(4)[3])), 0.0))
    (sent,) = packets(machine.data_to_send(0.0))
    assert np.float32(sent["position"]["x"]) == np.float32(0.1)


def conversation():
    """All that a server may send to the requests of `play`, in order."""
    return [
        welcome("x-unknown"),
        {"type": "viewport_size", "viewport_size": [320, 240]},
        {"type": "new in 1.2"},
        {"type": "error", "code": "busy", "message": "not you"},
        {"type": "camera", "id": 1} | CAMERA_REPLY,
    ]


def play(chunks):
    machine = MessageProtocol(HELLO)
    machine.ask(GetCameraPose(0))
    machine.data_to_send(0.0)
    events = []
    for chunk in chunks:
        events += receive(machine, chunk, 0.0)
        machine.data_to_send(0.0)
    return events


def reply_after_reply(messages):
    """The answers to two requests, of which the second is sent when the first is answered."""
    return [b"".join(map(packet, messages[:2])), b"".join(map(packet, messages[2:]))]


@given(st.data())
def test_however_tcp_divides_it_the_stream_means_the_same(data):
    whole = play(reply_after_reply(conversation()))
    chunks = []
    for part in reply_after_reply(conversation()):
        cuts = sorted(data.draw(st.sets(st.integers(1, len(part) - 1), max_size=9)))
        chunks += [part[a:b] for a, b in zip([0, *cuts], [*cuts, len(part)], strict=True)]
    assert play(chunks) == whole
    assert isinstance(whole[-1], Replied)


UNKNOWN = st.dictionaries(
    st.text(st.characters(codec="utf-8"), min_size=1).map("x-{}".format),
    st.recursive(st.none() | st.booleans() | st.integers() | st.text(st.characters(codec="utf-8")),
                 lambda inner: st.lists(inner, max_size=2), max_leaves=4),
    max_size=3,
)  # fmt: skip


@given(st.lists(UNKNOWN, min_size=5, max_size=5))
def test_unknown_members_change_nothing(extra):
    messages = [members | message for members, message in zip(extra, conversation(), strict=True)]
    expected = play(reply_after_reply(conversation()))
    assert play(reply_after_reply(messages)) == expected


@given(st.lists(st.binary(max_size=40) | st.binary(min_size=1, max_size=40).map(packet)))
def test_nothing_that_a_server_sends_raises(chunks):
    assert all(isinstance(event, Ignored | MustClose) for event in play(chunks))
