"""Every rule on what goes beyond the versions that are spoken, kept and broken."""

from typing import Any

import pytest
from splatbus_conformance.wire.recording import Channel, Entry

from tests.conformance.rules.talk import (
    ALL,
    ALL_MSG,
    ASK_SIZE,
    GREETING,
    HOST_INIT,
    POSE,
    SIZE,
    TELEMETRY,
    Case,
    Step,
    breaches,
    client,
    first_breach,
    frame,
    greeting,
    hello,
    server,
    session,
    talk,
    welcome,
)

MARKER = {"type": "x-example-marker"}
GRANTED = greeting("ping", "x-example-markers")
TYPED_SIZE = {"type": "viewport_size", **SIZE}
WISH = {"type": "subscribe_telemetry", "names": None}


def msg(*steps: Step) -> list[Entry]:
    return talk("msg", *steps)


def declares(*names: str) -> list[Entry]:
    return msg(client(hello(*names)))


KEPT = declares("x-example-markers")
LATER = {"later": 1}
CASES = [
    Case("EVO-2", "client", KEPT, declares("markers")),
    Case("EVO-2", "server", msg(*GRANTED, server(MARKER)), msg(*GREETING, server({"type": "a"}))),
    Case("EVO-3", "client", msg(*GRANTED, client(MARKER)), msg(*GREETING, client(MARKER))),
    Case("EVO-3", "server", msg(*GRANTED, server(MARKER)), msg(*GREETING, server(MARKER))),
    Case("EVO-4", "client", msg(*GREETING, client(POSE)), msg(*GREETING, client(POSE | LATER))),
    Case("EVO-4", "server", session(server(frame(7))), session(server(frame(7) | LATER))),
]


@pytest.mark.parametrize("name", ["x-acme", "x-Acme-a", "x--a", "x-acme-a-b", "X-acme-a", "x-é-a"])
def test_what_is_no_name_of_a_vendor(name: str) -> None:
    assert breaches(declares(name)) == {("client", "EVO-2"): 1}
    assert breaches(msg(*GREETING, client({"type": name}))) == {("client", "EVO-2"): 1}


def test_before_welcome_a_client_may_send_nothing_of_a_vendor() -> None:
    assert breaches(msg(client(hello()), client(MARKER))) == {("client", "EVO-3"): 1}
    assert breaches(msg(client(MARKER))) == {("client", "REQ-14"): 1}


def test_the_capability_of_another_vendor_does_not_count() -> None:
    other = greeting("x-example2-markers")
    assert breaches(msg(*other, client(MARKER))) == {("client", "EVO-3"): 1}


@pytest.mark.parametrize("member", ["x-acme", "x-acme-note", "x-acme-note-2"])
def test_members_of_vendors_are_theirs_at_every_level(member: str) -> None:
    lens = frame(7)["camera"] | {member: {"any": 1}}
    assert breaches(session(server(frame(7) | {member: 1, "camera": lens}))) == {}


@pytest.mark.parametrize(
    ("channel", "message", "pointer"),
    [
        ("ipc", HOST_INIT | {"ring": HOST_INIT["ring"] | LATER}, "/ring/later"),
        ("ipc", HOST_INIT | {"meta": HOST_INIT["meta"] | {"X-a": 0}}, "/meta/X-a"),
        ("msg", TELEMETRY | {"series": [TELEMETRY["series"][0] | LATER]}, "/series/0/later"),
        ("msg", {"type": "error", "code": "busy", "message": "", **LATER}, "/later"),
    ],
)
def test_evo_4_looks_into_members_and_items(channel: Channel, message: Any, pointer: str) -> None:
    agreed = greeting(*(ALL if channel == "ipc" else ALL_MSG))
    wish = [client(WISH)] if channel == "msg" else []
    told = talk(channel, *agreed, *wish, server(message))
    assert breaches(told) == {("server", "EVO-4"): 1}
    assert first_breach(told).pointer == pointer


def test_who_speaks_1_0_may_add_what_it_likes() -> None:
    assert breaches(msg(client(POSE | LATER), client(ASK_SIZE), server(SIZE | LATER))) == {}
    fallen = msg(client(hello()), client(ASK_SIZE), server(SIZE | LATER))
    assert breaches(fallen) == {}


def test_what_a_later_version_defines_is_not_known() -> None:
    later = hello("markers") | {"versions": ["1.2", "1.1"], **LATER}
    assert breaches(msg(client(later), server(welcome()), client(POSE | LATER))) == {}
