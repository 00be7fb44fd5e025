"""What holds of a server after each of its turns, whatever happens around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from splatbus_schemas import LIMITS
from splatbus_server.connection import LINGER_SECONDS
from splatbus_server.limits import DEFAULT
from splatbus_server.reader import LET_GO_SECONDS
from splatbus_server.ring import Ring
from splatbus_server.service import READ_BYTES
from splatbus_wire.packet_reader import COMPLETION_SECONDS

from tests.simulation.clients import Client
from tests.simulation.machine.memory import Memory
from tests.simulation.server import Server

STALLED_SECONDS: float = LIMITS["stalled_reader_seconds"]
ENDED_SECONDS = LINGER_SECONDS + 6 * STALLED_SECONDS
"""By when a connection is gone that the server ends, though its client takes a byte at times."""
FREED_SECONDS = LET_GO_SECONDS + ENDED_SECONDS
LATE_SECONDS = 0.05
"""By which a turn may miss a moment."""
Clients = Callable[[], Sequence[Client]]


class Watch:
    """Looks at one server, and remembers since when what must not last has lasted."""

    def __init__(self, clients: Clients) -> None:
        self._clients = clients
        self._since: dict[object, float] = {}

    def __call__(self, server: Server, is_idle: bool) -> None:
        """Looks at what may have changed."""
        if is_idle:
            self.look_at_time(server)
        elif server.is_alive:
            self.look_at_slots(server)
            if server.painting is None:
                self.look_at_connections(server)
                self.look_at_control(server)

    def look_at_slots(self, server: Server) -> None:
        """Nothing lent is written, and nobody has two."""
        look = server.world.look
        rings = _rings(server)
        for ring in rings:
            slots = [lease.slot for lease in ring.held.values()]
            if ring.newest is not None:
                slots.append(ring.newest.slot)
            look("nothing lent or newest is written", ring.writing not in slots, ring.writing)
            look("a ring has a slot for all", len(ring.seen) <= ring.clients, len(ring.seen))
        if server.painting is not None:
            self._look_at_who_reads(server, *server.painting)
        told = {c: r.lease for c, r in server.session.readers.items() if r.lease is not None}
        held = [client for ring in rings for client in ring.held]
        look("nobody holds two images", len(held) == len(set(held)), len(held))
        look("what is lent is known to be", set(held) == set(told), len(held), len(told))

    def _look_at_who_reads(self, server: Server, memory: Memory, slot: int) -> None:
        """Nobody may read what is being painted, as far as those know who read."""
        for client in self._clients():
            for loan in client.lent():
                images: Any = loan.mapped.images
                is_it = (images.memory, loan.frame.slot) == (memory, slot)
                server.world.look("nothing that a client holds is written", not is_it, client.name)

    def look_at_connections(self, server: Server) -> None:
        """Nothing is kept of who is gone, and what is kept of who is there has a bound."""
        look, session, peers = server.world.look, server.session, server.service.peers
        here = {peer.connection for peer in peers}
        kept: set[object] = {*session.readers, *session.control.sent, *session.told_busy}
        kept.update(session.viewport.askers)
        for ring in _rings(server):
            kept.update(ring.seen)
        look("nothing is kept of who is gone", kept <= here, len(kept - here))
        look("connections are bounded", len(peers) <= 2 * DEFAULT.connections, len(peers))
        unsent = max((len(connection.unsent) for connection in here), default=0)
        look("unsent is bounded", unsent <= LIMITS["max_unsent_bytes"] + READ_BYTES, unsent)
        for peer in peers:
            if waiting := len(peer.connection.reader.decoder.payloads):
                look("what waits to be handled is bounded", 5 * waiting <= READ_BYTES, waiting)
                is_stuck = peer.connection.is_open and not peer.waits
                look("nothing waits without a reason", not is_stuck, waiting)

    def look_at_control(self, server: Server) -> None:
        """The first who steered has control, and what it sent last counts [POS-11]."""
        cameras = server.session.cameras
        control = server.session.control
        holder = next(iter(cameras), None)
        server.world.look("control passes on", control.holder is holder)
        camera = None if holder is None else cameras[holder]
        shows = control.poses.camera.position[0]
        server.world.look("the holder's pose counts", camera in (None, shows), camera, shows)

    def look_at_time(self, server: Server) -> None:
        """What has a time limit does not outlast it."""
        lasting: dict[object, float] = {}
        for peer in server.service.peers:
            connection = peer.connection
            decoder = connection.reader.decoder
            if connection.is_open and not connection.is_held and decoder.incomplete:
                lasting["half a packet", connection, decoder.offset] = COMPLETION_SECONDS
            if connection.unsent and not connection.over:
                sent = peer.socket.taken  # type: ignore[attr-defined]
                lasting["unsent", connection, sent] = STALLED_SECONDS
            if not connection.is_open:
                lasting["ending", connection] = ENDED_SECONDS
        for memory in server.exchange.replaced:
            lasting["former memory", memory] = FREED_SECONDS
        now = server.clock()
        self._since = {what: self._since.get(what, now) for what in lasting}
        for what, since in self._since.items():
            seconds = now - since
            in_time = seconds <= lasting[what] + LATE_SECONDS
            server.world.look("nothing outlasts its time", in_time, what, seconds)


def _rings(server: Server) -> list[Ring]:
    return [memory.ring for memory in (server.memory, *server.exchange.replaced)]
