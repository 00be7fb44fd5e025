"""The message channel's machine: what 1.1 adds is sent when it was agreed, and not before."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_client.clock import Sample
from splatbus_client.events import (
    Measured,
    NotOffered,
    Refused,
    Replied,
    ServerError,
)
from splatbus_client.message_protocol import MessageProtocol, NotOfferedError
from splatbus_schemas import LIMITS
from splatbus_wire.messages import (
    CameraPose,
    GetCameraPose,
    GetScene,
    Intrinsics,
    ObjectPose,
    Ping,
    Pose,
    SetTime,
    SetViewport,
    SubscribeTelemetry,
    ViewportSize,
)

from tests.client.machines import HELLO, SIZE, machine_of_1_1, receive
from tests.peers.fake_server import (
    CAMERA_REPLY,
    LENS,
    MESSAGE_CAPABILITIES,
    POSITION,
    ROTATION,
    SCENE,
    TELEMETRY,
    welcome,
)
from tests.peers.raw_client import packet, packets

INTRINSICS = Intrinsics(**LENS)
POSE = Pose(POSITION, ROTATION)


OF_1_1 = [
    CameraPose(POSE, 1.0, "tag"),
    CameraPose(POSE, 1.0, None, INTRINSICS),
    ObjectPose("chair", POSE, 1.0, 1.0),
    ObjectPose("default", POSE, 2.0, 1.0),
    SetTime(1.0),
    SubscribeTelemetry(None),
]
REQUESTS_OF_1_1 = [
    (GetScene(), "scene"),
    (SetViewport(4, 3), "viewport"),
    (Ping(0.0), "ping"),
]
ADDED_MEMBERS = {"tag", "intrinsics", "id"}
ADDED_TYPES = {
    "object_pose",
    "set_time",
    "subscribe_telemetry",
    "get_scene",
    "set_viewport",
    "ping",
}


@pytest.mark.parametrize("message", OF_1_1)
def test_what_1_0_does_not_know_waits_until_the_version_is_settled(message):
    machine = MessageProtocol(HELLO)
    machine.tell(message)
    assert [m["type"] for m in packets(machine.data_to_send(0.0))] == ["hello", "get_viewport_size"]
    receive(machine, packet(welcome(*MESSAGE_CAPABILITIES)), 0.0)
    (sent,) = packets(machine.data_to_send(0.0))
    assert sent["type"] in ADDED_TYPES or ADDED_MEMBERS & set(sent)


def test_plain_poses_do_not_wait_for_a_welcome():
    machine = MessageProtocol(HELLO)
    machine.tell(CameraPose(POSE, 1.0))
    machine.tell(ObjectPose("default", POSE, 1.0, 2.0))
    types = [m["type"] for m in packets(machine.data_to_send(0.0))]
    assert types == ["hello", "get_viewport_size", "camera_pose", "point_cloud_pose"]


def test_what_was_told_later_waits_behind_so_that_timestamps_leave_in_order():
    machine = MessageProtocol(HELLO)
    machine.data_to_send(0.0)
    machine.tell(CameraPose(POSE, 1.0, "tag"))
    machine.tell(ObjectPose("default", POSE, 1.0, 2.0))
    assert machine.data_to_send(0.0) == b""
    receive(machine, packet(SIZE), 0.0)
    camera, cloud = packets(machine.data_to_send(0.0))
    assert (camera["timestamp"], cloud["timestamp"]) == (1.0, 2.0)
    assert "tag" not in camera, "1.0 knows none"


@given(
    st.none() | st.sets(st.sampled_from([*MESSAGE_CAPABILITIES, "x-unknown"])),
    st.lists(st.sampled_from([*OF_1_1, *(r for r, _ in REQUESTS_OF_1_1)]), max_size=12),
    st.integers(0, 12),
)
def test_nothing_is_ever_sent_that_welcome_does_not_list(capabilities, messages, before):
    """`before` of the messages are given to the machine before it knows its server."""
    machine = MessageProtocol(HELLO)
    sent, refused = [], set()

    def give(some):
        for message in some:
            try:
                machine.ask(message) if hasattr(message, "id") else machine.tell(message)
            except NotOfferedError as problem:
                refused.add(problem.capability)
            sent.extend(packets(machine.data_to_send(0.0)))

    give(messages[:before])
    sent += packets(machine.data_to_send(0.0))
    assert all(m["type"] == "hello" or not of_1_1(m) for m in sent)
    answer = SIZE if capabilities is None else welcome(*capabilities)
    events = receive(machine, packet(answer), 0.0)
    if capabilities is not None:
        events += receive(machine, packet({"type": "viewport_size"} | SIZE), 0.0)
    sent.clear()
    give(messages[before:])
    for _ in range(12):  # replies are needed for requests to go on
        sent += packets(machine.data_to_send(0.0))
        if machine.asked is not None:
            error = {"type": "error", "code": "internal", "message": "", "id": machine.asked[1].id}
            receive(machine, packet(error), 0.0)
    agreed = capabilities or set()
    refused |= {event.capability for event in events if isinstance(event, NotOffered)}
    assert not refused & agreed
    needed = {"object_pose": "objects", "set_time": "time", "subscribe_telemetry": "telemetry"}
    needed |= {"get_scene": "scene", "set_viewport": "viewport", "ping": "ping"}
    for message in sent:
        assert needed.get(message["type"], "") in {"", *agreed}
        assert "intrinsics" not in message or "intrinsics" in agreed
        assert capabilities is not None or not of_1_1(message)
    for request, capability in REQUESTS_OF_1_1:
        if any(type(m) is type(request) for m in messages) and capability not in agreed:
            assert capability in refused, "who asked is told"


def of_1_1(message):
    return message["type"] in ADDED_TYPES or bool(ADDED_MEMBERS & set(message))


def test_a_lens_is_left_out_where_it_was_not_agreed_and_its_pose_sent():
    machine = machine_of_1_1()
    machine.tell(CameraPose(POSE, 1.0, "tag", INTRINSICS))
    (sent,) = packets(machine.data_to_send(0.0))
    assert sent["tag"] == "tag"
    assert "intrinsics" not in sent
    assert machine.lacks(CameraPose(POSE, 1.0, "tag", INTRINSICS)) == "intrinsics"


def test_a_lens_that_is_unsent_goes_with_the_pose_that_replaces_its_own():
    machine = machine_of_1_1("intrinsics")
    machine.tell(CameraPose(POSE, 1.0, "a", INTRINSICS))
    machine.tell(CameraPose(POSE, 2.0, "b"))
    (sent,) = packets(machine.data_to_send(0.0))
    assert (sent["tag"], sent["intrinsics"]) == ("b", LENS)
    machine.tell(CameraPose(POSE, 3.0, "c"))
    (sent,) = packets(machine.data_to_send(0.0))
    assert "intrinsics" not in sent, "it is in force already"


def test_the_newest_pose_of_each_object_is_sent():
    machine = machine_of_1_1("objects")
    for second, name in enumerate(["chair", "default", "chair", "table"]):
        machine.tell(ObjectPose(name, POSE, 0.5, float(second)))
    sent = packets(machine.data_to_send(0.0))
    assert [(m["object"], m["timestamp"]) for m in sent] == [
        ("default", 1.0),
        ("chair", 2.0),
        ("table", 3.0),
    ]
    assert sent[0]["scale"] == 0.5


@pytest.mark.parametrize(("request_", "capability"), REQUESTS_OF_1_1)
def test_a_request_that_was_not_agreed_is_refused_and_the_next_one_goes_out(request_, capability):
    machine = MessageProtocol(HELLO)
    ticket, camera = machine.ask(request_), machine.ask(GetCameraPose(1))
    machine.data_to_send(0.0)
    events = receive(machine, packet(welcome()), 0.0)
    assert NotOffered(ticket, capability) in events
    with pytest.raises(NotOfferedError, match=capability):
        machine.ask(request_)
    receive(machine, packet({"type": "viewport_size"} | SIZE), 0.0)
    (request,) = packets(machine.data_to_send(0.0))
    assert (request["type"], request["id"]) == ("get_camera_pose", camera)


def test_a_welcome_to_1_0_agrees_on_nothing():
    machine = MessageProtocol(HELLO)
    machine.data_to_send(0.0)
    (event,) = receive(machine, packet(welcome(*MESSAGE_CAPABILITIES, version="1.0")), 0.0)
    assert (event.version, event.capabilities) == ("1.0", frozenset())
    receive(machine, packet(SIZE), 0.0)
    machine.tell(CameraPose(POSE, 1.0, "tag", INTRINSICS))
    machine.ask(GetCameraPose(0))
    request, camera = packets(machine.data_to_send(0.0))
    assert request == {"type": "get_camera_pose", "cam_idx": 0}
    assert set(camera) == {"type", "timestamp", "position", "rotation"}


def test_a_scene_is_a_reply():
    machine = machine_of_1_1("scene")
    ticket = machine.ask(GetScene())
    assert packets(machine.data_to_send(0.0)) == [{"type": "get_scene", "id": ticket}]
    (replied,) = receive(machine, packet(SCENE | {"id": ticket}), 0.0)
    assert [each.id for each in replied.answer.objects] == ["default", "chair"]
    assert replied.answer.time_range == (0.0, 4.0)


def test_a_ping_is_stamped_when_it_leaves_and_its_pong_when_it_comes():
    machine = machine_of_1_1("ping")
    camera, ticket = machine.ask(GetCameraPose(0)), machine.ask(Ping(1.0))
    machine.data_to_send(1.0)
    receive(machine, packet({"type": "camera", "id": camera} | CAMERA_REPLY), 2.0)
    assert packets(machine.data_to_send(2.5)) == [{"type": "ping", "t": 2.5, "id": ticket}]
    pong = {"type": "pong", "id": ticket, "t": 2.5, "serverTime": 1041.0}
    assert receive(machine, packet(pong), 2.75) == [Replied(ticket, Sample(2.5, 1041.0, 2.75))]


def test_pings_and_changes_of_size_are_never_shared():
    machine = machine_of_1_1("ping", "viewport")
    for request in (Ping(1.0), SetViewport(4, 3), SetViewport(8, 6), SetViewport(4, 3), Ping(1.0)):
        machine.ask(request)
    assert len(machine._queue) == 5


def test_a_change_of_size_is_answered_or_refused():
    machine = machine_of_1_1("viewport")
    first, second = machine.ask(SetViewport(8, 6)), machine.ask(SetViewport(4, 3))
    machine.data_to_send(0.0)
    size = {"type": "viewport_size", "id": first, "viewport_size": [8, 6]}
    assert receive(machine, packet(size), 0.0) == [Replied(first, ViewportSize(8, 6, first))]
    machine.data_to_send(0.0)
    error = {"type": "error", "code": "busy", "message": "wait", "id": second}
    (refused,) = receive(machine, packet(error), 0.0)
    assert isinstance(refused, Refused)
    assert refused.error.code == "busy"


def test_busy_answers_no_request_that_has_no_id():
    machine = MessageProtocol(HELLO)
    machine.data_to_send(0.0)
    busy = {"type": "error", "code": "busy", "message": "another steers"}
    _, error, reply = receive(
        machine, packet(welcome()) + packet(busy) + packet({"type": "viewport_size"} | SIZE), 0.0
    )
    assert isinstance(error, ServerError)
    assert isinstance(reply, Replied)


def subscribed():
    """A machine that takes telemetry."""
    machine = machine_of_1_1("telemetry")
    machine.tell(SubscribeTelemetry(None))
    machine.data_to_send(0.0)
    return machine


def test_telemetry_is_told_between_replies_and_only_if_it_was_agreed():
    machine = subscribed()
    ticket = machine.ask(GetCameraPose(0))
    machine.data_to_send(0.0)
    reply = {"type": "camera", "id": ticket} | CAMERA_REPLY
    figures, replied = receive(machine, packet(TELEMETRY) + packet(reply), 0.0)
    assert isinstance(figures, Measured)
    assert [series.name for series in figures.telemetry.series] == ["render_ms", "opacity", "stage"]
    assert isinstance(replied, Replied)
    for machine in (machine_of_1_1(), machine_of_1_1("telemetry")):
        (ignored,) = receive(machine, packet(TELEMETRY), 0.0)
        assert "TEL-3" in ignored.reason
    machine = machine_of_1_1()
    machine.tell(SubscribeTelemetry(None))
    machine.data_to_send(0.0)
    (ignored,) = receive(machine, packet(TELEMETRY), 0.0)
    assert "TEL-3" in ignored.reason


def test_a_series_of_an_unknown_kind_is_ignored_and_the_others_kept():
    machine = subscribed()
    strange = {"name": "x", "kind": "hologram", "value": {}}
    message = TELEMETRY | {"series": [strange, *TELEMETRY["series"]]}
    (figures,) = receive(machine, packet(message), 0.0)
    assert [series.name for series in figures.telemetry.series] == ["render_ms", "opacity", "stage"]


def test_a_size_that_was_busy_is_asked_for_again_but_not_at_once():
    machine = machine_of_1_1(*MESSAGE_CAPABILITIES)
    ticket = machine.ask(SetViewport(64, 48))
    machine.data_to_send(0.0)
    error = {"type": "error", "code": "busy", "message": "", "id": ticket}
    (refused,) = receive(machine, packet(error), 1.0)
    assert isinstance(refused, Refused)
    machine.ask(SetViewport(64, 48))
    assert machine.data_to_send(1.0 + LIMITS["ask_again_min_seconds"]) == b""
    (request,) = packets(machine.data_to_send(machine.deadline()))
    assert request["type"] == "set_viewport"
