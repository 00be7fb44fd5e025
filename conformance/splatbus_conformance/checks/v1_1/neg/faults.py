"""Checks on `error`, and on which of several faults it is about (spec 1.1 section 2.5)."""

import time
from random import Random
from typing import NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.poses import BrokenPose, broken_poses
from splatbus_conformance.cases.valid.spelling import ODD_TEXT, spell
from splatbus_conformance.checks import (
    CLIENT,
    CLIENT_IPC,
    CLIENT_MSG,
    OPENS_HOST_MEMORY,
    SERVER,
    SERVER_IPC,
    SERVER_MSG,
    Cases,
    check,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.agreement import agreeing
from splatbus_conformance.trials.moves.control import controlling
from splatbus_conformance.trials.moves.exchanges.asking import asking
from splatbus_conformance.trials.moves.exchanges.exchange import STRANGER
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.moves.image_session import NARROW, errors_after, further, placed
from splatbus_conformance.trials.moves.losing import CODES, kind_of_code, lose
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.message_kinds import CLOSING_ERRORS, OTHER_ERRORS, REQUESTS
from splatbus_conformance.wire.messages import Json, camera_pose, encode, error, hello
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import WORDS, Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection

ON_EITHER = {SERVER_IPC: ("1.1",), SERVER_MSG: ("1.1",)}
ON_MSG = {SERVER: ("1.1",)}
GLANCE_SECONDS = 0.03
"""How long an IPC connection is listened to, where nothing can be asked."""
TOO_LONG = LIMITS["max_payload_bytes"] + 1
LENGTHS = {0: "malformed_packet", TOO_LONG: "packet_too_large", 2**32 - 1: "packet_too_large"}
"""That no packet may have, and what is said of each."""
IN_HEADERS = {f"a length of {it}": it.to_bytes(4, "little") for it in (0, TOO_LONG)}
IN_TEXT = {
    "a brace": b"{",
    "an array": b"[1]",
    "a number that is not finite": b'{"type":"camera_pose","timestamp":1e999}',
    "such a number with an odd name": b'{"type":"camera_pose","~":{"a/b~":1e999}}',
}
NO_ROTATION = camera_pose(rotation=(0.0, 0.0, 0.0, 2.0))
NO_TAG = camera_pose() | {"tag": ""}
NO_SIZE: Json = {"type": "set_viewport", "width": 0, "height": 48}
NOT_THERE = placed("no such object", AT_REST)
IN_MESSAGES: dict[Channel, dict[str, Json]] = {
    "msg": {
        "no type": {},
        "an unknown type": STRANGER,
        "a pose without members": {"type": "camera_pose"},
        "a rotation of norm 2": NO_ROTATION,
        "a position beyond single precision": camera_pose((1e39, 0.0, 0.0)),
        "a subscription on the message channel": {"type": "subscribe", "channels": []},
        "a request without cam_idx": {"type": "get_camera_pose", "id": 1},
        "a second hello": hello([]),
        "a tag without characters": NO_TAG,
        "intrinsics without members": camera_pose() | {"intrinsics": {}},
        "an object that is not there": NOT_THERE,
        "an object of no size": placed("default", AT_REST, 0.0),
        "a time that is no number": {"type": "set_time", "time": "now"},
        "a viewport without width": {"type": "set_viewport", "height": 48, "id": 2},
        "a ping without t": {"type": "ping", "id": 3},
        "telemetry of everything": {"type": "subscribe_telemetry", "names": "all"},
    },
    "ipc": {
        "an unknown type": STRANGER,
        "opened without generation": {"type": "opened"},
        "opened of another generation": {"type": "opened", "generation": 2**40},
        "release of what is not held": {"type": "release", "generation": 1, "seq": 2**40},
        "subscribe to smells": {"type": "subscribe", "channels": ["smell"]},
        "a pose on the IPC channel": camera_pose(),
        "a second hello": hello(["host_shm"]),
    },
}


def faults(channel: Channel) -> dict[str, bytes]:
    """What is wrong, and in which packet, of texts and of messages."""
    written = {what: encode(message) for what, message in IN_MESSAGES[channel].items()}
    return {what: packet(payload) for what, payload in (IN_TEXT | written).items()}


@check("NEG-22", on={SERVER_IPC: (), SERVER_MSG: ()})
def check_reports_nothing_before_hello(trial: ServerTrial, channel: Channel) -> None:
    """Every fault that a server may report later, and a `hello` that nobody can read."""
    scripts = {"half a hello": packet(encode(hello([]))[:-1])} | faults(channel) | IN_HEADERS
    del scripts["a second hello"]
    for what, script in trial.each(list(scripts.items())):
        connection = trial.before_hello(channel)
        dealings = trial.with_(connection)
        connection.send(script)
        if trial.facts.welcome[channel] is not None:  # its answer to hello comes after all else
            trial.viewer.greet(connection, capabilities=[])
            trial.is_welcomed(connection)
        elif channel == "msg":
            trial.answers(connection)
        else:
            trial.wait(dealings.errors, GLANCE_SECONDS)
        errors = dealings.errors()
        told = f"{channel}: {what}: error {', '.join(errors)} before hello"
        trial.expect(not errors, "before-hello", told)
        connection.close()
    trial.expect(trial.serves(), "not-served", "a new connection is not served")


OF_NO_REQUEST = [
    IN_TEXT["a brace"],
    *(encode(it) for it in IN_MESSAGES["msg"].values() if it.get("type") not in REQUESTS),
    encode(NO_ROTATION | {"id": 9}),
]


@check("NEG-23", on=ON_MSG)
def check_errors_about_no_request_name_none(trial: ServerTrial) -> bool:
    """Faults in what is no request, behind a request that has an id: a client would take an error
    with that for the answer to its request.
    """
    seen = False
    for payload in trial.each(OF_NO_REQUEST):
        connection = agreeing(trial, "msg")
        trial.answers(connection)  # a request with an id
        for came in errors_after(trial, connection, payload)[0]:
            told = f"{shorten(repr(payload))} was answered by the error {show(came)}"
            trial.expect("id" not in came, "has-an-id", f"{told}, which has the id of a request")
            seen = True
    return seen or trial.not_observable("the server sends no error about what is no request")


@check(
    "NEG-24",
    on={
        CLIENT_IPC: (*OPENS_HOST_MEMORY, "returns:ipc"),
        CLIENT_MSG: ("hello:msg", "returns:msg"),
    },
    cases=Cases(CODES, kind=kind_of_code),
    may_crash=True,
)
def check_survives_errors(trial: ClientTrial, channel: Channel, code: str) -> None:
    """An error of each code that nothing asked for, and of one that nobody knows: of the longest
    text, which has all that may be escaped, and is, and with an id that no request had.
    """
    connection = agreeing(trial, channel)
    if code in CLOSING_ERRORS:  # the end follows it (NEG-25)
        lose(trial, connection, code)
        outcome = "closes" if connection.ended and trial.comes_back(channel) else "hangs"
    else:
        text = (ODD_TEXT * LIMITS["max_message_chars"])[: LIMITS["max_message_chars"]]
        pointer = "/position/x" if channel == "msg" else "/"
        members = {"id": LIMITS["max_safe_integer"]} if channel == "msg" else {}
        message = error(code, message=text, pointer=pointer, **members)
        spelled = spell(message, Random(f"{code} {trial.seed}")).encode()
        outcome = trial.outcome(connection, packet(spelled))
    trial.judge(outcome, f"an error {code} on the {WORDS[channel]} channel")


@check("NEG-24", on={CLIENT: ("hello:msg", "returns:msg")}, may_crash=True)
def check_survives_errors_in_place_of_replies(trial: ClientTrial) -> None:
    """An error in place of every reply, with the id of the request; then one without."""
    trial.role.spoil = lambda reply: error("busy", **{n: reply[n] for n in ("id",) if n in reply})
    outcome = trial.outcome_on_msg(trial.greeted("msg"))
    trial.judge(outcome, "errors in place of all replies")
    if trial.facts.asks:
        connection = asking(trial)
        trial.role.say(connection, error("internal"))
        trial.judge(trial.outcome_on_msg(connection), "an error in place of a reply")


@check("NEG-25", on=ON_EITHER, may_crash=True)
def check_closes_after_an_error_that_ends(trial: ServerTrial, channel: Channel) -> bool:
    """Headers that break FRM-2, and a version that nobody speaks; judged where an error comes."""
    errors = 0

    def judge(connection: Connection, what: str) -> None:
        nonlocal errors
        dealings = trial.with_(connection)
        trial.wait(lambda: dealings.errors() or connection.ended)
        codes = [code for code in dealings.errors() if code in CLOSING_ERRORS]
        if codes:
            outcome = "closes" if trial.ends(connection) else "waits"
            trial.judge(outcome, f"{channel}: {what}, {codes[0]}")
        connection.close()
        errors += len(codes)

    for what, script in trial.each(list(IN_HEADERS.items())):
        connection = trial.greeted(channel)
        connection.send(script)
        judge(connection, what)
    judge(trial.answered(channel, versions=["4000.0"])[0], "a hello of another version")
    return errors > 0 or trial.not_observable("the server sends no error after which it closes")


@check("NEG-34", on=ON_MSG)
def check_ends_in_good_order(trial: ServerTrial) -> None:
    """Clients send much after what an error answers that ends: all of them read the error, then the
    end, and the server goes on reading; not for ever, though, where they do not end their side.
    """
    lingering: list[Connection] = []
    for channel in trial.each(CHANNELS):
        wrong = hello(trial.viewer.capabilities[channel], trial.viewer.token)
        for _ in range(IN_TIME):
            connection = trial.before_hello(channel)
            until = time.monotonic() + LIMITS["last_words_least_seconds"]
            connection.send(packet(encode(wrong | {"versions": ["4000.0"]})) + AFTERWARDS)
            trial.ends(connection)
            if not connection.ended or time.monotonic() < until:  # until then the server reads on
                break
        else:
            continue
        codes = trial.with_(connection).errors()
        what = f"{channel}: a hello of another version, and {len(AFTERWARDS):,} bytes after it"
        if not (codes or connection.ended == "reset"):
            continue
        code = "reset" if connection.ended else "not-closed"
        told = f"{what}: the connection was {connection.ended}"
        trial.expect(connection.ended == "eof", code, told)
        for _ in range(3):
            reads = connection.push(b" " * 1024) is not None or time.monotonic() > until
            trial.rest(GLANCE_SECONDS)
            told = f"{what}: after the error the server reads no more, and resets the connection"
            trial.expect(reads, "stops-reading", told)
        lingering.append(connection)
    if not lingering:
        trial.not_observable("no error after which the server closes came, or none in time")
    if trial.profile != "brief":
        gone = trial.wait(
            lambda: all(it.push(b" ") is None for it in lingering), LAST_WORDS_SECONDS
        )
        what = f"{LAST_WORDS_SECONDS:g} s after the error the server still reads what a client says"
        trial.expect(gone, "reads-on", f"{what} that does not end its side")


LAST_WORDS_SECONDS: float = LIMITS["last_words_seconds"] + LIMITS["close_seconds"]
IN_TIME = 4
"""Tries to learn of the end while the server still reads: a busy machine makes the harness late."""
AFTERWARDS = packet(encode(VIEWPORT_REQUEST)) * 8000
OF_ANOTHER = "a pose of a second client"
MANY = 200
"""Messages that are wrong, of a client that is of a later version, say."""


@check("NEG-26", on=ON_EITHER)
def check_goes_on_after_an_error(trial: ServerTrial, channel: Channel) -> bool:
    """Faults in texts and messages, the same again and again, and poses of a second client, which
    may be told `busy`; judged where an error comes that ends no connection.
    """
    errors = 0
    scripts = faults(channel) | {f"{MANY} unknown types": packet(encode(STRANGER)) * MANY}
    if channel == "msg":
        scripts[OF_ANOTHER] = packet(encode(camera_pose()))
    for what, script in trial.each(list(scripts.items())):
        if what == OF_ANOTHER:
            trial.move()
        connection = trial.ready(channel)
        outcome = trial.outcome(connection, script)
        codes = [it for it in trial.with_(connection).errors() if it in OTHER_ERRORS]
        told = f"{channel}: {what}: {len(codes)} errors, {', '.join(dict.fromkeys(codes))}"
        trial.expect(
            outcome in ("ignores", "reports", "replies") or not codes,
            "no-longer-served",
            f"{told}, then the connection did not go on",
        )
        connection.close()
        errors += len(codes)
    return errors > 0 or trial.not_observable("the server sends no error that ends no connection")


@check(
    "NEG-32",
    on=ON_MSG,
    cases=Cases([it for it in broken_poses(camera_pose()) if it.requirement == "POS-3"]),
)
def check_reports_what_is_no_rotation(trial: ServerTrial, broken: BrokenPose) -> None:
    """Poses whose quaternions have norms from 0 to 1e200, and none within 0.01 of 1."""
    connection = agreeing(trial, "msg")
    dealings = trial.with_(connection)
    before = len(dealings.errors())
    outcome = trial.outcome(connection, packet(broken.payload))
    outcome = "ignores" if outcome == "reports" else outcome  # something else than it should
    codes = dealings.errors()[before:]
    told = f"a pose with {broken.what}: {', '.join(codes) or 'no error'}"
    trial.judge("reports" if codes == ["invalid_rotation"] else outcome, told)


class TwoFaults(NamedTuple):
    """A message that is wrong in itself, or in what it names, and that nobody may send here."""

    what: str
    message: Json
    codes: tuple[str, ...]
    """Of an error about the fault that is looked at first."""
    needs: str = ""
    """A capability without which there is one fault only, or another; none if empty."""


OF_FORM = ("invalid_message", "invalid_number", "invalid_rotation")
UNGRANTED = [
    TwoFaults(what, message, ("unsupported", "unknown_type"))
    for what, message in {
        "a size that is none": NO_SIZE,
        "a ping without a number": {"type": "ping", "t": "now"},
        "an object of no size": placed("default", AT_REST, 0.0),
        "an object that is not there": NOT_THERE,
        "a time that is none": {"type": "set_time", "time": "now"},
        "names that are none": {"type": "subscribe_telemetry", "names": "all"},
    }.items()
]
BESIDE_WHO_HAS_CONTROL = (
    TwoFaults("no rotation", NO_ROTATION, OF_FORM),
    TwoFaults("a tag that is none", NO_TAG, OF_FORM),
    TwoFaults(
        "a lens of another shape", camera_pose() | {"intrinsics": NARROW}, OF_FORM, "intrinsics"
    ),
    TwoFaults("an object that is not there", NOT_THERE, ("unknown_object",), "objects"),
    TwoFaults("a size that is none", NO_SIZE, OF_FORM, "viewport"),
)


def judge_the_first(
    trial: ServerTrial, connection: Connection, faults: TwoFaults, where: str
) -> bool:
    """An error, if one comes, is about the fault that is looked at first. Whether the testee has
    come to the end of the message.
    """
    errors, answered = errors_after(trial, connection, encode(faults.message))
    for told in errors:
        what = f"{faults.what}, {where}, was answered by the error {show(told.get('code'))}"
        trial.expect(told.get("code") in faults.codes, "later-fault", what)
    return answered


@check("NEG-36", on=ON_MSG, cases=Cases(UNGRANTED))
def check_looks_at_the_capability_before_the_form(trial: ServerTrial, faults: TwoFaults) -> bool:
    """What belongs to no capability that was agreed upon."""
    connection = trial.greeted("msg", capabilities=[])
    taken = judge_the_first(trial, connection, faults, "on a connection that agreed on nothing")
    connection.close()
    return taken


@check(
    "NEG-36",
    on=ON_MSG,
    given=lambda trial: further(trial, controlling(trial)),
    cases=lambda trial, connection: Cases(
        [it for it in BESIDE_WHO_HAS_CONTROL if not it.needs or trial.facts.grants(it.needs)]
    ),
)
def check_looks_at_control_last(
    trial: ServerTrial, connection: Connection, faults: TwoFaults
) -> bool:
    """A client that has no control, beside one that has."""
    return judge_the_first(trial, connection, faults, "beside a client that has control")


@check("NEG-36", on=ON_EITHER, cases=Cases(list(LENGTHS.items())))
def check_says_what_is_wrong_with_a_length(
    trial: ServerTrial, channel: Channel, case: tuple[int, str]
) -> bool:
    """Headers of too much and of nothing, after `hello`; judged where an error comes."""
    length, code = case
    connection = trial.greeted(channel)
    connection.send(length.to_bytes(4, "little"))
    dealings = trial.with_(connection)
    trial.wait(lambda: dealings.errors() or connection.ended)
    for told in dealings.errors():
        what = f"{channel}: a length of {length} was answered by {show(told)}"
        trial.expect(told == code, "another-code", what)
    connection.close()
    return bool(dealings.errors())


@check("NEG-38", on=ON_EITHER, cases=Cases(([], ["4000.0", "1.1"], ["1.0"])))
def check_answers_no_further_hello(
    trial: ServerTrial, channel: Channel, versions: list[str]
) -> None:
    """A second hello, which lists no capabilities, and other versions, or none: what was agreed
    upon goes on.
    """
    connection = trial.ready(channel)
    dealings = trial.with_(connection)
    before = len(dealings.heard)
    message = hello([], trial.viewer.token) | {"versions": versions}
    outcome = trial.outcome(connection, packet(encode(message)))
    told = [it for it in dealings.heard[before:] if it.get("type") in ("error", "welcome")]
    codes = [it.get("code", "a welcome") for it in told]
    what = f"{channel}: a second hello, with {show(versions)}: {', '.join(codes) or 'no error'}"
    first, *later = codes or ["invalid_message"]
    trial.expect(first == "invalid_message", "another-answer", what)
    trial.expect(not later, "agreed-anew", f"{what}, to what was agreed upon before")
    trial.judge(outcome, what)
    if "ping" in dealings.granted:
        reply = trial.ask(connection, {"type": "ping", "t": 1.0, "id": 5}) or {}
        trial.expect(reply.get("type") == "pong", "agreed-anew", f"{what}; then no pong came")
    connection.close()
