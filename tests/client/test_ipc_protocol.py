"""The IPC channel's machine: what was announced, opened and lent, in bytes and events."""

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
    IPC_CAPABILITIES,
    SLOTS,
    cuda_init_packet,
    frame,
    init_packet,
    welcome,
)

WELCOME = welcome(*IPC_CAPABILITIES)
ERROR = {"type": "error", "code": "too_many_clients", "message": "full"}
MALFORMED = {"camera": None}
SECOND = init_packet(generation=2)
OPENED, FAILED, CLOSED = ("opened", 1), ("open_failed", 1), ("closed", 1)
RELEASED = ("release", 1, 7)


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
    "a broken one of 1.0 is ignored, and the next taken": (
        ipc,
        [cuda_init_packet(evt_done=None), cuda_init_packet()],
        [Ignored, Negotiated, Announced],
        [],
    ),
    "memory of 1.0 comes too late after welcome": (greeted, [cuda_init_packet()], [Ignored], []),
    "each init packet is answered once": (greeted, [init_packet(), opens], [Announced], [OPENED]),
    "what repeats a generation that is open is ignored": (
        opened,
        [init_packet(), init_packet(semantics=None), init_packet(version="2.0")],
        [Ignored] * 3,
        [],
    ),
    "a broken one is declined, what repeats it ignored, and the next taken": (
        greeted,
        [init_packet(ring=None), init_packet(), SECOND],
        [Declined, Ignored, Announced],
        [FAILED],
    ),
    "one without a generation is ignored": (greeted, [init_packet(generation=0)], [Ignored], []),
    "a further init packet replaces the former, which is closed once": (
        opened,
        [frame(7), releases, SECOND, opens, closes, closes, frame(8), frame(9, generation=2)],
        [Lent, Announced, Ignored, Lent],
        [RELEASED, ("opened", 2), CLOSED],
    ),
    "a frame of what is being closed is given back unread": (
        opened,
        [SECOND, frame(7), frame(8)],
        [Announced],
        [RELEASED, ("release", 1, 8)],
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
        [RELEASED],
    ),
    "a frame that cannot be read is given back if it was lent": (
        opened,
        [frame(7) | MALFORMED, frame(8, slot=SLOTS) | MALFORMED, frame(8)],
        [Ignored, Ignored, Lent],
        [RELEASED],
    ),
    "a frame of what is not open is ignored": (
        opened,
        [frame(7, slot=SLOTS), frame(7, generation=2), frame(8)],
        [Ignored, Ignored, Lent],
        [],
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


def test_a_subscription_goes_out_only_if_it_was_agreed_and_such_a_server_writes_both():
    assert sent(greeted(channels=COLOR)) == [{"type": "subscribe", "channels": ["color"]}]
    machine = opened("host_shm", "frames", channels=COLOR)
    assert receive(machine, frame(7))[0].channels == BOTH


def test_a_channel_newly_subscribed_to_is_not_read_from_a_frame_that_may_be_older():
    machine = opened(channels=COLOR)
    for seq, channels in ((7, COLOR), (8, COLOR), (9, BOTH)):
        (lent,) = receive(machine, frame(seq))
        assert lent.channels == channels
        machine.release(lent.frame)
        if seq == 7:
            machine.subscribe(BOTH)
