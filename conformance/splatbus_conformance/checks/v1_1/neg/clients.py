"""Checks on `hello`, `welcome` and `error` (spec 1.1 chapter 2)."""

from random import Random

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.valid.spelling import ODD_TEXT, spell
from splatbus_conformance.checks import (
    CLIENT,
    CLIENT_IPC,
    CLIENT_MSG,
    OPENS_HOST_MEMORY,
    Cases,
    check,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.asking import asking, requests
from splatbus_conformance.trials.moves.losing import CODES, kind_of_code, lose
from splatbus_conformance.wire.json_values import strings
from splatbus_conformance.wire.message_kinds import (
    CAPABILITIES,
    CLOSING_ERRORS,
    NEEDS,
    REQUESTS,
    newer,
)
from splatbus_conformance.wire.messages import Json, encode, error, reply
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection

LISTENING_SECONDS = 0.4
WORDS = st.text("abcdefghijklmnopqrstuvwxyz_", min_size=1, max_size=64)
UNKNOWN: list[list[str]] = [["A-Z 0-9", ODD_TEXT, ""], [f"later-{n}" for n in range(64)]]
"""Capabilities that nobody knows: of any characters, and as many as a list may have."""
WEATHER: Json = {"type": "weather_report", "sunny": True}


def heard(trial: ClientTrial, connection: Connection) -> set[str]:
    """The types of all that the testee said on a connection."""
    return {str(message.get("type")) for message in trial.role.with_(connection).heard}


def listen(trial: ClientTrial, *connections: Connection) -> None:
    """Give what need not come several times as long as this testee took to say its first word."""
    first = [it.arrived(it.messages[0]) - it.opened for it in connections if it.messages]
    trial.rest(max(LISTENING_SECONDS, *(4 * seconds for seconds in first), 0.0))


def declared(trial: ClientTrial) -> list[str]:
    """The capabilities that the testee declares on the message channel."""
    return strings((trial.facts.hello["msg"] or {}).get("capabilities")) or []


def among(unknown: list[str], real: list[str]) -> list[str]:
    """Capabilities among those that nobody knows; each once, and no more than there may be."""
    most: int = LIMITS["max_capabilities"]
    return list(dict.fromkeys([*unknown[: max(0, most - len(real))], *real]))


def unwelcome(trial: ClientTrial, channel: Channel) -> Connection:
    """A new connection on which the testee has said hello, for a welcome of the check's own."""
    trial.role.welcomes = False
    connection = trial.connection(channel)
    trial.says_hello(connection)
    return connection


@check(
    "NEG-4",
    observable="memory is opened, a frame released, old memory closed, as declared",
    on={CLIENT: ("hello:ipc",)},
)
def check_can_do_what_it_declares(trial: ClientTrial) -> None:
    """Uses each capability that the testee declares, as far as this machine can."""
    declared = set(trial.facts.capabilities())
    if "host_shm" not in declared:
        trial.not_observable("the testee does not declare host_shm; its memory is not of this host")
    connection = trial.greeted("ipc")
    dealings = trial.role.with_(connection)
    trial.expect(trial.opens(connection), "not-opened", "host_shm: the memory was not opened")
    if "frames" in declared:
        trial.expect(
            trial.wait(lambda: dealings.released), "not-released", "frames: no frame was released"
        )
    if "reinit" in declared:
        former = dealings.generation
        trial.role.offer(connection, trial.role.init_packet(connection))
        trial.expect(
            trial.closes(connection, former),
            "not-closed",
            "reinit: the first generation was not closed for the second",
        )
    trial.delivered += 1


@check(
    "NEG-5",
    observable="what the testee sends before welcome, and after one that grants little",
    on={CLIENT: ("hello:ipc",)},
)
def check_sends_only_what_was_granted(trial: ClientTrial) -> None:
    """First no welcome for a while, then one that grants host_shm alone."""
    trial.role.welcomes = False
    connections = [trial.connection(channel) for channel in sorted(trial.facts.connects)]
    for connection in connections:
        if trial.facts.speaks_1_1(connection.channel):
            trial.grows(connection, connection.messages)
    listen(trial, *connections)
    for connection in connections:
        early = heard(trial, connection) - {"hello"}
        if connection.channel == "msg":
            early = set().union(*map(newer, trial.role.with_(connection).heard))
        trial.expect(
            not early, "before-welcome", f"it sent {', '.join(sorted(early))} before welcome"
        )
    connection = next(c for c in connections if c.channel == "ipc")
    dealings = trial.role.with_(connection)
    trial.role.welcome(connection, capabilities=["host_shm"])
    answered = trial.wait(lambda: dealings.opened | dealings.failed)
    listen(trial, connection)
    more = heard(trial, connection) - {"hello", "opened", "open_failed"}
    trial.expect(
        not more, "not-granted", f"it sent {', '.join(sorted(more))}, which welcome did not grant"
    )
    trial.delivered += answered


def alone(trial: ClientTrial) -> Cases:
    """No capability, then each that the testee declares on the message channel."""
    return Cases([[], *([name] for name in declared(trial) if name in CAPABILITIES["msg"])])


@check(
    "NEG-5",
    observable="what the testee sends on the message channel after a welcome that grants little",
    on={CLIENT: ("hello:msg", "returns:msg")},
    cases=alone,
)
def check_sends_only_what_was_granted_on_the_message_channel(
    trial: ClientTrial, granted: list[str]
) -> None:
    """A welcome that grants nothing, then one for each capability that the testee declares."""
    connection = unwelcome(trial, "msg")
    said = len(connection.messages)
    trial.role.welcome(connection, capabilities=granted)
    listen(trial, connection)
    for message in trial.role.with_(connection).heard:
        needed = NEEDS.get(str(message.get("type")))
        needed = "intrinsics" if "intrinsics" in newer(message) else needed
        what = f"it sent {message.get('type')}, which needs {needed}, after a welcome that"
        trial.expect(needed in (None, *granted), "not-granted", f"{what} lists {granted}")
    trial.delivered += len(connection.messages) > said


def judge_agreement(trial: ClientTrial, connection: Connection, what: str) -> None:
    """After a welcome that grants all that the testee declared, it says what it said when it was
    met that 1.0 does not define; one that says no such thing goes on.
    """
    heard = trial.role.with_(connection).heard
    if trial.facts.says_more:
        agrees = trial.wait(lambda: any(map(newer, heard)) or connection.ended)
        if not connection.ended:
            trial.expect(agrees, "not-agreed", f"{what}: it goes on as with a server of 1.0")
    outcome = trial.outcome_on_msg(connection)
    trial.judge("accepts" if outcome == "ignores" else outcome, what)


@check(
    "NEG-8",
    observable="the testee opens memory after a welcome with capabilities that nobody knows",
    on={CLIENT: OPENS_HOST_MEMORY},
    cases=Cases(UNKNOWN, st.lists(WORDS, max_size=5, unique=True), quick=3, full=12),
)
def check_ignores_unknown_capabilities(trial: ClientTrial, unknown: list[str]) -> None:
    """`welcome` lists capabilities of another time beside the real ones."""
    connection = unwelcome(trial, "ipc")
    real = [name for name in trial.facts.capabilities() if name != "subscribe"]
    trial.role.welcome(connection, capabilities=among(unknown, real))
    told = f"after a welcome that lists {unknown} the memory was not opened"
    trial.expect(trial.opens(connection), "not-opened", told)
    trial.delivered += 1


@check(
    "NEG-8",
    observable="the testee goes on after a welcome with capabilities that nobody knows",
    on={CLIENT: ("hello:msg", "returns:msg")},
    cases=Cases(UNKNOWN, st.lists(WORDS, min_size=1, max_size=5, unique=True), quick=3, full=12),
)
def check_ignores_unknown_capabilities_of_the_message_channel(
    trial: ClientTrial, unknown: list[str]
) -> None:
    """The same on the message channel, where `welcome` lists all that the testee declared, too."""
    connection = unwelcome(trial, "msg")
    trial.role.welcome(connection, capabilities=among(unknown, declared(trial)))
    judge_agreement(trial, connection, f"a welcome that lists {unknown} on the message channel")


NAMES = st.text("abcdefghijklmnopqrstuvwxyz_", min_size=12, max_size=30)
STRANGERS = st.builds(
    lambda kind, rest: {**rest, "type": kind},
    *(NAMES, st.dictionaries(NAMES, st.none() | st.integers(0, 9) | NAMES, max_size=4)),
)


@check(
    "NEG-9",
    observable="the testee goes on after messages of unknown types",
    on={CLIENT: OPENS_HOST_MEMORY},
    cases=Cases(drawn=STRANGERS, quick=10, full=100),
)
def check_ignores_unknown_types(trial: ClientTrial, message: Json) -> None:
    """Messages of types that nobody knows, before and between init packets, and unasked."""
    trial.role.offers_memory = False
    outcome = trial.outcome_on_ipc(trial.for_init_packet(), packet(encode(message)))
    trial.judge(outcome, f"a message of type {message['type']!r} on the IPC channel")


@check(
    "NEG-9",
    observable="the testee goes on after messages of unknown types on the message channel",
    on={CLIENT: ("hello:msg", "poses")},
)
def check_ignores_unknown_types_of_the_message_channel(trial: ClientTrial) -> None:
    """Messages of types that nobody knows, some with the members of replies; the first comes while
    a request waits for its reply, and has its `id`.
    """
    values = st.none() | st.integers(0, 9) | WORDS
    replies = [reply({"type": kind}, typed=True) or {} for kind in REQUESTS]
    messages = st.builds(
        lambda kind, like, rest: {**like, **rest, "type": f"later_{kind}"},
        *(WORDS, st.sampled_from([{}, *replies]), st.dictionaries(WORDS, values, max_size=4)),
    )
    connection = asking(trial) if trial.facts.asks_again else trial.greeted("msg")
    unanswered = requests(trial, connection) if trial.facts.asks_again else []
    waiting = [request["id"] for request in unanswered if "id" in request]
    for message in trial.each([WEATHER | {"id": (waiting or [0])[-1]}], messages, quick=5, full=50):
        connection = trial.greeted("msg") if connection.ended else connection
        before = len(connection.messages)
        connection.send(packet(encode(message)))
        while unanswered:  # nobody has to wait for a reply for long (CHN-15)
            trial.role.reply(connection, unanswered.pop(0))
        trial.grows(connection, connection.messages, before)
        outcome = "closes" if connection.ended else "ignores"
        trial.judge(outcome, f"a message of type {message['type']!r} on the message channel")
        trial.delivered += 1


@check(
    "NEG-16",
    observable="the testee closes the connection",
    on={CLIENT_IPC: ("hello:ipc",), CLIENT_MSG: ("hello:msg",)},
    cases=Cases(("9.9", "2.0", "1.10")),
)
def check_refuses_a_version_it_did_not_list(
    trial: ClientTrial, channel: Channel, version: str
) -> None:
    """`welcome` names a version that the testee's hello did not list."""
    role = trial.role
    # A reply before welcome would make the testee take its server to speak 1.0 (NEG-13).
    trial.peer.close_all()
    role.welcomes = role.offers_memory = role.replies = False
    connection = trial.connection(channel)
    if not trial.says_hello(connection):
        trial.not_observable(f"the testee said no hello on the {channel} channel")
    role.welcome(connection, version=version)
    outcome = "closes" if trial.ends(connection) else "accepts"
    role.welcomes = role.offers_memory = role.replies = True
    trial.judge(outcome, f"welcome with version {version!r} on the {channel} channel")
    trial.expect(trial.comes_back(channel), "no-reconnect", "it did not come back afterwards")


def wordy_error(trial: ClientTrial, code: str, pointer: str, **members: object) -> bytes:
    """A packet with an `error` of the longest text, which has all that may be escaped, and is."""
    longest: int = LIMITS["max_message_chars"]
    text = (ODD_TEXT * longest)[:longest]
    message = error(code, message=text, pointer=pointer, **members)
    return packet(spell(message, Random(f"{code} {trial.seed}")).encode())


def outcome_of_closing(trial: ClientTrial, connection: Connection, code: str) -> str:
    """What the testee does after an `error` and the end that follows it (NEG-25)."""
    lose(trial, connection, code)
    if not connection.ended:
        return "hangs"
    return "closes" if trial.comes_back(connection.channel) else "hangs"


@check(
    "NEG-24",
    observable="the process lives, and the testee goes on or comes back after a pause",
    on={CLIENT: (*OPENS_HOST_MEMORY, "returns:ipc")},
    may_crash=True,
)
def check_survives_errors(trial: ClientTrial) -> None:
    """An error of each code, and of one that nobody knows, on both channels."""
    trial.role.offers_memory = False
    for code in trial.each(CODES, kind=kind_of_code):
        connection = trial.greeted("ipc")
        if code in CLOSING_ERRORS:
            outcome = outcome_of_closing(trial, connection, code)
        else:
            outcome = trial.outcome_on_ipc(connection, wordy_error(trial, code, "/"))
        trial.judge(outcome, f"an error {code} on the IPC channel")
    if trial.facts.asks and trial.facts.speaks_1_1("msg"):
        trial.role.offers_memory = True
        connection = asking(trial)
        trial.role.say(connection, error("internal"))
        trial.judge(trial.outcome_on_msg(connection), "an error in place of a reply")


@check(
    "NEG-24",
    observable="the process lives, and the testee goes on or comes back after a pause",
    on={CLIENT: ("hello:msg", "returns:msg")},
    may_crash=True,
)
def check_survives_errors_on_the_message_channel(trial: ClientTrial) -> None:
    """An error of each code that nothing asked for, with an id that no request had; then one in
    place of every reply, with the id of the request.
    """
    connection = trial.greeted("msg")
    for code in trial.each(CODES, kind=kind_of_code):
        gone = connection.ended or not connection.open
        connection = trial.greeted("msg") if gone else connection
        if code in CLOSING_ERRORS:
            outcome = outcome_of_closing(trial, connection, code)
        else:
            number = LIMITS["max_safe_integer"]
            connection.send(wordy_error(trial, code, "/position/x", id=number))
            outcome = trial.outcome_on_msg(connection)
        trial.judge(outcome, f"an error {code} on the message channel")
    trial.role.spoil = lambda reply: error("busy", **{n: reply[n] for n in ("id",) if n in reply})
    connection = trial.greeted("msg")
    trial.judge(trial.outcome_on_msg(connection), "errors in place of all replies")
