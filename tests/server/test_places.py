"""Who is served where a channel is full, and how many can come at once."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest
import splatbus_server
from splatbus_server import share
from splatbus_server.limits import DEFAULT, Limits

from tests.peers.raw_client import RawClient, hello
from tests.server.conftest import SIZE
from tests.waiting import eventually

both = pytest.mark.parametrize("port", ["ipc_port", "message_port"])


@contextmanager
def serving(
    port: str, **options: Any
) -> Iterator[tuple[splatbus_server.Bus, Callable[[], RawClient]]]:
    """A server, and clients that come on one of its ports."""
    with (
        splatbus_server.serve(*SIZE, ipc_port=0, message_port=0, **options) as bus,
        ExitStack() as stack,
    ):
        yield bus, lambda: stack.enter_context(RawClient(getattr(bus.address, port)))


@both
def test_who_says_nothing_makes_room_the_oldest_first(
    port: str, caplog: pytest.LogCaptureFixture
) -> None:
    """[CHN-25, LIM-1]"""
    with serving(port) as (bus, comes):
        known = comes()
        assert known.ask(hello()) is not None
        idle = [comes() for _ in range(DEFAULT.connections - 1)]
        idle[0].send(hello())  # which may not have been read yet when others come
        idle[1].send({"type": "nothing"})
        newest = [comes() for _ in range(3)]
        assert [client.receive() for client in idle[1:4]] == [None] * 3
        for client in (*newest, *idle[4:]):
            assert client.ask(hello()) is not None
        assert (idle[0].receive() or {})["type"] == "welcome"
        assert comes().receive() is None
        assert "LIM-1" in caplog.text
        told = bus.statistics.refused
        assert (told["made_room"], told["too_many_connections"]) == (3, 1)


def test_with_a_token_strangers_have_half_of_the_places() -> None:
    """[CHN-25]"""
    token = "of this server"
    with serving("message_port", token=token, limits=Limits(connections=4)) as (_, comes):
        strangers = [comes() for _ in range(3)]
        assert strangers[0].receive() is None
        friends = []
        for number in (1, 2):
            friends.append(comes())
            if number == 1:
                assert strangers[1].receive() is None
            assert friends[-1].ask(hello(token=token)) is not None
        assert strangers[2].ask(hello(token=token)) is not None


@both
def test_who_has_gone_makes_room_though_it_rests(
    port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise work for those who are gone would keep others out."""
    monkeypatch.setattr(share, "REST", 200.0)
    with serving(port) as (_, comes):
        for _ in range(3 * DEFAULT.connections):
            with comes() as client:
                assert client.ask(hello()) is not None
                client.send(*[{"type": "nothing"}] * 500)
        assert comes().ask(hello()) is not None


def test_ever_so_many_can_connect_at_once(bus: splatbus_server.Bus) -> None:
    """None is lost, though most are closed for there is no place for them [CHN-13]."""
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(1000)]
        for each in sockets:
            each.setblocking(False)
            each.connect_ex(("127.0.0.1", bus.address.message_port))
        assert eventually(lambda: bus.statistics.connections == len(sockets), 20)
