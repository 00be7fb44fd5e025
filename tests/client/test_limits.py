"""What a client keeps for a server, and how much of it at most, whatever the server does."""

import pytest
from splatbus_client.events import Measured, MustClose
from splatbus_client.steering import Steering
from splatbus_schemas import LIMITS
from splatbus_wire.messages import GetCameraPose, Ping, Telemetry

from tests.client.machines import MESSAGE_HELLO, greeted, ipc, receive, sent
from tests.peers.fake_server import IPC_CAPABILITIES, init_packet, welcome

# The IPC channel


def test_init_packets_that_wait_for_a_welcome_are_all_answered_or_end_the_connection():
    machine = ipc()
    waiting = [init_packet(generation=number) for number in range(1, 17)]
    assert receive(machine, *waiting) == []
    _, *announced = receive(machine, welcome(*IPC_CAPABILITIES))
    assert [event.packet.generation for event in announced] == list(range(1, 17))
    for one_more in (init_packet(generation=17), init_packet(generation=17, ring=None)):
        machine = ipc()
        (event,) = receive(machine, *waiting, one_more)
        assert isinstance(event, MustClose)
        assert "OPN-7" in event.reason


def test_a_server_that_has_us_answer_and_never_reads_is_left():
    machine = greeted()
    for generation in range(1, 100_000):
        events = receive(machine, init_packet(generation=generation, ring=None))
        if isinstance(events[-1], MustClose):
            break
    assert "unread" in events[-1].reason
    assert len(machine.unsent) < LIMITS["max_unsent_bytes"] + 2000


# Poses, questions and figures


def settle(machine):
    receive(machine, welcome("ping"))
    sent(machine)


def test_no_more_telemetry_is_kept_than_so_many_bytes():
    steering = Steering(MESSAGE_HELLO)
    for seq in range(100):
        steering.handle(Measured(Telemetry(seq, 0.0, ()), 1 << 20))
    assert [measured.telemetry.seq for measured in steering.telemetry] == [96, 97, 98, 99]


@pytest.mark.parametrize("connected", [True, False])
def test_what_nobody_waits_for_any_more_is_neither_kept_nor_asked(connected):
    steering = Steering(MESSAGE_HELLO)
    if connected:
        machine = steering.begin()
        settle(machine)
    for _ in range(2000):
        steering.ask(Ping(0.0)).cancel()
    kept = steering.ask(Ping(0.0))
    assert len(steering.questions) == 1
    assert not kept.done()
    assert not connected or len(machine._queue) == 1


def test_a_question_is_asked_although_another_who_asked_the_same_gave_up():
    steering = Steering(MESSAGE_HELLO)
    machine = steering.begin()
    settle(machine)
    given_up, kept = steering.ask(GetCameraPose(1)), steering.ask(GetCameraPose(1))
    given_up.cancel()
    steering.ask(GetCameraPose(2))
    assert [request for _, request in machine._queue] == [GetCameraPose(1), GetCameraPose(2)]
    assert not kept.cancelled()


def test_questions_that_nobody_answers_have_an_end():
    steering = Steering(MESSAGE_HELLO)
    futures = [steering.ask(GetCameraPose(0)) for _ in range(1024)]
    with pytest.raises(RuntimeError, match="1024 questions"):
        steering.ask(GetCameraPose(0))
    futures[7].cancel()
    steering.ask(GetCameraPose(0))
