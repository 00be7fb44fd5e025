"""The IPC channel's machine: what was announced, opened and lent, in bytes and events."""

import math

import pytest
from splatbus_client.events import (
    Announced,
    Declined,
    Ignored,
    Lent,
    MustClose,
    Negotiated,
    ServerError,
)

from tests.client.machines import BOTH, COLOR, greeted, ipc, opened, receive, sent
from tests.peers.fake_server import (
    CAMERA,
    IPC_CAPABILITIES,
    META,
    SLOTS,
    cuda_init_packet,
    frame,
    init_packet,
    welcome,
)
from tests.peers.raw_client import packet

WELCOME = welcome(*IPC_CAPABILITIES)
ERROR = {"type": "error", "code": "too_many_clients", "message": "full"}
MALFORMED = {"camera": None}
SECOND = init_packet(generation=2)
OPENED, CLOSED = ("opened", 1), ("closed", 1)


# What the owner does upon the newest event


def opens(machine, event):
    machine.opened(event.packet)


def fails(machine, event):
    machine.open_failed(event.packet, "no")


def releases(machine, event):
    machine.release(event.frame)


def closes(machine, event):
    machine.closed(1)


def without_reinit():
    return opened("host_shm", "frames")


def without_frames():
    return opened("host_shm")


EXCHANGES = {
    "nothing is answered before welcome": (ipc, [init_packet()], [], []),
    "what comes before welcome is announced after it": (
        ipc,
        [init_packet(), WELCOME],
        [Negotiated, Announced],
        [],
    ),
    "a version that was not offered closes": (
        ipc,
        [welcome(version="2.0"), init_packet()],
        [MustClose],
        [],
    ),
    "an init packet of 1.0 settles the version, and is answered with silence": (
        ipc,
        [cuda_init_packet(), opens, WELCOME, welcome(version="9.9"), init_packet(), frame(1)],
        [Negotiated, Announced, Ignored, Ignored, Ignored, Ignored],
        [],
    ),
    "so is one that cannot be opened": (
        ipc,
        [cuda_init_packet(), fails],
        [Negotiated, Announced],
        [],
    ),
    "to a welcome to 1.0 nothing is answered": (
        ipc,
        [welcome(*IPC_CAPABILITIES, version="1.0"), cuda_init_packet(), opens, frame(1)],
        [Negotiated, Announced, Ignored],
        [],
    ),
    "memory of 1.0 comes too late after welcome": (greeted, [cuda_init_packet()], [Ignored], []),
    "opened waits until the memory is mapped and checked": (
        greeted,
        [init_packet()],
        [Announced],
        [],
    ),
    "each init packet is answered once": (greeted, [init_packet(), opens], [Announced], [OPENED]),
    "memory that cannot be opened is declined": (
        greeted,
        [init_packet(), fails],
        [Announced],
        [("open_failed", 1)],
    ),
    "memory of a later version is announced as of one's own": (
        greeted,
        [init_packet(version="1.12", later={})],
        [Announced],
        [],
    ),
    "what repeats a generation that is open is ignored": (
        opened,
        [init_packet(), init_packet(semantics=None), init_packet(version="2.0")],
        [Ignored] * 3,
        [],
    ),
    "what repeats one that was declined is ignored": (
        greeted,
        [init_packet(ring=None), init_packet()],
        [Declined, Ignored],
        [("open_failed", 1)],
    ),
    "a further init packet replaces the former, which is closed once": (
        opened,
        [frame(7), releases, SECOND, opens, closes, closes, frame(8), frame(9, generation=2)],
        [Lent, Announced, Ignored, Lent],
        [("release", 1, 7), ("opened", 2), CLOSED],
    ),
    "a frame of what is being closed is given back unread": (
        opened,
        [SECOND, frame(7), frame(8)],
        [Announced],
        [("release", 1, 7), ("release", 1, 8)],
    ),
    "one that fails ends the former too": (
        opened,
        [SECOND, fails, closes],
        [Announced],
        [("open_failed", 2), CLOSED],
    ),
    "what is open is never called closed": (opened, [frame(7), closes], [Lent], []),
    "without reinit a further init packet is ignored": (
        without_reinit,
        [SECOND, frame(7)],
        [Ignored, Lent],
        [],
    ),
    "an error closes nothing": (greeted, [ERROR, init_packet()], [ServerError, Announced], []),
    "a frame is released once, when its reader lets go": (
        opened,
        [frame(7), releases, releases],
        [Lent],
        [("release", 1, 7)],
    ),
    "a number that does not grow is lent all the same": (
        opened,
        [frame(7), releases, frame(7), releases, frame(6), releases, frame(0), releases],
        [Lent] * 4,
        [("release", 1, 7), ("release", 1, 7), ("release", 1, 6), ("release", 1, 0)],
    ),
    "a malformed frame never gives back what is being read": (
        opened,
        [frame(7), frame(7) | MALFORMED],
        [Lent, Ignored],
        [],
    ),
    "without frames none is lent or given back": (
        without_frames,
        [frame(7), frame(8) | MALFORMED],
        [Ignored, Ignored],
        [],
    ),
    "before opened no frame is lent": (
        greeted,
        [init_packet(), frame(7)],
        [Announced, Ignored],
        [],
    ),
}


@pytest.mark.parametrize(
    ("begin", "steps", "events", "answers"), EXCHANGES.values(), ids=EXCHANGES.keys()
)
def test_what_a_server_sends_and_an_owner_does_has_these_events_and_answers(
    begin, steps, events, answers
):
    machine, seen = begin(), []
    for step in steps:
        if callable(step):
            step(machine, seen[-1])
        else:
            seen += receive(machine, step)
    assert [type(event) for event in seen] == events
    said = [
        tuple(value for name, value in each.items() if name != "reason") for each in sent(machine)
    ]
    assert said == answers


@pytest.mark.parametrize(
    "broken",
    [
        *({"meta": META | {"pitchColor": 1}}, {"meta": META | {"w": 0}}, {"evt_done": None}),
        {"mem_color": "AA=="},
    ],
)
def test_an_invalid_init_packet_of_1_0_is_ignored_and_a_valid_one_after_it_taken(broken):
    ignored, *events = receive(ipc(), cuda_init_packet(**broken), cuda_init_packet())
    assert isinstance(ignored, Ignored)
    assert isinstance(events[-1], Announced)


def test_capabilities_are_only_those_that_both_have_and_of_1_0_none():
    (event,) = receive(ipc(), welcome("frames", "x-new", "cuda_ipc"))
    assert event.capabilities == {"frames"}
    (event,) = receive(ipc(), welcome(*IPC_CAPABILITIES, version="1.0"))
    assert event == Negotiated("1.0", event.server, frozenset())


def test_a_reason_is_told_in_at_most_1024_characters():
    machine = greeted()
    (event,) = receive(machine, init_packet())
    machine.open_failed(event.packet, "x" * 5000)
    assert len(sent(machine)[0]["reason"]) == 1024


@pytest.mark.parametrize(
    "broken",
    [
        {"memory": {"kind": "host_shm", "name": "../../etc/passwd", "bytes": 5000}},
        {"memory": None},
        {"ring": {"slots": 0}},
        {"version": "1.07"},
        {"meta": {}},
    ],
)
def test_an_invalid_init_packet_is_declined_if_its_generation_can_be_read(broken):
    machine = greeted()
    (event,) = receive(machine, init_packet(**broken))
    (answer,) = sent(machine)
    assert event == Declined(1, answer["reason"])
    assert (answer["type"], answer["generation"]) == ("open_failed", 1)
    assert isinstance(receive(machine, SECOND)[0], Announced)


@pytest.mark.parametrize("generation", [0, -1, 1.5, "1", None, 2**53, True])
def test_an_init_packet_without_a_generation_is_ignored(generation):
    machine = greeted()
    (event,) = receive(machine, init_packet(generation=generation))
    assert isinstance(event, Ignored)
    assert sent(machine) == []


@pytest.mark.parametrize(
    ("strange", "given_back"),
    [
        *(({"generation": generation}, False) for generation in (2, None)),
        *(({"slot": slot}, False) for slot in (SLOTS, -1, "0")),
        *((MALFORMED | strange, False) for strange in ({"slot": SLOTS}, {"generation": 2})),
        ({"seq": None}, False),
        (MALFORMED, True),
        ({"camera": CAMERA | {"rotation": [0.0, 0.0, 0.0, 2.0]}}, True),
        ({"objects": [{"object": "chair"}]}, True),
        ({"renderedAt": "now"}, True),
    ],
)
def test_a_frame_that_cannot_be_read_is_ignored_and_given_back_if_it_was_lent(strange, given_back):
    machine = opened()
    (event,) = receive(machine, frame(7, slot=1) | strange)
    assert isinstance(event, Ignored)
    assert [each["seq"] for each in sent(machine)] == [7] * given_back
    assert isinstance(receive(machine, frame(8))[0], Lent)


def test_a_subscription_goes_out_at_welcome_and_only_if_it_was_agreed():
    assert sent(greeted(channels=COLOR)) == [{"type": "subscribe", "channels": ["color"]}]
    machine = greeted("host_shm", "frames", channels=COLOR)
    assert sent(machine) == []
    (announced,) = receive(machine, init_packet())
    machine.opened(announced.packet)
    assert receive(machine, frame(7))[0].channels == BOTH, "such a server writes both"


def test_a_channel_newly_subscribed_to_is_not_read_from_a_frame_that_may_be_older():
    machine = opened(channels=COLOR)
    (first,) = receive(machine, frame(7))
    assert first.channels == COLOR
    machine.release(first.frame)
    machine.subscribe(BOTH)
    (under_way,) = receive(machine, frame(8))
    assert under_way.channels == COLOR
    machine.release(under_way.frame)
    assert receive(machine, frame(9))[0].channels == BOTH


def test_an_init_packet_may_take_for_ever_but_not_once_it_has_begun():
    machine = ipc()
    assert machine.deadline() == math.inf
    assert list(machine.receive(packet(init_packet())[:100], 50.0)) == []
    assert machine.expire(59.9) == []
    (event,) = machine.expire(60.0)
    assert isinstance(event, MustClose)
