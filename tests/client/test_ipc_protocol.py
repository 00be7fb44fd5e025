"""The IPC channel's machine: what was announced, opened and lent, in bytes and events."""

import pytest
from splatbus_client.events import (
    Announced,
    Ignored,
    Lent,
    Negotiated,
    ServerError,
)

from tests.client.machines import BOTH, COLOR, greeted, ipc, opened, receive, sent
from tests.peers.fake_server import (
    cuda_init_packet,
    frame,
    init_packet,
)

ERROR = {"type": "error", "code": "too_many_clients", "message": "full"}
MALFORMED = {"camera": None}
SECOND = init_packet(generation=2)


# What the owner does upon the newest event


def closes(machine, event):
    machine.closed(1)


EXCHANGES = {
    "a broken one of 1.0 is ignored, and the next taken": (
        ipc,
        [cuda_init_packet(evt_done=None), cuda_init_packet()],
        [Ignored, Negotiated, Announced],
        [],
    ),
    "memory of 1.0 comes too late after welcome": (greeted, [cuda_init_packet()], [Ignored], []),
    "a frame of what is being closed is given back unread": (
        opened,
        [SECOND, frame(7), frame(8)],
        [Announced],
        [("release", 1, 7), ("release", 1, 8)],
    ),
    "what is open is never called closed": (opened, [frame(7), closes], [Lent], []),
    "an error closes nothing": (greeted, [ERROR, init_packet()], [ServerError, Announced], []),
    "a malformed frame never gives back what is being read": (
        opened,
        [frame(7), frame(7) | MALFORMED],
        [Lent, Ignored],
        [],
    ),
    "without frames none is lent or given back": (
        lambda: opened("host_shm"),
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
