"""The end of a session: nothing goes wrong any more, everyone is served, then everyone leaves."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from splatbus_wire.messages import GetCameraPose, SetViewport

from tests.simulation.clients import Client

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
    world.run(world.now + SETTLED_SECONDS)
    _look_at_memory(session)
    _look_at_clients(session)
    _look_at_poses(session)


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
    _steer(session)
    _subscribe(session)
    if draw.random() < 0.5:
        _resize(session)
    if len(session.clients) > 1:
        _pass_control(session)


def leave(session: Session) -> None:
    """Lets everyone leave, and looks whether anything is left of them."""
    for client in session.clients:
        client.stop()
    for visitor in session.visitors:
        visitor.leave()
    session.world.run(session.world.now + GONE_SECONDS)
    peers = session.server.service.peers
    session.world.look("nobody is left", not peers, peers)
    _look_at_memory(session)
    session.server.end(kindly=True)


@contextlib.contextmanager
def _keeping_connections(session: Session) -> Iterator[None]:
    """Nobody who can follow another size loses a connection meanwhile."""

    def connections() -> dict[str, tuple[object, object]]:
        return {
            client.name: (client.ipc.socket, client.message.socket)
            for client in session.clients
            if not client.is_turned_away and "reinit" in client.setting.capabilities
        }

    before = connections()
    yield
    lost = [name for name, sockets in connections().items() if sockets != before.get(name)]
    session.world.look("who can follow keeps its connections", not lost, lost)


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
    for client in session.clients:
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
    readers = server.session.readers.values()
    is_full = sum(reader.is_let_in for reader in readers) >= session.setting.readers
    for client in session.clients:
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
    for client in session.clients:
        if client.sent is not None and not client.has_lens:
            told = cameras.get(connections.get(client.message.socket))
            holds = told == client.sent
            session.world.look("the newest pose outlives its connection", holds, client.sent, told)


def _holder(session: Session) -> Any:
    """The client that has control, or None."""
    holder, connections = session.server.session.control.holder, _connections(session)
    steering = (c for c in session.clients if connections.get(c.message.socket, "") is holder)
    return next(steering, None)


def _look_at_images(session: Session, camera: float) -> None:
    """The newest image shows that camera, and everyone has read it."""
    look, server = session.world.look, session.server
    newest = server.exchange.newest
    for client in _readers(session):
        look("who reads has an image", newest is not None, client.name)
        assert newest is not None
        shown = newest.view.poses.camera.position[0]
        look("the newest image is of the newest pose", camera == shown, shown, camera)
        number = server.pictures[newest.memory.generation, newest.seq].number
        look("everyone is served", client.seen == (server, number), client.name, number)


def _steer(session: Session) -> None:
    """Who has control, or takes it, moves the camera; all ask something."""
    camera = (_holder(session) or session.clients[0]).pose()
    session.server.contents += 1
    asked = [client.ask(GetCameraPose(1)) for client in session.clients]
    session.world.run(session.world.now + SERVED_SECONDS)
    _look_at_images(session, camera)
    for question in asked:
        session.world.look("a question is answered", question is None or question.done())


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


def _resize(session: Session) -> None:
    """Who has control asks for another size: there is an answer, and images of that size."""
    world, server = session.world, session.server
    asker = _holder(session) or session.clients[0]
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
    _steer(session)


def _pass_control(session: Session) -> None:
    """All steer, then who has control leaves, and the camera is that of the next."""
    world = session.world
    for client in session.clients:
        client.pose()
        world.run(world.now + 0.1)
    former = _holder(session)
    world.look("who steers has control", former is not None)
    former.stop()
    world.run(world.now + BACK_SECONDS + SERVED_SECONDS)
    holder = _holder(session)
    world.look("control passes to somebody", holder is not None and holder is not former)
    _look_at_images(session, holder.sent)
