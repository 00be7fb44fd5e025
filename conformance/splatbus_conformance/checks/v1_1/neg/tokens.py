"""Checks on tokens (spec 1.1 section 2.4): the server is launched with one in its environment."""

import ipaddress
import socket
from collections.abc import Iterator
from contextlib import contextmanager

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.checks.v1_0.lim_sec import accepts, addresses
from splatbus_conformance.checks.v1_1.neg.servers import CHARACTERS, refused
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.messages import camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS

TOKEN = "a token of the conformance harness"
EVERYWHERE = "0.0.0.0"
HELLO_SECONDS: float = LIMITS["hello_seconds"]
GLANCE_SECONDS = 0.3
LOOKS = 3
AGAIN_SECONDS = 3.0
"""Between things that are said instead of hello."""


@contextmanager
def with_token(trial: ServerTrial) -> Iterator[str]:
    """The server, which requires this token; launched with one, unless it required one before.

    Skips the check where it requires none.
    """
    if trial.facts.guarded and trial.viewer.token:
        yield trial.viewer.token
        return
    with trial.relaunched(SPLATBUS_TOKEN=TOKEN):
        trial.viewer.token = TOKEN
        for channel in CHANNELS:
            trial.greeted(channel)
        if _welcomes_anyone(trial):
            trial.not_observable("the server requires no token although SPLATBUS_TOKEN names one")
        trial.peer.close_all()
        yield TOKEN


def _welcomes_anyone(trial: ServerTrial) -> bool:
    """Whether a hello without a token is given `welcome`. One that is closed and not answered may
    have come beside another, or before the server saw that other go (CHN-13).
    """
    for _ in range(LOOKS):
        trial.peer.close_all()
        trial.rest(GLANCE_SECONDS)
        answer = trial.answered("msg", token=None)[1]
        if answer is not None:
            return bool(answer["type"] == "welcome")
    return False


@check(
    "NEG-12", observable="when a silent connection is closed", on={SERVER: ("1.1",)}, profile="full"
)
def check_closes_who_says_no_hello(trial: ServerTrial) -> None:
    """Silence on either channel, requests again and again, and bytes that come one by one, for
    longer than 10 seconds.
    """
    with with_token(trial):
        silent = [trial.before_hello(channel) for channel in CHANNELS]
        asking, stuck = trial.before_hello("msg"), trial.before_hello("ipc")
        asking.send(packet(encode(VIEWPORT_REQUEST)))
        stuck.send(packet(encode({"type": "opened", "generation": 1})))
        waiting = [*silent, asking, stuck]
        clock = trial.peer.clock
        until = clock() + HELLO_SECONDS + EFFECT_SECONDS
        while (left := until - clock()) > 0:
            if trial.wait(lambda: all(each.ended for each in waiting), min(left, AGAIN_SECONDS)):
                break
            asking.send(packet(encode(VIEWPORT_REQUEST)))
            stuck.send(packet(encode({"type": "opened", "generation": 1}))[:1])
        for connection in waiting:
            outcome = "closes" if connection.ended else "waits"
            trial.judge(outcome, f"{connection.channel}: no hello {HELLO_SECONDS:g} s after accept")
            trial.delivered += 1
        for channel in CHANNELS:
            trial.greeted(channel)


@check(
    "NEG-17", observable="where it listens without a token", on={SERVER: ("1.1",)}, may_crash=True
)
def check_listens_on_loopback_without_a_token(trial: ServerTrial) -> None:
    """Launches the server to listen on every address: with a token, as a control, then without."""
    others, ports = addresses(), trial.peer.ports
    if not others or not is_loopback(trial.peer.host):
        trial.not_observable("there is no address beside loopback to listen on")

    def reached() -> list[str]:
        return [f"{a}:{p}" for a in others for p in ports.values() if accepts(a, p)]

    with trial.relaunched(SPLATBUS_HOST=EVERYWHERE, SPLATBUS_TOKEN=TOKEN):
        trial.before_hello("msg")
        if not reached():
            trial.not_observable("with a token it listens on loopback only, told otherwise or not")

    def listens() -> bool:
        listened = [ports[channel] for channel, it in trial.facts.listens.items() if it]
        return all(accepts(trial.peer.host, port) for port in listened)

    with trial.relaunched(SPLATBUS_HOST=EVERYWHERE, SPLATBUS_TOKEN=""):
        trial.testee.ensure_running()
        trial.peer.until(lambda: trial.fate() or listens(), trial.patience)
        where = reached()
        trial.expect(
            not where, "beyond-loopback", f"it listens on {', '.join(where)} and requires no token"
        )
        if fate := trial.fate():
            trial.judge(fate, f"told to listen on {EVERYWHERE} without a token")
        elif not listens():
            trial.not_observable("without a token it listens nowhere, and its process goes on")
    trial.delivered += 1


def is_loopback(host: str) -> bool:
    """Whether a name or address is of this machine only."""
    return ipaddress.ip_address(socket.gethostbyname(host)).is_loopback


@check("NEG-18", observable="what a wrong token is answered", on={SERVER: ("1.1",)})
def check_refuses_other_tokens(trial: ServerTrial) -> None:
    """No token, and others that are like the right one or not, on either channel."""
    drawn = st.text(CHARACTERS, min_size=1, max_size=LIMITS["max_token_chars"])
    with with_token(trial) as right:
        others = drawn.filter(right.__ne__)
        for token in trial.each([None, *near(right)], others, quick=10, full=300):
            for channel in CHANNELS:
                expect_refusal(trial, channel, token)
            trial.delivered += 1
        for channel in CHANNELS:
            trial.greeted(channel)


def near(token: str) -> list[str]:
    """Tokens that are not this one, but nearly."""
    some = [token[:-1], token + " ", "\x00" + token, token + "\x00", token[0], token.upper()]
    some = [it for it in [*some, token.lower(), token.swapcase()] if it not in ("", token)]
    return [it for it in dict.fromkeys(some) if len(it) <= LIMITS["max_token_chars"]]


def expect_refusal(trial: ServerTrial, channel: Channel, token: str | None) -> None:
    """A hello with this token is told `unauthorized`, and that is all."""
    what = f"{channel}: a hello with " + ("no token" if token is None else f"the token {token!r}")
    connection, _ = refused(trial, channel, "unauthorized", what, token=token)
    trial.expect(trial.ends(connection), "not-closed", f"{what} was refused, and not closed")
    packets = len(connection.messages)
    trial.expect(
        packets == 1,
        "further-packet",
        f"{what} was sent {packets} packets, not unauthorized alone",
    )
    connection.close()


@check(
    "NEG-19", observable="what a client of 1.0 gets, and whether it moves", on={SERVER: ("1.1",)}
)
def check_serves_no_client_of_1_0(trial: ServerTrial) -> None:
    """Requests and a pose without `hello`, to a server that requires a token."""
    requests = [VIEWPORT_REQUEST, {"type": "get_camera_pose", "cam_idx": 0}, camera_pose()]
    with with_token(trial):
        for request in trial.each(requests):
            connection = trial.before_hello("msg")
            connection.send(packet(encode(request)))
            replies = trial.grows(connection, connection.messages, 0, GLANCE_SECONDS)
            trial.expect(not replies, "replies", f"{request['type']} without hello got a reply")
            outcome = trial.fate() or ("closes" if connection.ended else "ignores")
            trial.judge(outcome, f"{request['type']} without hello")
            trial.delivered += 1
            if request is not requests[-1] or trial.facts.alone["msg"]:
                connection.close()
        if trial.facts.renders:
            seen = trial.sees(trial.reading(), trial.move())
            trial.expect(
                seen,
                "no-frame",
                "after a pose without hello, that of a client with the token failed",
            )


@check("NEG-33", observable="replies to who said the token and speaks 1.0", on={SERVER: ("1.1",)})
def check_the_token_lets_1_0_in(trial: ServerTrial) -> None:
    """A hello with the token that lists 1.0 alone, to a server that requires one; then requests."""
    with with_token(trial):
        connection, answer = trial.answered("msg", versions=["1.0"])
        if (answer or {}).get("version") != "1.0":
            trial.not_observable("the server does not agree on 1.0")
        for request in trial.each([VIEWPORT_REQUEST, {"type": "get_camera_pose", "cam_idx": 0}]):
            reply = trial.ask(connection, request)
            what = f"{request['type']} on a connection that said the token and agreed on 1.0"
            trial.expect(reply is not None, "no-reply", f"{what} was not answered")
            trial.delivered += 1
