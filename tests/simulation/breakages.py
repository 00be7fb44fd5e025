"""Small faults put into the pair, each at a public step, which the simulation has to find."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import Any, NamedTuple
from unittest import mock

from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.reading import Reading
from splatbus_client.steering import Steering
from splatbus_server.connection import Connection
from splatbus_server.control import Control
from splatbus_server.exchange import Exchange, Image
from splatbus_server.reader import Reader
from splatbus_server.ring import Lease, Ring
from splatbus_server.session import Session
from splatbus_server.viewport import Viewport
from splatbus_wire.messages import Frame
from splatbus_wire.packet_reader import PacketReader


class Breakage(NamedTuple):
    """A step, and what takes its place; `seed` is that of a session that finds it."""

    owner: type
    step: str
    broken: Any
    seed: int


def writes_over_what_is_lent(self: Ring) -> int:
    """The slot to write to is any but the newest."""
    if self.writing is None:
        newest = None if self.newest is None else self.newest.slot
        self.writing = next(slot for slot in range(self.slots) if slot != newest)
    return self.writing


def writes_over_the_newest(self: Ring) -> int:
    """The slot to write to is any that nobody holds."""
    if self.writing is None:
        taken = {lease.slot for lease in self.held.values()}
        self.writing = next(slot for slot in range(self.slots) if slot not in taken)
    return self.writing


def lends_what_is_written(self: Exchange, *arguments: Any) -> Image | None:
    """The slot that is being written is lent as the newest image."""
    image = _LEND(self, *arguments)
    slot = None if image is None else image.memory.ring.writing
    return image if image is None or slot is None else image._replace(slot=slot)


def lends_twice(self: Ring, client: Any) -> Lease | None:
    """Whether the client has had the image is not asked."""
    self.seen.pop(client, None)
    return _LEASE(self, client)


def remembers_the_dead(self: Exchange, client: Any, memory: Any) -> None:
    """A lease does not end with its connection."""


def takes_nothing_back(self: Exchange, client: Any, image: Any) -> None:
    """A slot that is released stays lent."""


def rings_for_nobody(self: Exchange, *arguments: Any) -> bool:
    """That a client waits for an image is lost between two looks."""
    _PUBLISH(self, *arguments)
    return False


def publishes_too_soon(self: Exchange, view: Any, time: float, fill: Any) -> bool:
    """An image is the newest before it is whole."""
    slots: list[tuple[Any, ...]] = []
    has_news = _PUBLISH(self, view, time, lambda *wanted: slots.append(wanted))
    for wanted in slots:
        fill(*wanted)
    return has_news


def lets_it_rest(self: Exchange, client: Any, memory: Any) -> None:
    """Who subscribes to more of a scene at rest is owed nothing."""


def counts_anew(self: Exchange, former: Any, memory: Any, *other: Any, **named: Any) -> bool:
    """Numbers begin again when the size changes."""
    replaced = _REPLACE(self, former, memory, *other, **named)
    if replaced:
        memory.ring.last_seq = 0
    return replaced


def keeps_control(self: Control, connection: Any) -> bool:
    """Control ends with the connection, and the next one's poses are not applied."""
    return self.sent.pop(connection, None) is not None


def forgets_who_waits(self: Control, connection: Any, message: Any) -> bool:
    """What those send who have no control is not kept."""
    if self.holder in (None, connection):
        return _MOVE(self, connection, message)
    self.sent.setdefault(connection, {})
    return False


def drops_what_was_not_taken(self: Connection, count: int, now: float) -> None:
    """What TCP did not take is not sent."""
    _SENT(self, len(self.unsent), now)


def answers_out_of_turn(self: Connection) -> None:
    """What comes behind a request that takes time is answered before it."""


def waits_for_ever(self: PacketReader, data: bytes, now: float) -> None:
    """A packet has no time in which it has to be complete."""
    _RECEIVE(self, data, now)
    self.deadline = math.inf


def tells_nobody(self: Session, connection: Any, reader: Reader, memory: Any, now: float) -> None:
    """A client is told of the first memory only."""
    if reader.told:
        reader.tell(memory, now)
    else:
        _ANNOUNCE(self, connection, reader, memory, now)


def frees_at_once(self: Session, now: float) -> None:
    """Former memory is freed whoever has it."""
    for memory in self.exchange.replaced[:]:
        if self.exchange.give_up(memory):
            self.viewport.chores.append(memory.close)


def ends_nobody(self: Session, now: float) -> None:
    """Who keeps former memory may keep it."""


def leaves_unnoticed(self: Session, connection: Connection) -> None:
    """That a connection has gone is no news."""
    had_news = self.has_news
    _LEAVE(self, connection)
    self.has_news = had_news


def never_settles(self: Viewport, hindrance: Any, now: float) -> None:
    """A change of size is begun and not ended."""


def needs_nothing(self: Reader) -> frozenset[str]:
    """An image is lent whatever it holds."""
    return frozenset()


def releases_at_once(self: Reading) -> Any:
    """The client gives an image back when it begins to read it."""
    loan = _HOLD(self)
    if loan is not None and isinstance(loan.frame, Frame):
        loan.mapped.machine.release(loan.frame)
    return loan


def never_closes(self: IpcProtocol, generation: int) -> None:
    """The client does not say that it has unmapped former memory."""
    self.retired.discard(generation)
    self.slots.pop(generation, None)


def reads_on_from_the_last(self: Reading) -> None:
    """Half a packet goes on with the first bytes of the next connection."""
    former = self.machine
    _END(self)
    begin = self.begin

    def begin_with_that() -> IpcProtocol:
        machine = begin()
        if former is not None:
            machine.reader.decoder.unfinished += former.reader.decoder.unfinished
        return machine

    self.begin = begin_with_that  # type: ignore[method-assign]


def forgets_poses(self: Steering) -> Any:
    """What was told is not told again on the next connection."""
    self.newest.clear()
    return _BEGIN(self)


_LEASE, _PUBLISH, _REPLACE = Ring.lease, Exchange.publish, Exchange.replace
_MOVE, _SENT, _RECEIVE = Control.move, Connection.sent, PacketReader.receive
_ANNOUNCE, _LEAVE, _LEND = Session.announce, Session.leave, Exchange.lend
_HOLD, _END, _BEGIN = Reading.hold, Reading.end, Steering.begin
BREAKAGES = {
    "writes over what is lent": Breakage(Ring, "begin_write", writes_over_what_is_lent, 0),
    "writes over the newest": Breakage(Ring, "begin_write", writes_over_the_newest, 0),
    "lends what is written": Breakage(Exchange, "lend", lends_what_is_written, 0),
    "lends twice": Breakage(Ring, "lease", lends_twice, 0),
    "a lease outlives its connection": Breakage(Exchange, "forget", remembers_the_dead, 0),
    "a release forgets nothing": Breakage(Exchange, "take_back", takes_nothing_back, 0),
    "news of an image is lost": Breakage(Exchange, "publish", rings_for_nobody, 0),
    "an image is published too soon": Breakage(Exchange, "publish", publishes_too_soon, 0),
    "a scene at rest owes nothing": Breakage(Exchange, "renew", lets_it_rest, 0),
    "seq begins anew after a resize": Breakage(Exchange, "replace", counts_anew, 0),
    "control is not passed on": Breakage(Control, "leave", keeps_control, 0),
    "who waits for control is forgotten": Breakage(Control, "move", forgets_who_waits, 0),
    "unsent bytes are dropped": Breakage(Connection, "sent", drops_what_was_not_taken, 2),
    "replies out of order": Breakage(Connection, "hold", answers_out_of_turn, 6),
    "a time limit is ignored": Breakage(PacketReader, "receive", waits_for_ever, 58),
    "nobody is told of memory": Breakage(Session, "announce", tells_nobody, 0),
    "memory is freed at once": Breakage(Session, "free_replaced", frees_at_once, 1),
    "who keeps memory may": Breakage(Session, "end_who_keeps", ends_nobody, 18),
    "that somebody left is no news": Breakage(Session, "leave", leaves_unnoticed, 0),
    "a change is never settled": Breakage(Viewport, "settle", never_settles, 1),
    "an image lacks what is read": Breakage(Reader, "needs", property(needs_nothing), 1),
    "a client releases too soon": Breakage(Reading, "hold", releases_at_once, 0),
    "a client never closes": Breakage(IpcProtocol, "closed", never_closes, 0),
    "half a packet goes on": Breakage(Reading, "end", reads_on_from_the_last, 25),
    "a client forgets its poses": Breakage(Steering, "begin", forgets_poses, 3),
}


@contextlib.contextmanager
def broken(breakage: Breakage) -> Iterator[None]:
    """Has the step broken until the block ends."""
    with mock.patch.object(breakage.owner, breakage.step, breakage.broken):
        yield
