"""Every rule on the server's side of the negotiation and on errors, kept and broken."""

from typing import Any

import pytest
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ALL,
    ASK_SIZE,
    CUDA_INIT,
    GREETING,
    HOST_INIT,
    INIT,
    POSE,
    SIZE,
    Case,
    Step,
    breaches,
    changed,
    client,
    error,
    first_breach,
    greeting,
    hello,
    server,
    talk,
    welcome,
)

SPOKEN = ["2.0"]
TYPED_SIZE = {"type": "viewport_size", "viewport_size": [64, 48]}


def msg(*steps: Step) -> list[Entry]:
    return talk("msg", *steps)


def answers(*replies: dict, capabilities: tuple[str, ...] = ()) -> list[Entry]:
    return msg(client(hello(*capabilities)), *(server(reply) for reply in replies))


UNSUPPORTED = error("unsupported_version", supported=SPOKEN)
UNAUTHORIZED = error("unauthorized")
FULL = error("too_many_clients")
BUSY = error("busy")

CASES = [
    Case("NEG-6", "server", msg(*GREETING), answers({**welcome(), "version": "2.0"})),
    Case("NEG-30", "server", msg(*GREETING), answers(changed(welcome(), "/server"))),
    Case(
        "NEG-7",
        "server",
        talk("ipc", *greeting("frames")),
        talk("ipc", client(hello("frames")), server(welcome("frames", "reinit"))),
    ),
    Case(
        "NEG-31",
        "server",
        talk("ipc", *greeting("frames")),
        talk("ipc", *greeting("frames"), server(welcome("frames"))),
    ),
    Case("NEG-10", "server", answers(UNSUPPORTED), answers(error("unsupported_version"))),
    Case("NEG-18", "server", answers(UNAUTHORIZED), answers(welcome(), UNAUTHORIZED)),
    Case("NEG-22", "server", answers(BUSY), msg(server(BUSY))),
    Case("NEG-23", "server", answers(BUSY), answers(error("teapot"))),
    Case("NEG-25", "server", answers(FULL), answers(FULL, BUSY)),
    Case("NEG-41", "server", answers(BUSY), answers(error("internal"))),
]


@pytest.mark.parametrize("code", ["invalid_message", "unknown_type"])
def test_a_good_hello_is_not_refused_as_a_bad_one(code: str) -> None:
    assert breaches(answers(error(code))) == {("server", "NEG-6"): 1}
    bad = client({**hello(), "versions": []})
    unread = client({**hello(), "later": float("inf")})
    for before in ((bad,), (unread,), (unread, bad)):
        assert ("server", "NEG-6") not in breaches(talk("msg", *before, server(error(code))))


def test_with_a_welcome_to_1_0_nothing_of_1_1_is_agreed() -> None:
    greeted = (client(hello()), server({**welcome(), "version": "1.0"}))
    assert breaches(talk("msg", *greeted, client(ASK_SIZE), server(SIZE))) == {}
    tagged = talk("msg", *greeted, client({**POSE, "tag": "a"}))
    assert breaches(tagged) == {("client", "NEG-5"): 1}


def test_a_reply_or_host_memory_before_welcome_breaks_neg_6() -> None:
    overtaken = msg(client(hello()), client(ASK_SIZE), server(TYPED_SIZE), server(welcome()))
    assert breaches(overtaken) == {("server", "NEG-6"): 1}
    hasty = talk("ipc", client(hello(*ALL)), server(HOST_INIT), server(welcome(*ALL)))
    assert breaches(hasty) == {("server", "NEG-6"): 1}


def test_what_may_have_crossed_the_hello_is_not_held_against_it() -> None:
    reply = {"viewport_size": [64, 48]}
    crossed = msg(client(ASK_SIZE), client(hello()), server(reply), server(welcome()))
    assert breaches(crossed)[("server", "NEG-6")] == 0
    cuda = talk("ipc", client(hello(*ALL)), server(CUDA_INIT), server(welcome(*ALL)))
    assert breaches(cuda) == {}


def test_a_client_that_sends_an_init_packet_is_no_server() -> None:
    mirrored = breaches(talk("ipc", client(hello(*ALL)), client(HOST_INIT)))
    assert mirrored == {("client", "REQ-14"): 1}


def test_a_server_of_1_0_ignores_hello() -> None:
    assert breaches(talk("ipc", client(hello(*ALL)), server(INIT))) == {}


def test_unsupported_although_the_version_is_spoken_breaks_neg_6() -> None:
    contradictory = answers(error("unsupported_version", supported=["1.1"]))
    assert breaches(contradictory) == {("server", "NEG-6"): 1}


@pytest.mark.parametrize("listed", [["reinit"], ["frames", "subscribe"], ["later"], [""]])
def test_neg_7_wants_capabilities_of_both(listed: Any) -> None:
    odd = changed(welcome(), "/capabilities", listed)
    offered = client(hello("frames", "later"))
    found = breaches(talk("ipc", offered, server(odd)))
    assert found == {("server", "NEG-7"): 1, ("client", "EVO-2"): 1}


def test_neg_7_on_the_message_channel_there_are_none() -> None:
    shared = answers(welcome("frames"), capabilities=("frames",))
    assert breaches(shared) == {("server", "NEG-7"): 1}


def test_neg_10_wants_the_end() -> None:
    assert breaches(answers(UNSUPPORTED, BUSY)) == {("server", "NEG-10"): 1}


def test_memory_before_unauthorized_breaks_neg_18() -> None:
    leaking = talk("ipc", server(CUDA_INIT), client(hello(*ALL)), server(UNAUTHORIZED))
    assert breaches(leaking) == {("server", "NEG-18"): 1}


@pytest.mark.parametrize(
    ("pointer", "value"),
    [
        ("/code", ...),
        ("/code", 404),
        ("/message", ...),
        ("/message", None),
        ("/message", "m" * 1025),
        ("/supported", ["1.1"]),
        ("/pointer", "rotation"),
        ("/pointer", "/a~2b"),
        ("/pointer", ["rotation"]),
        ("/id", -1),
        ("/id", None),
    ],
)
def test_neg_23_covers_every_member(pointer: str, value: Any) -> None:
    """The wire takes any error (NEG-24): this is what the schema is held to."""
    broken = answers(welcome(), changed(BUSY, pointer, value))
    assert breaches(broken) == {("server", "NEG-23"): 1}
    assert first_breach(broken).pointer == pointer


@pytest.mark.parametrize("pointer", ["", "/", "/rotation/w", "/a~0b~1c", "/\n"])
def test_json_pointers(pointer: str) -> None:
    assert breaches(answers(welcome(), error("invalid_message", pointer=pointer))) == {}


def test_after_an_error_that_closes_nothing_not_even_one_of_the_same() -> None:
    assert breaches(answers(FULL, FULL, FULL))[("server", "NEG-25")] == 2
