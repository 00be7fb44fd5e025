"""Memory that is announced anew while it is read: no order of events reads what was given up."""

import random
import threading

import numpy as np
import pytest
from splatbus_client import connect

from tests.peers.fake_server import SLOTS, Memory, frame, image, init_packet

POISON = np.nan


@pytest.fixture
def memories():
    """Makes shared memories that are removed at the end."""
    made = []

    def make():
        made.append(Memory())
        return made[-1]

    yield make
    for memory in made:
        memory.remove()


def poison(memory):
    """What a server may do with memory that was closed: anything."""
    color, depth = image(0)
    for slot in range(SLOTS):
        memory.write(slot, np.full_like(color, POISON), np.full_like(depth, POISON))


def reinit(ipc, memory, generation):
    ipc.send(init_packet(memory.name, generation))
    assert ipc.receive() == {"type": "opened", "generation": generation}


def test_a_frame_that_nobody_took_is_released_before_its_memory_is_closed(
    server, session, memories
):
    ipc = server.ipc_opened(memories())
    ipc.send(frame(7), init_packet(memories().name, 2))
    answers = [ipc.receive() for _ in range(3)]
    assert answers == [
        {"type": "opened", "generation": 2},
        {"type": "release", "generation": 1, "seq": 7},
        {"type": "closed", "generation": 1},
    ]
    with pytest.raises(TimeoutError):
        session.next_frame(0.01)


def test_a_frame_that_is_held_is_released_by_its_reader_before_its_memory_is_closed(
    server, session, memories
):
    first, second = memories(), memories()
    first.write(0, *image(1))
    ipc = server.ipc_opened(first)
    ipc.send(frame(7))
    with session.next_frame(5) as lease:
        reinit(ipc, second, 2)
        second.write(1, *image(2))
        ipc.send(frame(8, slot=1, generation=2))
        np.testing.assert_array_equal(lease.color, image(1)[0])
        assert lease.intact
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 7}
    assert ipc.receive() == {"type": "closed", "generation": 1}
    poison(first)
    with session.next_frame(5) as lease:
        np.testing.assert_array_equal(lease.color, image(2)[0])


def test_memory_that_cannot_be_opened_ends_the_former_all_the_same(server, session, memories):
    first = memories()
    ipc = server.ipc_opened(first)
    ipc.send(frame(7))
    with session.next_frame(5):
        ipc.send(init_packet("client-test-missing", 2))
        assert ipc.receive()["type"] == "open_failed"
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 7}
    assert ipc.receive() == {"type": "closed", "generation": 1}
    reinit(ipc, memories(), 3)


def test_a_frame_that_is_held_while_the_connection_changes_is_given_back_to_nobody(
    server, session, memories
):
    first, second = memories(), memories()
    ipc = server.ipc_opened(first)
    ipc.send(frame(7))
    with session.next_frame(5) as lease:
        reinit(ipc, second, 2)
        ipc.close()
        ipc = server.ipc_opened(second)
        assert not lease.intact
    ipc.send(frame(1))
    with session.next_frame(5) as lease:
        assert lease.seq == 1
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 1}


@pytest.mark.parametrize("seed", range(4))
def test_a_storm_of_sizes_tears_nothing_and_answers_everything(server, memories, seed):
    """The server writes over each memory as soon as it may, and changes it again at once."""
    random_ = random.Random(seed)
    generations, read, problems = 40, [], []

    def reader(session):
        try:
            while True:
                try:
                    lease = session.next_frame(0.02)
                except TimeoutError:
                    continue
                with lease:
                    color, depth = np.array(lease.color), np.array(lease.depth)
                    if lease.intact:
                        read.append(lease.seq)
                        expected = image(lease.seq)
                        if not (
                            np.array_equal(color, expected[0]) and (depth == expected[1]).all()
                        ):
                            problems.append(lease.seq)
        except RuntimeError:
            return  # the session is closed

    with connect("127.0.0.1", server.ipc_port, server.message_port) as session:
        thread = threading.Thread(target=reader, args=(session,))
        thread.start()
        current = memories()
        ipc = server.ipc_opened(current)
        seq, leased = 0, None
        for generation in range(2, generations + 2):
            for _ in range(random_.randrange(3)):
                seq += 1
                current.write(seq % SLOTS, *image(seq))
                ipc.send(frame(seq, slot=seq % SLOTS, generation=generation - 1))
                leased = seq
                if random_.random() < 0.7:
                    assert ipc.receive()["seq"] == seq
                    leased = None
                if leased is not None:
                    break
            former, current = current, memories()
            ipc.send(init_packet(current.name, generation))
            answers = []
            while not answers or answers[-1]["type"] != "closed":
                answers.append(ipc.receive())
            released = (
                []
                if leased is None
                else [{"type": "release", "generation": generation - 1, "seq": leased}]
            )
            leased = None
            assert answers[-1] == {"type": "closed", "generation": generation - 1}
            assert sorted(answers[:-1], key=str) == sorted(
                [{"type": "opened", "generation": generation}, *released], key=str
            )
            poison(former)
        seq += 1
        current.write(0, *image(seq))
        ipc.send(frame(seq, generation=generations + 1))
        assert ipc.receive()["seq"] == seq
    thread.join(10)
    assert not problems
    assert seq in read
