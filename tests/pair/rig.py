"""A reference server, a relay before it, and whoever connects: all that crosses is on record."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator
from typing import Any

import splatbus_client
import splatbus_server
from splatbus_conformance.observe.audit import Audit, audit
from splatbus_conformance.observe.relay import Relay
from splatbus_conformance.wire.recording import Channel, Entry

MOST_SECONDS = 30.0
"""How long anything may take on a busy machine before a test gives up."""

Render = Callable[[splatbus_server.Bus, splatbus_server.View], None]


def listener() -> socket.socket:
    return socket.create_server(("127.0.0.1", 0))


@contextlib.contextmanager
def on_a_thread(run: Callable[[], None], stop: Callable[[], None]) -> Iterator[None]:
    """Run until the block ends; whatever goes wrong there goes wrong here."""
    errors: list[BaseException] = []

    def guarded() -> None:
        try:
            run()
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=guarded, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop()
        thread.join(MOST_SECONDS)
    assert not thread.is_alive()
    assert not errors, errors


class Tap:
    """A relay to a server, and what it has recorded."""

    def __init__(self, ipc_port: int, message_port: int) -> None:
        self.entries: list[Entry] = []
        self._fronts: dict[Channel, socket.socket] = {"ipc": listener(), "msg": listener()}
        self.ports = {name: front.getsockname()[1] for name, front in self._fronts.items()}
        behind: dict[Channel, tuple[str, int]] = {
            "ipc": ("127.0.0.1", ipc_port),
            "msg": ("127.0.0.1", message_port),
        }
        self._relay = Relay(self._fronts, behind, self.entries.append)

    def open(self) -> contextlib.AbstractContextManager[None]:
        return on_a_thread(self._relay.run, self._relay.stop)

    def session(self, **options: Any) -> splatbus_client.Session:
        """A reference client's session with the server, through the relay."""
        ports = self.ports["ipc"], self.ports["msg"]
        return splatbus_client.connect("127.0.0.1", *ports, **options)

    def judged(self) -> Audit:
        """What all that passed shows of both peers."""
        return audit(list(self.entries))

    def assert_conforming(self) -> None:
        """Nobody broke a rule."""
        broken = [
            (finding.peer, finding.requirement.id, finding.first)
            for finding in self.judged().findings
            if finding.broken
        ]
        assert not broken, broken


@contextlib.contextmanager
def served(
    loop: Callable[[threading.Event, splatbus_server.Bus], None],
    width: int,
    height: int,
    **options: Any,
) -> Iterator[tuple[splatbus_server.Bus, Tap]]:
    """A server with this render loop, which ends when the event is set, and a tap before it."""
    place: dict[str, Any] = {"host": "127.0.0.1", "ipc_port": 0, "message_port": 0}
    with splatbus_server.serve(width, height, **(place | options)) as bus:
        stopped = threading.Event()
        tap = Tap(bus.address.ipc_port, bus.address.message_port)
        with tap.open(), on_a_thread(lambda: loop(stopped, bus), stopped.set):
            yield bus, tap


@contextlib.contextmanager
def serving(
    render: Render, width: int = 32, height: int = 24, **options: Any
) -> Iterator[tuple[splatbus_server.Bus, Tap]]:
    """A server that hands every view to `render`, and a tap before it."""

    def loop(stopped: threading.Event, bus: splatbus_server.Bus) -> None:
        while not stopped.is_set():
            view = bus.next_view(0.02)
            if view is not None:
                render(bus, view)

    with served(loop, width, height, **options) as both:
        yield both
