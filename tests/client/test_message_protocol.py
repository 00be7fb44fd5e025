"""The message channel's machine: bytes and times in, events and bytes out."""

import math

import pytest
from splatbus_client.clock import Sample
from splatbus_client.events import (
    Ignored,
    Measured,
    MustClose,
    Negotiated,
    NotOffered,
    Replied,
    ServerError,
)
from splatbus_client.message_protocol import MessageProtocol
from splatbus_schemas import LIMITS
from splatbus_wire.messages import (
    CameraPose,
    CameraReply,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    ObjectPose,
    Ping,
    SetViewport,
    SubscribeTelemetry,
)

from tests.client.machines import (
    MESSAGE_HELLO,
    TYPED_SIZE,
    message,
    of_1_0,
    of_1_1,
    receive,
    sent,
)
from tests.peers.fake_server import (
    CAMERA_REPLY,
    MESSAGE_CAPABILITIES,
    POSE,
    TELEMETRY,
    welcome,
)
from tests.peers.raw_client import packet

BUSY = {"type": "error", "code": "busy", "message": "another steers"}
AGAIN = LIMITS["ask_again_min_seconds"]


def test_busy_answers_no_request_that_has_no_id():
    events = receive(message(), welcome(), BUSY, TYPED_SIZE)
    assert [type(event) for event in events] == [Negotiated, ServerError, Replied]


@pytest.mark.parametrize("begin", [of_1_0, of_1_1])
def test_requests_go_one_at_a_time_and_each_gets_its_own_reply(begin):
    machine = begin()
    first, second = machine.ask(GetCameraPose(0)), machine.ask(GetCameraPose(1))
    assert second != first
    (request,) = sent(machine)
    assert request["cam_idx"] == 0
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
    others = [Ping(1.0), SetViewport(4, 3), SetViewport(4, 3), Ping(1.0)]
    assert len({machine.ask(request) for request in others}) == len(others)


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


def test_a_ping_is_stamped_when_it_leaves_and_its_pong_when_it_comes():
    machine = of_1_1("ping")
    camera, ticket = machine.ask(GetCameraPose(0)), machine.ask(Ping(1.0))
    sent(machine, 1.0)
    receive(machine, {"type": "camera", "id": camera} | CAMERA_REPLY, now=2.0)
    assert sent(machine, 2.5) == [{"type": "ping", "t": 2.5, "id": ticket}]
    pong = {"type": "pong", "id": ticket, "t": 2.5, "serverTime": 1041.0}
    assert receive(machine, pong, now=2.75) == [Replied(ticket, Sample(2.5, 1041.0, 2.75))]


def test_the_newest_of_each_kind_and_object_replaces_what_is_unsent():
    machine = of_1_1("objects")
    for second, name in enumerate(["chair", "default", "chair", "table"]):
        machine.tell(ObjectPose(name, POSE, 0.5, float(second)))
        machine.tell(CameraPose(POSE, second + 0.5))
    assert [(each.get("object"), each["timestamp"]) for each in sent(machine)] == [
        *(("default", 1.0), ("chair", 2.0), ("table", 3.0), (None, 3.5)),
    ], "timestamps leave in order"


def test_what_1_0_does_not_know_waits_for_the_version_and_what_was_told_later_behind_it():
    machine = MessageProtocol(MESSAGE_HELLO)
    machine.tell(CameraPose(POSE, 0.5))
    machine.tell(ObjectPose("default", POSE, 1.0, 0.5))
    assert [each["type"] for each in sent(machine)] == [
        *("hello", "get_viewport_size", "camera_pose", "point_cloud_pose"),
    ], "what 1.0 knows does not wait"
    machine.tell(SubscribeTelemetry(None))
    machine.tell(CameraPose(POSE, 2.0))
    assert sent(machine) == []
    receive(machine, welcome(*MESSAGE_CAPABILITIES))
    assert [each["type"] for each in sent(machine)] == ["subscribe_telemetry", "camera_pose"]


def test_a_request_that_was_not_agreed_is_never_sent_and_the_next_one_goes_out():
    machine = message()
    ticket, camera = machine.ask(GetScene()), machine.ask(GetCameraPose(1))
    assert NotOffered(ticket, "scene") in receive(machine, welcome(), TYPED_SIZE)
    (request,) = sent(machine)
    assert request["id"] == camera


def test_telemetry_is_told_with_its_size_once_it_was_subscribed_to():
    machine = of_1_1("telemetry")
    (ignored,) = receive(machine, TELEMETRY)
    assert isinstance(ignored, Ignored)
    machine.tell(SubscribeTelemetry(None))
    sent(machine)
    (figures,) = receive(machine, TELEMETRY)
    assert isinstance(figures, Measured)
    assert figures.size == len(packet(TELEMETRY)) - 4
