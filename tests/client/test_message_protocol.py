"""The message channel's machine: bytes and times in, events and bytes out."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_client.clock import Sample
from splatbus_client.events import (
    Ignored,
    Measured,
    MustClose,
    Negotiated,
    NotOffered,
    Refused,
    Replied,
    ServerError,
)
from splatbus_client.message_protocol import MessageProtocol, NotOfferedError
from splatbus_schemas import LIMITS
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import (
    CameraPose,
    CameraReply,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Intrinsics,
    ObjectPose,
    Ping,
    Pose,
    Program,
    SetTime,
    SetViewport,
    SubscribeTelemetry,
    ViewportSize,
)

from tests.client.machines import (
    MESSAGE_HELLO,
    SIZE,
    TYPED_SIZE,
    message,
    of_1_0,
    of_1_1,
    receive,
    sent,
)
from tests.peers.fake_server import (
    CAMERA_REPLY,
    LENS,
    MESSAGE_CAPABILITIES,
    POSITION,
    ROTATION,
    TELEMETRY,
    welcome,
)
from tests.peers.raw_client import packet

INTRINSICS = Intrinsics(**LENS)
POSE = Pose(POSITION, ROTATION)
BUSY = {"type": "error", "code": "busy", "message": "another steers"}
OF_1_1 = [
    CameraPose(POSE, 1.0, "tag"),
    CameraPose(POSE, 1.0, None, INTRINSICS),
    ObjectPose("chair", POSE, 1.0, 1.0),
    ObjectPose("default", POSE, 2.0, 1.0),
    SetTime(1.0),
    SubscribeTelemetry(None),
]
REQUESTS_OF_1_1 = [(GetScene(), "scene"), (SetViewport(4, 3), "viewport"), (Ping(0.0), "ping")]
NEEDED = {
    "object_pose": "objects",
    "set_time": "time",
    "subscribe_telemetry": "telemetry",
    "get_scene": "scene",
    "set_viewport": "viewport",
    "ping": "ping",
}
AGAIN = LIMITS["ask_again_min_seconds"]


def is_of_1_1(message):
    return message["type"] in NEEDED or bool({"tag", "intrinsics", "id"} & set(message))


# Which version is spoken


def test_a_reply_before_any_welcome_means_1_0():
    machine = message()
    assert receive(machine, SIZE) == [
        Negotiated("1.0", None, frozenset()),
        Replied(0, ViewportSize(320, 240)),
    ]
    machine.ask(GetCameraPose(3))
    assert sent(machine) == [{"type": "get_camera_pose", "cam_idx": 3}]
    (late,) = receive(machine, welcome())
    assert isinstance(late, Ignored)
    assert machine.version == "1.0"


def test_a_welcome_before_the_reply_means_its_version():
    machine = message()
    assert receive(machine, welcome()) == [Negotiated("1.1", Program("fake", "0"), frozenset())]
    receive(machine, TYPED_SIZE)
    ticket = machine.ask(GetCameraPose(3))
    assert sent(machine) == [{"type": "get_camera_pose", "cam_idx": 3, "id": ticket}]


def test_a_version_that_was_not_offered_closes():
    (event,) = receive(message(), welcome(version="1.2"), SIZE)
    assert isinstance(event, MustClose)
    assert "NEG-16" in event.reason


# Requests and their replies


@pytest.mark.parametrize("begin", [of_1_0, of_1_1])
def test_requests_go_one_at_a_time_and_each_gets_its_own_reply(begin):
    machine = begin()
    first, second = machine.ask(GetCameraPose(0)), machine.ask(GetCameraPose(1))
    assert second != first
    (request,) = sent(machine)
    assert request["cam_idx"] == 0
    assert sent(machine) == []
    (ignored,) = receive(machine, CAMERA_REPLY | {"rotation": [0, 0, 0, 1.5]})
    assert isinstance(ignored, Ignored)
    assert sent(machine) == [], "another request went out while one has no answer"
    typed = {"type": "camera", "id": first} if machine.version == "1.1" else {}
    assert receive(machine, typed | CAMERA_REPLY) == [
        Replied(first, CameraReply(POSE, typed.get("id")))
    ]
    (request,) = sent(machine)
    assert request["cam_idx"] == 1


def test_an_equal_question_is_shared_until_it_is_sent_but_no_ping_and_no_change_of_size():
    machine = of_1_1("ping", "viewport")
    ticket = machine.ask(GetCameraPose(4))
    assert machine.ask(GetCameraPose(4)) == ticket
    sent(machine)
    # What the server answers to the first may be older than this question.
    assert machine.ask(GetCameraPose(4)) != ticket
    others = [Ping(1.0), SetViewport(4, 3), SetViewport(8, 6), SetViewport(4, 3), Ping(1.0)]
    assert len({machine.ask(request) for request in others}) == len(others)


@pytest.mark.parametrize(
    "broken",
    [b"\xff", b'{"viewport_size":[1e400,2]}', b'{"viewport_size":[1]}', b'{"type":7}'],
)
def test_a_broken_packet_is_ignored_and_the_reply_after_it_taken(broken):
    ignored, *rest = receive(message(), broken, SIZE)
    assert isinstance(ignored, Ignored)
    assert rest[-1] == Replied(0, ViewportSize(320, 240))


def test_a_reply_that_comes_late_closes():
    assert of_1_0().deadline() == math.inf, "nothing is asked"
    machine = MessageProtocol(MESSAGE_HELLO)
    sent(machine, 5.0)
    due = machine.deadline()
    assert due < 5.0 + LIMITS["reply_seconds"]
    assert machine.expire(due - 0.001) == []
    (event,) = machine.expire(due)
    assert isinstance(event, MustClose)
    assert "CHN-15" in event.reason


def test_a_packet_that_is_not_completed_closes_however_slowly_it_drips():
    machine = of_1_0()
    for data, now in [(packet(b"{}") + b"\x10", 100.0), (b"\x00", 109.0), (b"\x00\x00{", 109.9)]:
        list(machine.receive(data, now))
    assert machine.deadline() == 110.0
    (event,) = machine.expire(110.0)
    assert isinstance(event, MustClose)
    assert "FRM-5" in event.reason


def test_a_size_that_is_not_known_is_asked_for_again_but_not_at_once():
    machine = message()
    receive(machine, {"viewport_size": [0, 0]}, now=1.0)
    machine.ask(GetViewportSize())
    camera = machine.ask(GetCameraPose(0))
    (request,) = sent(machine, 1.0)
    assert request["type"] == "get_camera_pose", "another request need not wait"
    assert receive(machine, CAMERA_REPLY, now=1.0) == [Replied(camera, CameraReply(POSE))]
    assert sent(machine, 1.0 + AGAIN) == []
    assert sent(machine, machine.deadline()) == [{"type": "get_viewport_size"}]


def test_a_change_of_size_that_was_busy_is_asked_for_again_but_not_at_once():
    machine = of_1_1("viewport")
    ticket = machine.ask(SetViewport(64, 48))
    sent(machine)
    (refused,) = receive(machine, BUSY | {"id": ticket}, now=1.0)
    assert isinstance(refused, Refused)
    assert (refused.ticket, refused.error.code) == (ticket, "busy")
    again = machine.ask(SetViewport(64, 48))
    assert sent(machine, 1.0 + AGAIN) == []
    (request,) = sent(machine, machine.deadline())
    assert request["type"] == "set_viewport"
    size = {"type": "viewport_size", "id": again, "viewport_size": [64, 48]}
    assert receive(machine, size) == [Replied(again, ViewportSize(64, 48, again))]


def test_an_error_with_the_request_s_id_answers_it():
    machine = of_1_1()
    ticket = machine.ask(GetCameraPose(0))
    sent(machine)
    error = {"type": "error", "code": "new in 1.2", "message": "no cameras today"}
    pose_refused, answered = receive(machine, error, error | {"id": ticket})
    assert isinstance(pose_refused, ServerError)
    assert isinstance(answered, Refused)
    assert answered.ticket == ticket


def test_busy_answers_no_request_that_has_no_id():
    _, error, reply = receive(message(), welcome(), BUSY, TYPED_SIZE)
    assert isinstance(error, ServerError)
    assert isinstance(reply, Replied)


def test_a_ping_is_stamped_when_it_leaves_and_its_pong_when_it_comes():
    machine = of_1_1("ping")
    camera, ticket = machine.ask(GetCameraPose(0)), machine.ask(Ping(1.0))
    sent(machine, 1.0)
    receive(machine, {"type": "camera", "id": camera} | CAMERA_REPLY, now=2.0)
    assert sent(machine, 2.5) == [{"type": "ping", "t": 2.5, "id": ticket}]
    pong = {"type": "pong", "id": ticket, "t": 2.5, "serverTime": 1041.0}
    assert receive(machine, pong, now=2.75) == [Replied(ticket, Sample(2.5, 1041.0, 2.75))]


# What has no reply


def test_the_newest_of_each_kind_and_object_replaces_what_is_unsent():
    machine = of_1_1("objects")
    for second, name in enumerate(["chair", "default", "chair", "table"]):
        machine.tell(ObjectPose(name, POSE, 0.5, float(second)))
        machine.tell(CameraPose(POSE, second + 0.5))
    told = sent(machine)
    assert [(each.get("object"), each["timestamp"]) for each in told] == [
        *(("default", 1.0), ("chair", 2.0), ("table", 3.0), (None, 3.5)),
    ], "timestamps leave in order"
    assert told[0]["scale"] == 0.5
    assert sent(machine) == []


def test_a_pose_that_may_not_be_sent_is_refused_and_the_former_kept():
    machine = of_1_0()
    machine.tell(CameraPose(POSE, 1.0))
    with pytest.raises(ProtocolError, match="POS-3"):
        machine.tell(CameraPose(POSE._replace(rotation=(0.0, 0.0, 0.0, 1.02)), 2.0))
    (told,) = sent(machine)
    assert told["timestamp"] == 1.0


def test_what_1_0_does_not_know_waits_for_the_version_and_what_was_told_later_behind_it():
    for waiting in OF_1_1:
        machine = MessageProtocol(MESSAGE_HELLO)
        machine.tell(CameraPose(POSE, 0.5))
        machine.tell(ObjectPose("default", POSE, 1.0, 0.5))
        assert [each["type"] for each in sent(machine)] == [
            *("hello", "get_viewport_size", "camera_pose", "point_cloud_pose"),
        ], "what 1.0 knows does not wait"
        machine.tell(waiting)
        machine.tell(CameraPose(POSE, 2.0, "later"))
        assert sent(machine) == []
        receive(machine, welcome(*MESSAGE_CAPABILITIES))
        told = sent(machine)
        assert all(map(is_of_1_1, told))
        assert told[-1]["tag"] == "later"


@given(
    st.sampled_from([None, "1.0", "1.1"]),
    st.sets(st.sampled_from([*MESSAGE_CAPABILITIES, "x-unknown"])),
    st.lists(st.sampled_from([*OF_1_1, *(r for r, _ in REQUESTS_OF_1_1)]), max_size=12),
    st.integers(0, 12),
)
def test_nothing_is_ever_sent_that_welcome_does_not_list(version, listed, messages, before):
    """`before` of the messages are given to the machine before it knows its server."""
    machine = MessageProtocol(MESSAGE_HELLO)
    said, refused = [], set()

    def give(some):
        for each in some:
            try:
                machine.ask(each) if hasattr(each, "id") else machine.tell(each)
            except NotOfferedError as problem:
                refused.add(problem.capability)
            said.extend(sent(machine))

    give(messages[:before])
    said += sent(machine)
    assert all(each["type"] == "hello" or not is_of_1_1(each) for each in said)
    greeting = [] if version is None else [welcome(*listed, version=version)]
    known = [*greeting, TYPED_SIZE if version == "1.1" else SIZE]
    refused |= {
        each.capability for each in receive(machine, *known) if isinstance(each, NotOffered)
    }
    said.clear()
    give(messages[before:])
    for _ in range(12):  # replies are needed for requests to go on
        said += sent(machine)
        if machine.asked is not None:
            receive(machine, BUSY | {"code": "internal", "id": machine.asked[1].id})
    agreed = listed if version == "1.1" else set()
    assert not refused & agreed
    for each in said:
        assert NEEDED.get(each["type"], "") in {"", *agreed}
        assert "intrinsics" not in each or "intrinsics" in agreed
        assert version == "1.1" or not is_of_1_1(each)
    for request, capability in REQUESTS_OF_1_1:
        if any(type(each) is type(request) for each in messages) and capability not in agreed:
            assert capability in refused, "who asked is told"


@pytest.mark.parametrize(("request_", "capability"), REQUESTS_OF_1_1)
def test_a_request_that_was_not_agreed_is_refused_and_the_next_one_goes_out(request_, capability):
    machine = message()
    ticket, camera = machine.ask(request_), machine.ask(GetCameraPose(1))
    assert NotOffered(ticket, capability) in receive(machine, welcome())
    with pytest.raises(NotOfferedError, match=capability):
        machine.ask(request_)
    receive(machine, TYPED_SIZE)
    (request,) = sent(machine)
    assert (request["type"], request["id"]) == ("get_camera_pose", camera)


def test_telemetry_is_told_between_replies_and_only_if_it_was_subscribed_to():
    machine = of_1_1("telemetry")
    machine.tell(SubscribeTelemetry(None))
    ticket = machine.ask(GetCameraPose(0))
    sent(machine)
    figures, replied = receive(machine, TELEMETRY, {"type": "camera", "id": ticket} | CAMERA_REPLY)
    assert isinstance(figures, Measured)
    assert [each.name for each in figures.telemetry.series] == ["render_ms", "opacity", "stage"]
    assert figures.size == len(packet(TELEMETRY)) - 4
    assert isinstance(replied, Replied)
    not_agreed = of_1_1()
    not_agreed.tell(SubscribeTelemetry(None))
    for machine in (of_1_1("telemetry"), not_agreed):
        sent(machine)
        (ignored,) = receive(machine, TELEMETRY)
        assert "TEL-3" in ignored.reason
