"""Who may touch which slot of a generation's ring: bookkeeping only, no memory and no waiting.

A client holds at most one lease, so with two slots more than clients (the newest image, and the one
being written) there is always one free: nobody holds up the renderer, and nothing lent is taken
back. The caller serialises the calls.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple


class Lease(NamedTuple):
    """An image and where it lies."""

    seq: int
    slot: int


class Ring:
    """The slots of one generation of memory.

    Attributes:
        slots: how many there are.
        newest: the image published last, if any.
        last_seq: number of the image published last, here or in the generation before, for numbers
            only grow on a connection [IMG-1].
        clients: how many may hold a lease at a time.
        writing: the slot that is being written, if any.
        held: the lease of each client that has one.
        seen: number of the image that each client was lent last, -1 for none.
    """

    def __init__(self, clients: int) -> None:
        """Makes a ring of empty slots, for as many clients with a lease at a time."""
        self.slots = clients + 2
        self.newest: Lease | None = None
        self.clients = clients
        self.last_seq = 0
        self.writing: int | None = None
        self.seen: dict[Hashable, int] = {}
        self.held: dict[Hashable, Lease] = {}

    def begin_write(self) -> int:
        """The slot to write the next image to, always at once [IMG-4, IMG-9]."""
        if self.writing is None:
            taken = {lease.slot for lease in self.held.values()}
            if self.newest is not None:
                taken.add(self.newest.slot)
            self.writing = next(slot for slot in range(self.slots) if slot not in taken)
        return self.writing

    def publish(self, slot: int) -> int:
        """Makes the image in the slot the newest, and returns its number.

        Raises:
            ValueError: the slot is not the one being written.
        """
        if slot != self.writing:
            raise ValueError(f"slot {slot} is not being written, slot {self.writing} is")
        self.writing = None
        self.last_seq += 1
        self.newest = Lease(self.last_seq, slot)
        return self.last_seq

    def lease(self, client: Hashable) -> Lease | None:
        """Lends the newest image [IMG-3]; None if the client holds a lease or has had this one.

        A client counts from its first call until it is dropped.

        Raises:
            ValueError: there are as many other clients as the ring was made for [IMG-18].
        """
        if client not in self.seen and len(self.seen) == self.clients:
            raise ValueError(f"the ring has slots for {self.clients} clients only [IMG-18]")
        self.seen.setdefault(client, -1)
        if self.newest is None or client in self.held or self.has_seen(client):
            return None
        self.seen[client] = self.newest.seq
        self.held[client] = self.newest
        return self.newest

    def has_seen(self, client: Hashable) -> bool:
        """Whether it was lent the newest image."""
        return self.newest is not None and self.seen.get(client) == self.newest.seq

    def release(self, client: Hashable, seq: int) -> None:
        """Ends the client's lease of that image.

        Raises:
            ValueError: the client does not hold it; nothing has changed [IMG-16].
        """
        held = self.held.get(client)
        if held is None or held.seq != seq:
            holds = "no image" if held is None else f"image {held.seq}"
            raise ValueError(f"image {seq} is not held: the client holds {holds} [IMG-16]")
        del self.held[client]

    def drop(self, client: Hashable) -> None:
        """Forgets a client and its lease, if it had any [IMG-17]."""
        self.held.pop(client, None)
        self.seen.pop(client, None)
