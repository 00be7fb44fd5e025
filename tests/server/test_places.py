"""Who is served where a channel is full, and how many can come at once."""

from __future__ import annotations

import socket
from contextlib import ExitStack

import pytest
import splatbus_server
from splatbus_server import share
from splatbus_server.limits import DEFAULT, Limits

from tests.peers.raw_client import RawClient, hello
from tests.server.conftest import SIZE
from tests.waiting import eventually


@pytest.mark.parametrize("port", ["ipc_port", "message_port"])
def test_one_connection_too_many_is_closed(
    bus: splatbus_server.Bus, port: str, caplog: pytest.LogCaptureFixture
) -> None:
    """[LIM-1, CHN-13]"""
    number = getattr(bus.address, port)
    with ExitStack() as stack:
        clients = [stack.enter_context(RawClient(number)) for _ in range(DEFAULT.connections)]
        for client in clients:
            assert client.ask(hello()) is not None
        for _ in range(3):
            with RawClient(number) as surplus:
                assert surplus.receive() is None
        assert "LIM-1" in caplog.text
        clients.pop().close()

        def is_served_again() -> bool:
            with RawClient(number) as client:
                client.send(hello())
                return client.receive() is not None

        assert eventually(is_served_again)
    assert bus.statistics.refused["too_many_connections"] >= 3


@pytest.mark.parametrize("port", ["ipc_port", "message_port"])
def test_who_says_nothing_makes_room_the_oldest_first(bus: splatbus_server.Bus, port: str) -> None:
    """[CHN-25]"""
    number = getattr(bus.address, port)
    with ExitStack() as stack:

        def comes() -> RawClient:
            return stack.enter_context(RawClient(number))

        known = comes()
        assert known.ask(hello()) is not None
        idle = [comes() for _ in range(DEFAULT.connections - 1)]
        idle[0].send(hello())  # which may not have been read yet when others come
        newest = [comes() for _ in range(3)]
        assert [client.receive() for client in idle[1:4]] == [None] * 3
        for client in (*newest, *idle[4:]):
            assert client.ask(hello()) is not None
        said = idle[0].receive()
        assert said is not None
        assert said["type"] == "welcome"
    assert bus.statistics.refused["made_room"] == 3


def test_with_a_token_strangers_have_half_of_the_places() -> None:
    """[CHN-25]"""
    token = {"token": "of this server"}
    limits = Limits(connections=4)
    with ExitStack() as stack:
        bus = stack.enter_context(
            splatbus_server.serve(
                *SIZE, ipc_port=0, message_port=0, token=token["token"], limits=limits
            )
        )

        def comes() -> RawClient:
            return stack.enter_context(RawClient(bus.address.message_port))

        strangers = [comes() for _ in range(3)]
        assert strangers[0].receive() is None
        friend = comes()
        assert strangers[1].receive() is None
        assert friend.ask(hello(**token)) is not None
        other = comes()
        assert other.ask(hello(**token)) is not None
        assert strangers[2].ask(hello(**token)) is not None


@pytest.mark.parametrize("port", ["ipc_port", "message_port"])
def test_who_has_gone_makes_room_though_it_rests(
    bus: splatbus_server.Bus, port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise work for those who are gone would keep others out."""
    monkeypatch.setattr(share, "REST", 200.0)
    number = getattr(bus.address, port)
    for _ in range(3 * DEFAULT.connections):
        with RawClient(number) as client:
            client.send(hello())
            assert client.receive() is not None
            client.send(*[{"type": "nothing"}] * 500)
    with RawClient(number) as client:
        assert client.ask(hello()) is not None


@pytest.mark.parametrize("port", ["ipc_port", "message_port"])
def test_the_only_connection_makes_no_room(port: str) -> None:
    with splatbus_server.serve(
        *SIZE, ipc_port=0, message_port=0, limits=Limits(connections=1)
    ) as bus:
        number = getattr(bus.address, port)
        with RawClient(number) as only, RawClient(number) as further:
            assert further.receive() is None
            assert only.ask(hello()) is not None


def test_ever_so_many_can_connect_at_once(bus: splatbus_server.Bus) -> None:
    """None is lost, though most are closed for there is no place for them [CHN-13]."""
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(1000)]
        for each in sockets:
            each.setblocking(False)
            each.connect_ex(("127.0.0.1", bus.address.message_port))
        assert eventually(lambda: bus.statistics.connections == len(sockets), 20)
