"""The ring under every order of calls: what is lent or newest is never written."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from splatbus_server.ring import Ring

CLIENTS = st.integers(0, 5)


class Slots(RuleBasedStateMachine):
    """A ring beside memory that remembers which image lies in each slot."""

    held, newest_slot = {}, None

    @initialize(clients=st.integers(0, 4), last_seq=st.sampled_from([0, 41]))
    def begin(self, clients, last_seq):
        self.clients = clients
        self.ring = Ring(clients)
        self.ring.last_seq = self.published = last_seq
        self.memory = [None] * (clients + 2)
        self.held, self.last = {}, {}

    @rule(finish=st.booleans())
    def write(self, finish):
        slot = self.ring.begin_write()
        assert slot == self.ring.begin_write()
        self.memory[slot] = None
        if finish:
            with pytest.raises(ValueError, match="not being written"):
                self.ring.publish(slot + 1)
            self.published += 1
            self.memory[slot] = self.published
            assert self.ring.publish(slot) == self.published
            self.newest_slot = slot

    @rule(client=CLIENTS)
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
            assert self.ring.has_seen(client)

    @rule(client=CLIENTS, offset=st.sampled_from([0, 0, 0, 1, -1]))
    def release(self, client, offset):
        lease = self.held.get(client)
        if lease is not None and offset == 0:
            self.ring.release(client, lease.seq)
            del self.held[client]
            return
        with pytest.raises(ValueError, match="IMG-16"):
            self.ring.release(client, (lease.seq if lease else self.published) + offset)

    @rule(client=CLIENTS)
    def drop(self, client):
        self.ring.drop(client)
        self.held.pop(client, None)
        self.last.pop(client, None)

    @invariant()
    def what_is_lent_and_what_is_newest_are_whole(self):
        for lease in self.held.values():
            assert self.memory[lease.slot] == lease.seq
        if self.newest_slot is not None:
            assert self.memory[self.newest_slot] == self.published


TestSlots = Slots.TestCase
TestSlots.settings = settings(deadline=None, max_examples=150, stateful_step_count=40)
