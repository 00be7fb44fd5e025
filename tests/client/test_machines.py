"""The machines of both channels: the same stream means the same, and nothing in it raises."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_client.events import Announced, Ignored, Lent, MustClose, Replied
from splatbus_wire.messages import GetCameraPose

from tests.client.machines import TYPED_SIZE, ipc, message, opened, sent
from tests.peers.fake_server import CAMERA_REPLY, IPC_CAPABILITIES, frame, init_packet, welcome
from tests.peers.raw_client import packet

IMAGES = [
    {"type": "new in 1.2"},
    welcome(*IPC_CAPABILITIES, "x-unknown"),
    init_packet(),
    frame(7, slot=1),
    init_packet(generation=2),
    frame(8, generation=2),
]
QUESTIONS = [
    welcome("x-unknown"),
    TYPED_SIZE,
    {"type": "new in 1.2"},
    {"type": "error", "code": "busy", "message": "not you"},
    {"type": "camera", "id": 1} | CAMERA_REPLY,
]


def with_images(chunks):
    """The events of a machine whose owner opens everything and releases at once."""
    machine = ipc()
    events = []
    for chunk in chunks:
        for event in machine.receive(chunk, 0.0):
            events.append(event)
            if isinstance(event, Announced):
                machine.opened(event.packet)
            if isinstance(event, Lent):
                machine.release(event.frame)
    return events, sent(machine)


def with_questions(chunks):
    """The events of a machine that asks as soon as it may."""
    machine = message()
    machine.ask(GetCameraPose(0))
    events = []
    for chunk in chunks:
        for event in machine.receive(chunk, 0.0):
            events.append(event)
            machine.data_to_send(0.0)
    return events


both = pytest.mark.parametrize(
    ("play", "conversation"), [(with_images, IMAGES), (with_questions, QUESTIONS)]
)


@both
@given(st.data(), st.lists(st.integers(1, 2000), min_size=1, max_size=8))
def test_the_stream_means_the_same_however_tcp_divides_it_and_whatever_it_holds_besides(
    play, conversation, data, sizes
):
    def extended(value):
        if not isinstance(value, dict):
            return value
        extra = data.draw(st.dictionaries(st.sampled_from(["x-a", "x-b"]), st.just([{}, 1])))
        return extra | {name: extended(member) for name, member in value.items()}

    stream = b"".join(packet(extended(each)) for each in conversation)
    chunks = []
    while stream:
        size = sizes[len(chunks) % len(sizes)]
        chunks.append(stream[:size])
        stream = stream[size:]
    assert play(chunks) == play(map(packet, conversation))


def test_the_streams_mean_something():
    events, answers = with_images(map(packet, IMAGES))
    assert isinstance(events[-1], Lent)
    assert [each["type"] for each in answers] == ["opened", "release"] * 2
    assert isinstance(with_questions(map(packet, QUESTIONS))[-1], Replied)


@pytest.mark.parametrize("begin", [ipc, opened, message])
@given(st.lists(st.binary(max_size=40) | st.binary(min_size=1, max_size=40).map(packet)))
def test_nothing_that_a_server_sends_raises(begin, chunks):
    machine = begin()
    for chunk in chunks:
        for event in machine.receive(chunk, 0.0):
            assert isinstance(event, Ignored | MustClose)


@pytest.mark.parametrize("begin", [ipc, message])
@pytest.mark.parametrize("header", [b"\0\0\0\0", b"\xff\xff\xff\xff", b"\x01\x00\x10\x00"])
def test_a_bad_header_closes_after_the_packets_before_it(begin, header):
    machine = begin()
    *events, last = machine.receive(packet(welcome()) + header + packet(b"{}"), 0.0)
    assert len(events) == 1
    assert isinstance(last, MustClose)
    assert "FRM-3" in last.reason
