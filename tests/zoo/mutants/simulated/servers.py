"""Mutants of the server: what it lends, who has control, and what it owes to whom."""

import math

from splatbus_server.exchange import Exchange
from splatbus_server.viewport import Viewport

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server, wire
from tests.zoo.mutant import mutant


@mutant(check="nothing lent or newest is written", at=server.CHOOSES_SLOT)
def server_writes_over_what_is_lent(original, self):
    """Chooses any slot to write to but the newest."""
    if self.writing is None:
        newest = None if self.newest is None else self.newest.slot
        self.writing = next(slot for slot in range(self.slots) if slot != newest)
    return self.writing


@mutant(check="nothing lent or newest is written", at=server.CHOOSES_SLOT)
def server_writes_over_the_newest(original, self):
    """Chooses any slot to write to that nobody holds."""
    if self.writing is None:
        taken = {lease.slot for lease in self.held.values()}
        self.writing = next(slot for slot in range(self.slots) if slot not in taken)
    return self.writing


@mutant(check="a frame tells the image's camera", at=server.LEASES_NEWEST)
def server_lends_what_is_written(original, self, *arguments):
    """Lends the slot that is being written as the newest image."""
    image = original(self, *arguments)
    slot = None if image is None else image.memory.ring.writing
    return image if image is None or slot is None else image._replace(slot=slot)


@mutant(check="seq grows", at=server.LEASES_SLOT)
def server_lends_what_a_client_has_had(original, self, client):
    """Does not ask whether the client has had the image."""
    self.seen.pop(client, None)
    return original(self, client)


@mutant(check="nothing is kept of who is gone", at=server.ENDS_LEASES)
def server_remembers_the_dead(original, self, client, memory):
    """Keeps the lease of a connection that has ended."""


@mutant(check="what is lent is known to be", at=Seam(Exchange, "take_back"))
def server_takes_nothing_back(original, self, client, image):
    """Keeps a slot lent that was released."""


@mutant(check="everyone is served", at=server.PUBLISHES)
def server_rings_for_nobody(original, self, *arguments):
    """Loses between two looks that a client waits for an image."""
    original(self, *arguments)
    return False


@mutant(check="a frame names an image", at=server.PUBLISHES)
def server_publishes_too_soon(original, self, view, time, fill):
    """Calls an image the newest before it is whole."""
    slots: list[tuple[object, ...]] = []
    has_news = original(self, view, time, lambda *wanted: slots.append(wanted))
    for wanted in slots:
        fill(*wanted)
    return has_news


@mutant(check="who subscribes is shown it", at=server.OWES_MORE)
def server_owes_nothing_of_a_scene_at_rest(original, self, client, memory):
    """Owes nothing to who subscribes to more of a scene at rest."""


@mutant(check="seq grows", at=Seam(Exchange, "replace"))
def server_counts_images_anew(original, self, former, memory, *other, **named):
    """Begins with the numbers again when the size changes."""
    replaced = original(self, former, memory, *other, **named)
    if replaced:
        memory.ring.last_seq = 0
    return replaced


@mutant(check="the holder's pose counts", at=server.PASSES_CONTROL_ON)
def server_passes_on_no_control(original, self, connection):
    """Ends control with the connection, and does not apply the next one's poses."""
    self.sent.pop(connection, None)


@mutant(check="the holder's pose counts", at=server.OBEYS)
def server_forgets_who_waits(original, self, connection, message):
    """Does not keep what those send who have no control."""
    if self.holder in (None, connection):
        return original(self, connection, message)
    self.sent.setdefault(connection, {})
    return False


@mutant(check="everyone is connected", at=server.COUNTS_SENT)
def server_drops_what_was_not_taken(original, self, count, now):
    """Does not send what TCP did not take."""
    original(self, len(self.unsent), now)


@mutant(check="replies come in order", at=server.HOLDS_REQUESTS)
def server_answers_out_of_turn(original, self):
    """Answers what comes behind a request that takes time before it."""


@mutant(check="nothing outlasts its time", at=wire.RECEIVES)
def server_gives_packets_all_the_time(original, self, data, now):
    """Has no time in which a packet has to be complete."""
    original(self, data, now)
    self.deadline = math.inf


@mutant(check="who can follow keeps its connections", at=server.ANNOUNCES_MEMORY)
def server_tells_of_the_first_memory_only(original, self, connection, reader, memory, now):
    """Tells a client of the first memory only."""
    if reader.told:
        reader.tell(memory, now)
    else:
        original(self, connection, reader, memory, now)


@mutant(check="memory is there while it is announced", at=server.FREES_FORMER_MEMORY)
def server_frees_at_once(original, self, now):
    """Frees former memory of which nobody holds an image, whoever has it."""
    for memory in self.exchange.replaced[:]:
        if not memory.ring.held and self.exchange.give_up(memory):
            self.viewport.chores.append(memory.close)


@mutant(check="former memory is freed", at=server.ENDS_WHO_KEEPS)
def server_ends_nobody_who_keeps_memory(original, self, now):
    """Lets who keeps former memory keep it."""


@mutant(check="the newest image is of the newest pose", at=server.FORGETS_CLIENT)
def server_sees_nobody_leave(original, self, connection):
    """Takes it for no news that a connection has gone, if no memory waits for that."""
    had_news = self.has_news or bool(self.exchange.replaced)
    original(self, connection)
    self.has_news = had_news


@mutant(check="a wish for a size is answered", at=Seam(Viewport, "settle"))
def server_never_settles(original, self, hindrance, now):
    """Begins a change of size, and does not end it."""


@mutant(check="who reads has an image")
def server_lends_whatever_it_holds(patch):
    """Lends an image whatever of what is read it holds."""
    server.NEEDS_OF_READER.replace(patch, property(lambda self: frozenset()))
