"""The ring under every order of calls: what is lent or newest is never written."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from splatbus_server.ring import Ring


class Slots(RuleBasedStateMachine):
    """A ring beside memory that remembers which image lies in each slot."""

    @initialize(clients=st.integers(0, 4), last_seq=st.sampled_from([0, 41]))
    def begin(self, clients, last_seq):
        self.clients = clients
        self.ring = Ring(clients)
        self.ring.last_seq = last_seq
        self.memory = [None] * self.ring.slots
        self.published = last_seq
        self.held = {}
        self.last = {}
        self.newest_slot = None

    @rule(finish=st.booleans())
    def write(self, finish):
        slot = self.ring.begin_write()
        assert slot not in {lease.slot for lease in self.held.values()}
        assert slot != self.newest_slot
        self.memory[slot] = None
        if finish:
            self.published += 1
            self.memory[slot] = self.published
            assert self.ring.publish(slot) == self.published
            self.newest_slot = slot

    @rule(client=st.integers(0, 5))
    def lease(self, client):
        if client not in self.last and len(self.last) == self.clients:
            with pytest.raises(ValueError, match="IMG-18"):
                self.ring.lease(client)
            return
        lease = self.ring.lease(client)
        due = client not in self.held and self.last.get(client) != self.published
        assert (lease is not None) == (due and self.newest_slot is not None)
        self.last.setdefault(client, None)
        if lease is not None:
            assert lease == self.ring.newest == (self.published, self.newest_slot)
            self.held[client] = lease
            self.last[client] = lease.seq

    @rule(client=st.integers(0, 5), offset=st.sampled_from([0, 0, 0, 1, -1]))
    def release(self, client, offset):
        lease = self.held.get(client)
        if lease is not None and offset == 0:
            self.ring.release(client, lease.seq)
            del self.held[client]
            return
        with pytest.raises(ValueError, match="IMG-16"):
            self.ring.release(client, (lease.seq if lease else self.published) + offset)

    @rule(client=st.integers(0, 5))
    def drop(self, client):
        self.ring.drop(client)
        self.held.pop(client, None)
        self.last.pop(client, None)

    @invariant()
    def what_is_lent_and_what_is_newest_are_whole(self):
        for lease in getattr(self, "held", {}).values():
            assert self.memory[lease.slot] == lease.seq
        if getattr(self, "newest_slot", None) is not None:
            assert self.memory[self.newest_slot] == self.published


TestSlots = Slots.TestCase
TestSlots.settings = settings(deadline=None, max_examples=150, stateful_step_count=40)


def test_without_an_image_there_is_nothing_to_lend():
    assert Ring(1).lease("viewer") is None


def test_a_client_is_lent_each_image_once_and_only_the_newest():
    ring = Ring(1)
    first, second = (ring.publish(ring.begin_write()) for _ in range(2))
    assert (first, second) == (1, 2)
    assert ring.lease("viewer").seq == second
    assert ring.lease("viewer") is None
    ring.release("viewer", second)
    assert ring.lease("viewer") is None
    third = ring.publish(ring.begin_write())
    assert ring.lease("viewer").seq == third


def test_a_stalled_client_pins_its_own_slot_and_no_more():
    ring = Ring(2)
    ring.publish(ring.begin_write())
    stalled = ring.lease("stalled")
    for _ in range(10):
        seq = ring.publish(ring.begin_write())
        assert ring.lease("quick") == (seq, ring.newest.slot)
        assert ring.newest.slot != stalled.slot
        ring.release("quick", seq)


def test_an_unfinished_image_is_written_again_into_the_same_slot():
    ring = Ring(1)
    assert ring.begin_write() == ring.begin_write()


def test_only_the_slot_being_written_can_be_published():
    ring = Ring(1)
    slot = ring.begin_write()
    with pytest.raises(ValueError, match="not being written"):
        ring.publish(slot + 1)
    ring.publish(slot)
    with pytest.raises(ValueError, match="not being written"):
        ring.publish(slot)


def test_a_dropped_client_that_returns_is_new():
    ring = Ring(1)
    seq = ring.publish(ring.begin_write())
    ring.lease("viewer")
    ring.drop("viewer")
    assert ring.lease("viewer").seq == seq
