"""Checks on `error`, and on requests after `hello` (spec 1.1 sections 2.5 and 2.6)."""

from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.poses import broken_poses
from splatbus_conformance.checks import SERVER, SERVER_IPC, SERVER_MSG, Cases, check
from splatbus_conformance.checks.v1_1.neg.servers import refused
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.moves.image_session import placed
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.message_kinds import CLOSING_ERRORS, OTHER_ERRORS
from splatbus_conformance.wire.messages import Json, camera_pose, encode, hello
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection


class FaultyMessage(NamedTuple):
    """Something wrong to send."""

    channel: Channel
    what: str
    script: bytes


def said(channel: Channel, what: str, message: Json) -> FaultyMessage:
    """A fault in a message."""
    return FaultyMessage(channel, what, packet(encode(message)))


GLANCE_SECONDS = 0.03
"""How long an IPC connection is listened to, where nothing can be asked."""
FOR_THE_HEADER = {
    "a header that announces nothing": 0,
    "a header beyond the limit": LIMITS["max_payload_bytes"] + 1,
}
IN_HEADERS = [
    FaultyMessage(channel, what, length.to_bytes(4, "little"))
    for channel in ("msg", "ipc")
    for what, length in FOR_THE_HEADER.items()
]
IN_TEXT = [
    FaultyMessage(channel, what, packet(payload))
    for channel in ("msg", "ipc")
    for what, payload in {
        "a brace": b"{",
        "an array": b"[1]",
        "a number that is not finite": b'{"type":"camera_pose","timestamp":1e999}',
        "such a number with an odd name": b'{"type":"camera_pose","~":{"a/b~":1e999}}',
    }.items()
]
IN_MESSAGES = [
    said("msg", "no type", {}),
    said("msg", "an unknown type", {"type": "weather_report"}),
    said("msg", "a pose without members", {"type": "camera_pose"}),
    said("msg", "a rotation of norm 2", camera_pose(rotation=(0.0, 0.0, 0.0, 2.0))),
    said("msg", "a position beyond single precision", camera_pose((1e39, 0.0, 0.0))),
    said("msg", "a subscription on the message channel", {"type": "subscribe", "channels": []}),
    said("msg", "a request without cam_idx", {"type": "get_camera_pose", "id": 1}),
    said("msg", "a second hello", hello([])),
    said("msg", "a tag without characters", camera_pose() | {"tag": ""}),
    said("msg", "intrinsics without members", camera_pose() | {"intrinsics": {}}),
    said("msg", "an object that is not there", placed("no such object", AT_REST)),
    said("msg", "an object of no size", placed("default", AT_REST, 0.0)),
    said("msg", "a time that is no number", {"type": "set_time", "time": "now"}),
    said("msg", "a viewport without width", {"type": "set_viewport", "height": 48, "id": 2}),
    said("msg", "a ping without t", {"type": "ping", "id": 3}),
    said("msg", "telemetry of everything", {"type": "subscribe_telemetry", "names": "all"}),
    said("ipc", "an unknown type", {"type": "weather_report"}),
    said("ipc", "opened without generation", {"type": "opened"}),
    said("ipc", "opened of another generation", {"type": "opened", "generation": 2**40}),
    said("ipc", "release of what is not held", {"type": "release", "generation": 1, "seq": 2**40}),
    said("ipc", "subscribe to smells", {"type": "subscribe", "channels": ["smell"]}),
    said("ipc", "a pose on the IPC channel", camera_pose()),
    said("ipc", "a second hello", hello(["host_shm"])),
]


@check("NEG-22", on={SERVER: ()}, observable="what a server says to faults before hello")
def check_reports_nothing_before_hello(trial: ServerTrial) -> None:
    """Every fault that a server may report later, and a `hello` that nobody can read."""
    broken = packet(encode(hello([]))[:-1])
    faults = [*IN_TEXT, *IN_MESSAGES, *IN_HEADERS]
    unread = [
        FaultyMessage("msg", "half a hello", broken),
        FaultyMessage("ipc", "half a hello", broken),
    ]
    for channel, what, script in trial.each(listed=[f for f in unread + faults if no_hello(f)]):
        connection = trial.before_hello(channel)
        dealings = trial.viewer.with_(connection)
        connection.send(script)
        if trial.facts.welcome[channel] is not None:  # its answer to hello comes after all else
            trial.viewer.greet(connection, capabilities=[])
            handled = trial.is_welcomed(connection) or connection.ended is not None
        elif channel == "msg":
            handled = trial.answers(connection) or connection.ended is not None
        else:
            handled = not trial.wait(dealings.errors, GLANCE_SECONDS)
        errors = dealings.errors()
        trial.expect(
            not errors, "before-hello", f"{channel}: {what}: error {', '.join(errors)} before hello"
        )
        trial.delivered += handled
        connection.close()
    trial.expect(trial.serves(), "not-served", "a new connection is not served")


def no_hello(fault: FaultyMessage) -> bool:
    """Whether a connection on which this was said has still said no hello."""
    return fault.what != "a second hello"


@check(
    "NEG-25",
    observable="the end of the connection after an error",
    on={SERVER: ("1.1",)},
    may_crash=True,
)
def check_closes_after_an_error_that_ends(trial: ServerTrial) -> None:
    """Headers that break FRM-2, and a version that nobody speaks; judged where an error comes."""
    errors = 0
    for channel, what, script in trial.each(listed=IN_HEADERS):
        connection = trial.greeted(channel)
        connection.send(script)
        errors += ends_it(trial, connection, what)
    for channel in CHANNELS:
        connection, _ = trial.answered(channel, versions=["4000.0"])
        errors += ends_it(trial, connection, "a hello of another version")
    if not errors:
        trial.not_observable("the server sends no error after which it closes")
    trial.delivered += errors


def ends_it(trial: ServerTrial, connection: Connection, what: str) -> bool:
    """Whether an error comes that ends a connection, which has to end it."""
    dealings = trial.viewer.with_(connection)
    trial.wait(lambda: dealings.errors() or connection.ended)
    codes = [code for code in dealings.errors() if code in CLOSING_ERRORS]
    if codes:
        outcome = "closes" if trial.ends(connection) else "waits"
        trial.judge(outcome, f"{connection.channel}: {what}, {codes[0]}")
    connection.close()
    return bool(codes)


@check("NEG-34", observable="the error, the end after it, and no reset", on={SERVER: ("1.1",)})
def check_ends_in_good_order(trial: ServerTrial) -> None:
    """Clients send much after what an error answers that ends: all of them read the error, then the
    end, and the server goes on reading; not for ever, though, where they do not end their side.
    """
    lingering: list[Connection] = []
    for channel in trial.each(CHANNELS):
        connection = trial.before_hello(channel)
        dealings = trial.viewer.with_(connection)
        wrong = hello(trial.viewer.capabilities[channel], trial.viewer.token)
        connection.send(packet(encode(wrong | {"versions": ["4000.0"]})) + AFTERWARDS)
        trial.ends(connection)
        codes = dealings.errors()
        what = f"{channel}: a hello of another version, and {len(AFTERWARDS):,} bytes after it"
        if not (codes or connection.ended == "reset"):
            continue
        code = "reset" if connection.ended else "not-closed"
        trial.expect(
            connection.ended == "eof", code, f"{what}: the connection was {connection.ended}"
        )
        for _ in range(3):
            taken = connection.push(b" " * 1024)
            trial.rest(GLANCE_SECONDS)
            told = f"{what}: after the error the server reads no more, and resets the connection"
            trial.expect(taken is not None, "stops-reading", told)
        lingering.append(connection)
    if not lingering:
        trial.not_observable("the server sends no error after which it closes")
    if trial.profile != "brief":
        gone = trial.wait(
            lambda: all(it.push(b" ") is None for it in lingering), LAST_WORDS_SECONDS
        )
        what = f"{LAST_WORDS_SECONDS:g} s after the error the server still reads what a client says"
        trial.expect(gone, "reads-on", f"{what} that does not end its side")
    trial.delivered += len(lingering)


LAST_WORDS_SECONDS: float = LIMITS["last_words_seconds"] + LIMITS["close_seconds"]
AFTERWARDS = packet(encode(VIEWPORT_REQUEST)) * 8000


BAD_MEMBERS: dict[str, tuple[Any, ...]] = {
    "versions": (
        None,
        [],
        "1.1",
        [1.1],
        ["1.1"] * 17,
        ["1.01"],
        ["01.1"],
        ["1.1", "v" * 65],
        ["1.1\n"],
        ["1.1 "],
        ["١.١"],
    ),
    "client": (None, "me", {"name": "me"}, {"name": 1, "version": "1"}),
    "capabilities": (None, {}, [1], ["a", "a"], ["c" * 65], "frames"),
}
BROKEN_HELLOS: tuple[Json, ...] = tuple(
    {name: value} for name, values in BAD_MEMBERS.items() for value in values
)
"""Members that are wrong; None leaves one out."""


@check(
    "NEG-35",
    observable="the error, and the end of the connection",
    on={SERVER_IPC: ("1.1",), SERVER_MSG: ("1.1",)},
    cases=Cases(BROKEN_HELLOS),
)
def check_refuses_broken_hellos(trial: ServerTrial, channel: Channel, changes: Json) -> None:
    """Objects of type `hello` that miss or mistype members."""
    what = f"{channel}: a hello with {show(changes)}"
    connection, _ = refused(trial, channel, "invalid_message", what, **changes)
    trial.judge("closes" if trial.ends(connection) else "waits", what)
    connection.close()
    trial.delivered += 1


@check("NEG-26", observable="the connection goes on after an error", on={SERVER: ("1.1",)})
def check_goes_on_after_an_error(trial: ServerTrial) -> None:
    """Faults in texts and messages, the same again and again, and poses of a second client, which
    may be told `busy`; judged where an error comes.
    """
    errors = 0
    for channel, what, script in trial.each(listed=[*IN_TEXT, *IN_MESSAGES]):
        errors += goes_on(trial, trial.ready(channel), what, script)
    trial.move()
    pose = packet(encode(camera_pose()))
    errors += goes_on(trial, trial.greeted("msg"), "a pose of a second client", pose)
    for channel in CHANNELS:
        again = packet(encode({"type": "weather_report"})) * MANY
        errors += goes_on(trial, trial.ready(channel), f"{MANY} unknown types", again)
    if not errors:
        trial.not_observable("the server sends no error after which a connection goes on")


def goes_on(trial: ServerTrial, connection: Connection, what: str, script: bytes) -> int:
    """How many errors come of a script that end no connection, which has to go on then."""
    outcome = trial.outcome(connection, script)
    codes = [it for it in trial.viewer.with_(connection).errors() if it in OTHER_ERRORS]
    told = f"{connection.channel}: {what}: {len(codes)} errors, {', '.join(dict.fromkeys(codes))}"
    trial.expect(
        outcome in ("ignores", "reports", "replies") or not codes,
        "no-longer-served",
        f"{told}, then the connection did not go on",
    )
    connection.close()
    return len(codes)


MANY = 200
"""Messages that are wrong, of a client that is of a later version, say."""


@check("NEG-32", observable="the error that a rotation is answered with", on={SERVER: ("1.1",)})
def check_reports_what_is_no_rotation(trial: ServerTrial) -> None:
    """Poses whose quaternions have norms from 0 to 1e200, and none within 0.01 of 1."""
    connection = trial.ready("msg")
    for each in trial.each([it for it in broken_poses(camera_pose()) if it.requirement == "POS-3"]):
        if connection.ended:
            connection = trial.ready("msg")
        before = len(trial.viewer.with_(connection).errors())
        outcome = trial.outcome(connection, packet(each.payload))
        codes = trial.viewer.with_(connection).errors()[before:]
        told = f"a pose with {each.what}: {', '.join(codes) or 'no error'}"
        trial.judge("reports" if codes == ["invalid_rotation"] else outcome_of(outcome), told)


def outcome_of(outcome: str) -> str:
    """The same, but of a server that did not report what it should have."""
    return "ignores" if outcome == "reports" else outcome
