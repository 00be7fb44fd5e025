"""The IPC channel's machine: what was announced, opened and lent, in bytes and events."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_client.events import (
    Announced,
    Declined,
    Ignored,
    Lent,
    MustClose,
    Negotiated,
    ServerError,
)
from splatbus_client.ipc_protocol import IpcProtocol

from tests.client.ipc_machine import BOTH, COLOR, HELLO, greeted, opened, receive, sent
from tests.peers.fake_server import (
    IPC_CAPABILITIES,
    META,
    cuda_init_packet,
    frame,
    init_packet,
    welcome,
)
from tests.peers.raw_client import packet


def test_hello_comes_first_and_nothing_else_before_welcome():
    machine = IpcProtocol(HELLO)
    (hello,) = sent(machine)
    assert hello["type"] == "hello"
    assert hello["capabilities"] == list(IPC_CAPABILITIES)
    assert receive(machine, init_packet()) == []
    assert sent(machine) == []


def test_an_init_packet_without_version_means_1_0_and_silence():
    machine = IpcProtocol(HELLO)
    machine.data_to_send(0.0)
    negotiated, announced = receive(machine, cuda_init_packet())
    assert negotiated == Negotiated("1.0", None, frozenset())
    machine.open_failed(announced.packet, "no CUDA support")
    for version in ("1.1", "9.9"):
        (event,) = receive(machine, welcome(*IPC_CAPABILITIES, version=version))
        assert "NEG-40" in event.reason
        assert isinstance(event, Ignored)
    receive(machine, init_packet(), frame(1))
    assert sent(machine) == []


@pytest.mark.parametrize(
    "broken",
    [
        {"mem_color": "AA=="},
        {"meta": META | {"pitchColor": 1}},
        {"meta": META | {"w": 0}},
        {"meta": META | {"w": 40000}},
        {"meta": META | {"fmtDepth": "R16F"}},
        {"meta": META | {"offsetDepth": 2}},
        {"evt_done": None},
    ],
)
def test_an_invalid_init_packet_of_1_0_is_ignored_and_a_valid_one_after_it_taken(broken):
    machine = IpcProtocol(HELLO)
    machine.data_to_send(0.0)
    ignored, *events = receive(machine, cuda_init_packet(**broken), cuda_init_packet())
    assert isinstance(ignored, Ignored)
    assert isinstance(events[-1], Announced)


def test_an_init_packet_that_comes_before_welcome_is_announced_after_it():
    machine = IpcProtocol(HELLO)
    receive(machine, init_packet())
    negotiated, announced = receive(machine, welcome(*IPC_CAPABILITIES))
    assert isinstance(negotiated, Negotiated)
    assert announced.packet.generation == 1


def test_a_version_that_was_not_offered_closes():
    machine = IpcProtocol(HELLO)
    (event,) = receive(machine, welcome(version="2.0"), init_packet())
    assert isinstance(event, MustClose)


def test_capabilities_are_only_those_that_both_have():
    machine = IpcProtocol(HELLO)
    (event,) = receive(machine, welcome("frames", "x-new", "cuda_ipc"))
    assert event.capabilities == {"frames"}


def test_a_welcome_to_1_0_agrees_on_nothing():
    machine = IpcProtocol(HELLO, COLOR)
    machine.data_to_send(0.0)
    (event,) = receive(machine, welcome(*IPC_CAPABILITIES, version="1.0"))
    assert (event.version, event.capabilities) == ("1.0", frozenset())
    receive(machine, cuda_init_packet(), frame(1))
    assert sent(machine) == []


def test_each_init_packet_is_answered_once():
    machine = greeted()
    (event,) = receive(machine, init_packet())
    assert sent(machine) == [], "opened waits until the memory is mapped and checked"
    machine.opened(event.packet)
    assert sent(machine) == [{"type": "opened", "generation": 1}]


def test_memory_that_cannot_be_opened_is_declined_in_at_most_1024_characters():
    machine = greeted()
    (event,) = receive(machine, init_packet())
    machine.open_failed(event.packet, "x" * 5000)
    (answer,) = sent(machine)
    assert (answer["type"], answer["generation"]) == ("open_failed", 1)
    assert len(answer["reason"]) == 1024


@pytest.mark.parametrize(
    "broken",
    [
        {"memory": {"kind": "host_shm", "name": "../../etc/passwd", "bytes": 5000}},
        {"memory": {"kind": "host_shm", "name": ".hidden", "bytes": 5000}},
        {"memory": {"kind": "floppy", "name": "a", "bytes": 5000}},
        {"memory": None},
        {"semantics": None},
        {"ring": None},
        {"ring": {"slots": 0}},
        {"version": "1.07"},
        {"meta": {}},
        {"mem_color": "AA=="},
    ],
)
def test_an_invalid_init_packet_is_declined_if_its_generation_can_be_read(broken):
    machine = greeted()
    (event,) = receive(machine, init_packet(**broken))
    assert isinstance(event, Declined)
    (answer,) = sent(machine)
    assert (answer["type"], answer["generation"]) == ("open_failed", 1)
    assert isinstance(receive(machine, init_packet(generation=2))[0], Announced)


@pytest.mark.parametrize("generation", [0, -1, 1.5, "1", None, 2**53, True])
def test_an_init_packet_without_a_generation_is_ignored(generation):
    machine = greeted()
    (event,) = receive(machine, init_packet(generation=generation))
    assert isinstance(event, Ignored)
    assert sent(machine) == []


@pytest.mark.parametrize("members", [{}, {"semantics": None}, {"version": "2.0"}])
@pytest.mark.parametrize("was_opened", [True, False])
def test_what_repeats_a_generation_is_ignored(members, was_opened):
    machine = opened() if was_opened else greeted()
    if not was_opened:
        receive(machine, init_packet(ring=None))
        sent(machine)
    assert isinstance(receive(machine, init_packet(**members))[0], Ignored)
    assert sent(machine) == []


def test_memory_of_a_later_version_is_announced_as_of_ones_own():
    (event,) = receive(greeted(), init_packet(version="1.12", later={}))
    assert isinstance(event, Announced)


def test_a_further_init_packet_replaces_the_former():
    machine = opened()
    (lent,) = receive(machine, frame(7))
    (announced,) = receive(machine, init_packet(generation=2))
    machine.opened(announced.packet)
    assert sent(machine) == [{"type": "opened", "generation": 2}]
    machine.release(lent.frame)
    machine.closed(1)
    machine.closed(1)
    assert sent(machine) == [
        {"type": "release", "generation": 1, "seq": 7},
        {"type": "closed", "generation": 1},
    ]
    (event,) = receive(machine, frame(8, generation=1))
    assert isinstance(event, Ignored)
    assert isinstance(receive(machine, frame(9, generation=2))[0], Lent)


def test_a_frame_of_what_is_being_closed_is_given_back_unread():
    machine = opened()
    (announced,) = receive(machine, init_packet(generation=2), frame(7, generation=1))
    machine.opened(announced.packet)
    assert receive(machine, frame(8, generation=1)) == []
    releases = [message for message in sent(machine) if message["type"] == "release"]
    assert [release["seq"] for release in releases] == [7, 8]


def test_what_is_open_is_never_called_closed():
    machine = opened()
    machine.closed(1)
    machine.closed(5)
    assert sent(machine) == []


def test_a_further_init_packet_is_ignored_where_reinit_was_not_agreed():
    machine = opened("host_shm", "frames")
    (event,) = receive(machine, init_packet(generation=2))
    assert isinstance(event, Ignored)
    assert sent(machine) == []
    assert isinstance(receive(machine, frame(7))[0], Lent)


def test_a_further_init_packet_that_fails_ends_the_former_too():
    machine = opened()
    (announced,) = receive(machine, init_packet(generation=2))
    machine.open_failed(announced.packet, "no")
    machine.closed(1)
    assert [message["type"] for message in sent(machine)] == ["open_failed", "closed"]


def test_a_subscription_goes_out_at_welcome_and_only_if_it_was_agreed():
    machine = greeted(channels=COLOR)
    assert sent(machine) == [{"type": "subscribe", "channels": ["color"]}]
    machine = greeted("host_shm", "frames", channels=COLOR)
    assert sent(machine) == []
    (announced,) = receive(machine, init_packet())
    machine.opened(announced.packet)
    assert receive(machine, frame(7))[0].channels == BOTH, "such a server writes both"


def test_an_error_is_reported_and_closes_nothing():
    machine = greeted()
    (event,) = receive(machine, {"type": "error", "code": "too_many_clients", "message": "full"})
    assert isinstance(event, ServerError)


def test_an_init_packet_may_take_for_ever_but_not_once_it_has_begun():
    machine = IpcProtocol(HELLO)
    assert machine.deadline() == math.inf
    assert list(machine.receive(packet(init_packet())[:100], 50.0)) == []
    assert machine.expire(59.9) == []
    (event,) = machine.expire(60.0)
    assert isinstance(event, MustClose)


@pytest.mark.parametrize("header", [b"\0\0\0\0", b"\xff\xff\xff\xff", b"HTTP"])
def test_a_bad_header_closes(header):
    machine = greeted()
    (event,) = list(machine.receive(header, 0.0))
    assert isinstance(event, MustClose)
    assert "FRM-3" in event.reason


CONVERSATION = [
    {"type": "new in 1.2"},
    welcome(*IPC_CAPABILITIES, "x-unknown"),
    init_packet(),
    frame(7, slot=1),
    init_packet(generation=2),
    frame(8, generation=2),
]


def play(chunks):
    """The events of a machine whose owner opens everything and releases at once."""
    machine = IpcProtocol(HELLO)
    events = []
    for chunk in chunks:
        for event in machine.receive(chunk, 0.0):
            events.append(event)
            if isinstance(event, Announced):
                machine.opened(event.packet)
            if isinstance(event, Lent):
                machine.release(event.frame)
    return events, sent(machine)


@given(st.lists(st.integers(1, 2000), min_size=1, max_size=8))
def test_however_tcp_divides_it_the_stream_means_the_same(sizes):
    stream = b"".join(map(packet, CONVERSATION))
    chunks = []
    while stream:
        size = sizes[len(chunks) % len(sizes)]
        chunks.append(stream[:size])
        stream = stream[size:]
    assert play(chunks) == play([packet(message) for message in CONVERSATION])


@given(st.data())
def test_unknown_members_change_nothing_at_any_level(data):
    def extended(value):
        if not isinstance(value, dict):
            return value
        extra = data.draw(st.dictionaries(st.sampled_from(["x-a", "x-b"]), st.just([{}, 1])))
        return extra | {name: extended(member) for name, member in value.items()}

    messages = [packet(extended(message)) for message in CONVERSATION]
    assert play(messages) == play(map(packet, CONVERSATION))


@given(st.lists(st.binary(max_size=40) | st.binary(min_size=1, max_size=40).map(packet)))
def test_nothing_that_a_server_sends_raises(chunks):
    events, _ = play([packet(welcome(*IPC_CAPABILITIES)), *chunks])
    assert all(isinstance(event, Negotiated | Ignored | MustClose) for event in events)
