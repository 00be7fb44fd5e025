"""Checks on tokens (spec 1.1 section 2.4): the server is launched with one in its environment."""

from collections.abc import Iterator
from contextlib import contextmanager

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.trials.controls import CAMERA_REQUEST, VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.agreement import CHARACTERS, refused
from splatbus_conformance.trials.moves.reachable import accepts, addresses
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.json_values import show, within
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.places import is_loopback
from splatbus_conformance.wire.sockets import CHANNELS

ON_ANY = {SERVER: ("1.1",)}
TOKEN = "a token of the conformance harness"
EVERYWHERE = "0.0.0.0"
HELLO_SECONDS: float = LIMITS["hello_seconds"]
MOST_CHARS: int = LIMITS["max_token_chars"]
GLANCE_SECONDS = 0.3
LOOKS = 3
AGAIN_SECONDS = 3.0
"""Between things that are said instead of hello."""


@contextmanager
def with_token(trial: ServerTrial) -> Iterator[str]:
    """The server, which requires this token, and welcomes who says it, in the end as well; launched
    with one, unless it required one before.

    Skips the check where it requires none.
    """
    if trial.facts.guarded and trial.viewer.token:
        yield trial.viewer.token
        _greet(trial)
        return
    with trial.relaunched(SPLATBUS_TOKEN=TOKEN):
        trial.viewer.token = TOKEN
        _greet(trial)
        if _welcomes_anyone(trial):
            trial.not_observable("the server requires no token although SPLATBUS_TOKEN names one")
        trial.peer.close_all()
        yield TOKEN
        _greet(trial)


def _greet(trial: ServerTrial) -> None:
    trial.peer.close_all()
    for channel in CHANNELS:
        trial.greeted(channel)


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


@check("NEG-12", on=ON_ANY, given=with_token, profile="full")
def check_closes_who_says_no_hello(trial: ServerTrial, _: str) -> None:
    """Silence on either channel, requests again and again, and bytes that come one by one, for
    longer than 10 seconds.
    """
    silent = [trial.before_hello(channel) for channel in CHANNELS]
    asking, stuck = trial.before_hello("msg"), trial.before_hello("ipc")
    request = packet(encode(VIEWPORT_REQUEST))
    opened = packet(encode({"type": "opened", "generation": 1}))
    asking.send(request)
    stuck.send(opened)
    waiting = [*silent, asking, stuck]
    clock = trial.peer.clock
    until = clock() + HELLO_SECONDS + EFFECT_SECONDS
    while (left := until - clock()) > 0:
        if trial.wait(lambda: all(each.ended for each in waiting), min(left, AGAIN_SECONDS)):
            break
        asking.send(request)
        stuck.send(opened[:1])
    for connection in waiting:
        outcome = "closes" if connection.ended else "waits"
        trial.judge(outcome, f"{connection.channel}: no hello {HELLO_SECONDS:g} s after accept")


@check("NEG-17", on=ON_ANY, may_crash=True)
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
        where = ", ".join(reached())
        told = f"it listens on {where} and requires no token"
        trial.expect(not where, "beyond-loopback", told)
        if fate := trial.fate():
            trial.judge(fate, f"told to listen on {EVERYWHERE} without a token")
        elif not listens():
            trial.not_observable("without a token it listens nowhere, and its process goes on")


def other_tokens(trial: ServerTrial, token: str) -> Cases:
    """No token, and others that are like this one or not."""
    some = [token[:-1], token + " ", "\x00" + token, token + "\x00", token[0], token.upper()]
    some = [it for it in [*some, token.lower(), token.swapcase()] if it not in ("", token)]
    near = [it for it in dict.fromkeys(some) if len(it) <= MOST_CHARS]
    drawn = st.text(CHARACTERS, min_size=1, max_size=MOST_CHARS).filter(token.__ne__)
    return Cases([None, *near], drawn, quick=10, full=300)


@check("NEG-18", on=ON_ANY, given=with_token, cases=other_tokens)
def check_refuses_other_tokens(trial: ServerTrial, _: str, token: str | None) -> None:
    """A hello with another token, on either channel, is told `unauthorized`."""
    for channel in CHANNELS:
        with_it = "no token" if token is None else f"the token {token!r}"
        refused(trial, channel, "unauthorized", f"{channel}: a hello with {with_it}", token=token)


@check("NEG-19", on=ON_ANY, given=with_token)
def check_serves_no_client_of_1_0(trial: ServerTrial, _: str) -> None:
    """Requests and a pose without `hello`, to a server that requires a token: no reply, and no
    effect.
    """
    for request in trial.each([VIEWPORT_REQUEST, CAMERA_REQUEST, camera_pose()]):
        connection = trial.before_hello("msg")
        connection.send(packet(encode(request)))
        replies = trial.grows(connection, connection.messages, 0, GLANCE_SECONDS)
        what = f"{request['type']} without hello"
        trial.expect(not replies, "replies", f"{what} got a reply")
        outcome = trial.fate() or ("closes" if connection.ended else "ignores")
        trial.judge(outcome, what)
        if trial.number < 2 or trial.facts.alone["msg"]:  # who has posed stays
            connection.close()
    if trial.facts.renders:
        seen = trial.sees(trial.reading(), trial.move())
        told = "after a pose without hello, that of a client with the token failed"
        trial.expect(seen, "no-frame", told)


@check("NEG-33", on=ON_ANY, given=with_token)
def check_the_token_lets_1_0_in(trial: ServerTrial, _: str) -> None:
    """A hello with the token that lists 1.0 alone, to a server that requires one; then requests."""
    connection, answer = trial.answered("msg", versions=["1.0"])
    if within(answer, "version") != "1.0":
        trial.not_observable("the server does not agree on 1.0")
    for request in trial.each([VIEWPORT_REQUEST, CAMERA_REQUEST]):
        reply = trial.ask(connection, request)
        what = f"{request['type']} on a connection that said the token and agreed on 1.0"
        trial.expect(reply is not None, "no-reply", f"{what} was not answered")


@check(
    "NEG-36",
    on=ON_ANY,
    given=with_token,
    cases=Cases(
        [({"client": None}, "invalid_message"), ({"versions": ["4000.0"]}, "unauthorized")]
    ),
)
def check_looks_at_a_hello_in_order(trial: ServerTrial, _: str, case: tuple[Json, str]) -> None:
    """Without the token: a hello without `client`, and one of a version that nobody speaks."""
    changes, code = case
    connection, answer = trial.answered("msg", token=None, **changes)
    found = within(answer, "code")
    told = f"a hello without the token and with {show(changes)} was answered by {show(found)}"
    trial.expect(found == code, "later-fault", told)
    connection.close()
