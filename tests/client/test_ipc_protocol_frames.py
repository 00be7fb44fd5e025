"""The IPC channel's machine: frames that are lent, given back or ignored."""

import pytest
from splatbus_client.events import Ignored, Lent

from tests.client.ipc_machine import BOTH, COLOR, greeted, opened, receive, sent
from tests.peers.fake_server import CAMERA, SLOTS, frame, init_packet


def test_a_frame_is_lent_and_released_once():
    machine = opened()
    (event,) = receive(machine, frame(7, slot=2))
    assert isinstance(event, Lent)
    assert event.channels == BOTH
    assert sent(machine) == [], "release waits for the reader"
    machine.release(event.frame)
    machine.release(event.frame)
    assert sent(machine) == [{"type": "release", "generation": 1, "seq": 7}]


@pytest.mark.parametrize("seq", [7, 6, 0])
def test_a_frame_whose_number_does_not_grow_is_lent_all_the_same(seq):
    machine = opened()
    for number in (7, seq):
        (event,) = receive(machine, frame(number))
        machine.release(event.frame)
    assert [release["seq"] for release in sent(machine)] == [7, seq]


@pytest.mark.parametrize(
    "strange",
    [
        {"generation": 2},
        {"generation": None},
        {"slot": SLOTS},
        {"slot": -1},
        {"slot": "0"},
        {"slot": SLOTS, "camera": None},
        {"generation": 2, "camera": None},
        {"seq": None},
    ],
)
def test_a_frame_of_memory_that_is_not_open_is_ignored(strange):
    machine = opened()
    (event,) = receive(machine, frame(7) | strange)
    assert isinstance(event, Ignored)
    assert sent(machine) == []
    assert isinstance(receive(machine, frame(8))[0], Lent)


@pytest.mark.parametrize(
    "malformed",
    [
        {"camera": None},
        {"camera": CAMERA | {"rotation": [0.0, 0.0, 0.0, 2.0]}},
        {"camera": CAMERA | {"near": 2.0, "far": 1.0}},
        {"objects": [{"object": "chair"}]},
        {"renderedAt": "now"},
    ],
)
def test_a_frame_that_is_malformed_but_lent_is_given_back_unread(malformed):
    machine = opened()
    (event,) = receive(machine, frame(7, slot=1) | malformed)
    assert isinstance(event, Ignored)
    assert sent(machine) == [{"type": "release", "generation": 1, "seq": 7}]
    assert isinstance(receive(machine, frame(8))[0], Lent)


def test_a_malformed_frame_never_gives_back_what_is_being_read():
    machine = opened()
    (lent,) = receive(machine, frame(7))
    receive(machine, frame(7) | {"camera": None})
    assert sent(machine) == []
    machine.release(lent.frame)
    assert len(sent(machine)) == 1


def test_a_malformed_frame_is_ignored_where_frames_were_not_agreed():
    machine = opened("host_shm")
    receive(machine, frame(7) | {"camera": None})
    assert sent(machine) == []


def test_a_frame_before_opened_is_ignored():
    machine = greeted()
    receive(machine, init_packet())
    (event,) = receive(machine, frame(7))
    assert isinstance(event, Ignored)


def test_frames_are_ignored_where_they_were_not_agreed():
    machine = opened("host_shm")
    (event,) = receive(machine, frame(7))
    assert isinstance(event, Ignored)
    assert sent(machine) == []


def test_a_channel_newly_subscribed_to_is_not_read_from_a_frame_that_may_be_older():
    machine = greeted(channels=COLOR)
    (announced,) = receive(machine, init_packet())
    machine.opened(announced.packet)
    (first,) = receive(machine, frame(7))
    assert first.channels == COLOR
    machine.release(first.frame)
    machine.subscribe(BOTH)
    (under_way,) = receive(machine, frame(8))
    assert under_way.channels == COLOR
    machine.release(under_way.frame)
    assert receive(machine, frame(9))[0].channels == BOTH
