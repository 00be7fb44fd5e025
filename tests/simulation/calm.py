"""The end of a session: nothing goes wrong any more, everyone is served, then everyone leaves."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from splatbus_client.backoff import LONGEST
from splatbus_wire.messages import GetCameraPose, GetViewportSize, SetViewport, SubscribeTelemetry

from tests.simulation.clients import Client
from tests.simulation.server import Picture

if TYPE_CHECKING:
    from tests.simulation.session import Session

SETTLED_SECONDS = 32.0
"""By when every time limit has passed, and who was lost has come back."""
RESIZED_SECONDS = 22.0
"""By when who cannot follow another size, or does not, was ended and has come back."""
SERVED_SECONDS = 3.0
"""Within which a change is seen by all: [IMG-11] allows 5 seconds."""
BACK_SECONDS = 5.0
"""Within which who was turned away knocks again, and takes the place of who has left."""
GONE_SECONDS = 12.0
"""After which nothing is left of who has gone."""


def settle(session: Session) -> None:
    """Ends all harm, lets the time limits pass, and looks whether everyone is there."""
    world = session.world
    world.note("calm")
    world.is_calm = True
    session.network.calm()
    for client in session.clients:
        client.go_on()
    for visitor in session.visitors:
        if world.random.random() < 0.6:
            visitor.leave()
    world.run(world.now + 2.1)  # by when who ended has been started again
    session.server.go_on()
    world.run(world.now + SETTLED_SECONDS / 2)
    strangers = [c for c in session.clients if c.setting.token != session.setting.token]
    before = [client.message.status.connections for client in strangers]
    world.run(world.now + SETTLED_SECONDS / 2)
    _look_at_memory(session)
    _look_at_clients(session)
    _look_at_poses(session)
    for client, connections in zip(strangers, before, strict=True):
        status = client.message.status
        knows = status.connected or "unauthorized" in (status.problem or "")
        world.look("who is turned away knows why", knows, status)
        attempts = status.connections - connections
        most = 1 + SETTLED_SECONDS / 2 / LONGEST
        world.look("who is turned away knocks less and less often", attempts <= most, attempts)


def serve(session: Session) -> None:
    """Changes this and that, and looks whether everyone learns so."""
    world, server, draw = session.world, session.server, session.world.random
    if draw.random() < 0.4:
        with _keeping_connections(session):
            server.resize(draw.randint(1, 9), 2)
            world.run(world.now + RESIZED_SECONDS)
        _look_at_memory(session)
        _look_at_clients(session)
    for visitor in session.visitors:
        if getattr(visitor, "kind", "") != "keeper":
            visitor.leave()
    world.run(world.now + 6.0)
    clients = _welcome(session)
    _steer(session, clients)
    _ask(session, clients)
    _subscribe(session)
    if clients and draw.random() < 0.5:
        _resize(session, clients)
    if len(clients) > 1:
        _pass_control(session, clients)


def leave(session: Session) -> None:
    """Lets everyone leave, and looks whether anything is left of them."""
    world, server = session.world, session.server
    for client in session.clients:
        client.stop()
    for visitor in session.visitors:
        visitor.leave()
    world.run(world.now + GONE_SECONDS)
    ring, shared = server.memory.ring, server.session
    kept = [
        *(server.service.peers, ring.held, ring.seen, shared.readers, shared.control.sent),
        *(shared.told_busy, server.readings.subscribers, server.exchange.replaced),
    ]
    world.look("nothing is left of who has gone", not any(kept), kept)
    world.look("all slots are free", len(ring.held) == 0 and server.own_memory == [server.memory])
    server.end(kindly=True)


@contextlib.contextmanager
def _keeping_connections(session: Session) -> Iterator[None]:
    """Nobody who can follow another size loses a connection meanwhile."""

    def connections() -> dict[str, tuple[object, object]]:
        return {
            client.name: (client.ipc.socket, client.message.socket)
            for client in _welcome(session)
            if not client.is_turned_away and "reinit" in client.setting.capabilities
        }

    before = connections()
    yield
    lost = [name for name, sockets in connections().items() if sockets != before.get(name)]
    session.world.look("who can follow keeps its connections", not lost, lost)


def _welcome(session: Session) -> list[Client]:
    """The clients that the server takes."""
    return [c for c in session.clients if c.setting.token == session.setting.token]


def _connections(session: Session) -> Any:
    """Of the server, by the sockets of who is connected."""
    return {
        peer.socket.peer: peer.connection  # type: ignore[attr-defined]
        for peer in session.server.service.peers
    }


def _readers(session: Session) -> list[Client]:
    """Those of them that have an image to read; the others were turned away [IMG-18]."""
    connections = _connections(session)
    readers = session.server.session.readers
    found = []
    for client in _welcome(session):
        connection = connections.get(client.ipc.socket)
        if connection in readers and client.reading.problem is None:
            opened = readers[connection].opened
            if opened and (readers[connection].is_let_in or session.setting.kind == "cuda_ipc"):
                found.append(client)
    return found


def _look_at_memory(session: Session) -> None:
    server = session.server
    session.world.look("former memory is freed", not server.exchange.replaced)
    mine = server.own_memory
    session.world.look("one memory is left", mine == [server.memory], mine)
    session.world.look("no change is left undone", not server.session.viewport.is_changing)


def _look_at_clients(session: Session) -> None:
    """Everyone has come back, and has memory to read from if there is a place."""
    look, server = session.world.look, session.server
    clients = _welcome(session)
    readers = server.session.readers.values()
    is_full = sum(reader.is_let_in for reader in readers) >= session.setting.readers
    for client in clients:
        versions = client.ipc.status.version, client.message.status.version
        wants_place = "frames" in client.setting.capabilities
        is_out = wants_place and is_full and client.is_turned_away
        holds = versions == ("1.1", "1.1") or (is_out and versions[1] == "1.1")
        look("everyone is connected", holds, client.name, versions, client.ipc.status)
        holds = is_out or client.reading.open or client.reading.problem is not None
        look("everyone has memory to read", holds, client.name)


def _look_at_poses(session: Session) -> None:
    """The server has of everyone the pose that was sent last, on whatever connection."""
    cameras = session.server.session.cameras
    connections = _connections(session)
    for client in _welcome(session):
        if client.sent is not None and not client.has_lens:
            told = cameras.get(connections.get(client.message.socket))
            holds = told == client.sent
            session.world.look("the newest pose outlives its connection", holds, client.sent, told)


def _holder(session: Session) -> Any:
    """The client that has control, or None."""
    holder, connections = session.server.session.control.holder, _connections(session)
    steering = (c for c in session.clients if connections.get(c.message.socket, "") is holder)
    return next(steering, None)


def _newest(session: Session) -> Picture | None:
    image = session.server.exchange.newest
    return image and session.server.pictures[image.memory.generation, image.seq]


def _look_at_images(session: Session, camera: float | None) -> None:
    """The newest image shows that camera, and everyone has read it."""
    world, server = session.world, session.server
    newest = _newest(session)
    for client in _readers(session):
        world.look("who reads has an image", newest is not None, client.name)
        assert newest is not None
        shown = newest.view.poses.camera.position[0]
        world.look("the newest image is of the newest pose", camera in (None, shown), shown, camera)
        holds = client.seen == (server, newest.number)
        world.look("everyone is served", holds, client.name, client.seen[1], newest.number)
        holds = client.shown in (None, shown)
        world.look("everyone sees the newest pose", holds, client.name, client.shown, camera)


def _steer(session: Session, clients: list[Client]) -> None:
    """Who has control, or takes it, moves the camera."""
    camera = None
    if clients:
        camera = (_holder(session) or clients[0]).pose()
    session.server.contents += 1
    session.world.run(session.world.now + SERVED_SECONDS)
    _look_at_images(session, camera)


def _ask(session: Session, clients: list[Client]) -> None:
    """Questions are answered, and figures come."""
    world = session.world
    asked = [c.ask(request) for c in clients for request in (GetCameraPose(1), GetViewportSize())]
    for client in clients:
        client.tell(SubscribeTelemetry(None))
    world.run(world.now + 1.0)
    session.server.tell(1e6)
    world.run(world.now + 2.0)
    for question in asked:
        world.look("a question is answered", question is None or question.done(), question)
    for client in clients:
        world.look("figures come", client.value == 1e6, client.name, client.value)


def _subscribe(session: Session) -> None:
    """Who subscribes to other channels of a scene at rest is shown them."""
    world, needs = session.world, {"frames", "subscribe"}
    for _ in range(2):
        readers = [c for c in _readers(session) if needs <= {*c.setting.capabilities}]
        for client in readers:
            client.subscribe()
        world.run(world.now + SERVED_SECONDS)
        for client in readers:
            holds = client.wants <= client.read
            world.look("who subscribes is shown it", holds, client.name, client.wants, client.read)


def _resize(session: Session, clients: list[Client]) -> None:
    """Who has control asks for another size: there is an answer, and images of that size."""
    world, server = session.world, session.server
    asker = _holder(session) or clients[0]
    width = server.memory.width % 9 + 1
    question = asker.ask(SetViewport(width, 2))
    world.run(world.now + SERVED_SECONDS)
    if question is None:
        return
    world.look("a wish for a size is answered", question.done())
    if question.exception() is None:
        world.look("the size is as was granted", server.memory.width == width, width)
        with _keeping_connections(session):
            world.run(world.now + RESIZED_SECONDS)
    _look_at_memory(session)
    _steer(session, clients)


def _pass_control(session: Session, clients: list[Client]) -> None:
    """All steer, then who has control leaves, and the camera is that of the next."""
    world = session.world
    for client in clients:
        client.pose()
        world.run(world.now + 0.1)
    former = _holder(session)
    world.look("who steers has control", former is not None)
    former.stop()
    clients.remove(former)
    world.run(world.now + BACK_SECONDS + SERVED_SECONDS)
    holder = _holder(session)
    world.look("control passes to somebody", holder is not None and holder is not former)
    _look_at_images(session, holder.sent)
