"""Checks on what is looked at first, and on a `hello` that comes again (spec 1.1 chapter 2)."""

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, SERVER_IPC, SERVER_MSG, Cases, check
from splatbus_conformance.checks.v1_1.neg.tokens import with_token
from splatbus_conformance.trials.moves.control import controlling
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.moves.image_session import NARROW, errors_after, further, placed
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import Json, camera_pose, encode, hello
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection

OF_FORM = ("invalid_message", "invalid_number", "invalid_rotation")
UNGRANTED = ("unsupported", "unknown_type")
NO_ROTATION = camera_pose(rotation=(0.0, 0.0, 0.0, 2.0))


LENGTHS = {
    0: "malformed_packet",
    LIMITS["max_payload_bytes"] + 1: "packet_too_large",
    2**32 - 1: "packet_too_large",
}
"""That no packet may have, and what is said of each."""


class TwoFaults(NamedTuple):
    """A message that is wrong in two ways.

    Attributes:
        what: they are.
        message: that has them.
        codes: of an error about the one that is looked at first.
        needs: a capability without which there is one fault only, or another; none if empty.
    """

    what: str
    message: Json
    codes: tuple[str, ...]
    needs: str = ""


BESIDE_NO_CAPABILITY: tuple[tuple[str, Json], ...] = (
    ("a size that is none", {"type": "set_viewport", "width": 0, "height": 48}),
    ("a ping without a number", {"type": "ping", "t": "now"}),
    ("an object of no size", placed("default", AT_REST, 0.0)),
    ("an object that is not there", placed("no such object", AT_REST)),
    ("a time that is none", {"type": "set_time", "time": "now"}),
    ("names that are none", {"type": "subscribe_telemetry", "names": "all"}),
)
"""What is wrong with a message, beside that its capability was not agreed upon."""
BESIDE_WHO_HAS_CONTROL = (
    TwoFaults("no rotation", NO_ROTATION, OF_FORM),
    TwoFaults("a tag that is none", camera_pose() | {"tag": ""}, OF_FORM),
    TwoFaults("a lens of another shape", camera_pose() | {"intrinsics": NARROW}, OF_FORM,
              "intrinsics"),
    TwoFaults("an object that is not there", placed("no such object", AT_REST),
              ("unknown_object",), "objects"),
    TwoFaults("a size that is none", {"type": "set_viewport", "width": 0, "height": 48}, OF_FORM,
              "viewport"),
)  # fmt: skip
"""The other fault is that another client has control."""
WITHOUT_THE_TOKEN: list[tuple[Json, str]] = [
    ({"client": None}, "invalid_message"),
    ({"versions": ["4000.0"]}, "unauthorized"),
]
"""What is changed in a hello, and the code of the fault that is looked at first."""


@check(
    "NEG-36",
    observable="the code of the error that comes of two faults",
    on={SERVER: ("1.1",)},
    cases=Cases(BESIDE_NO_CAPABILITY),
)
def check_looks_at_the_capability_before_the_form(
    trial: ServerTrial, case: tuple[str, Json]
) -> None:
    """What is wrong in itself, or in what it names, and belongs to no capability that was agreed
    upon.
    """
    connection = trial.greeted("msg", capabilities=[])
    faults = TwoFaults(*case, UNGRANTED)
    expect_the_first(trial, connection, faults, "on a connection that agreed on nothing")
    connection.close()


@contextmanager
def beside_control(trial: ServerTrial) -> Iterator[Connection]:
    """A client, where another has control."""
    yield further(trial, controlling(trial))


@check(
    "NEG-36",
    observable="the code of the error that comes of two faults",
    on={SERVER: ("1.1",)},
    given=beside_control,
    cases=lambda trial, connection: Cases(
        [it for it in BESIDE_WHO_HAS_CONTROL if not it.needs or trial.facts.grants(it.needs)]
    ),
)
def check_looks_at_control_last(
    trial: ServerTrial, connection: Connection, faults: TwoFaults
) -> None:
    """What is wrong in itself, or in what it names, of a client that has no control."""
    expect_the_first(trial, connection, faults, "beside a client that has control")


def expect_the_first(
    trial: ServerTrial, connection: Connection, faults: TwoFaults, where: str
) -> None:
    """An error, if one comes, is about the fault that is looked at first."""
    for error in errors_after(trial, connection, encode(faults.message))[0]:
        told = f"{faults.what}, {where}, was answered by the error {show(error.get('code'))}"
        trial.expect(error.get("code") in faults.codes, "later-fault", told)
        trial.delivered += 1


def codes_of(trial: ServerTrial, connection: Connection) -> list[str]:
    """The codes of the errors that come before the connection ends, or in time."""
    dealings = trial.viewer.with_(connection)
    trial.wait(lambda: dealings.errors() or connection.ended)
    return dealings.errors()


@check("NEG-36", observable="the code of the error that answers a header", on={SERVER: ("1.1",)})
def check_says_what_is_wrong_with_a_length(trial: ServerTrial) -> None:
    """Headers of too much and of nothing, after `hello`; judged where an error comes."""
    for channel, (length, code) in trial.each(itertools.product(CHANNELS, LENGTHS.items())):
        connection = trial.greeted(channel)
        connection.send(length.to_bytes(4, "little"))
        for told in codes_of(trial, connection):
            what = f"{channel}: a length of {length} was answered by {show(told)}"
            trial.expect(told == code, "another-code", what)
            trial.delivered += 1
        connection.close()
    if not trial.delivered:
        trial.not_observable("the server says nothing of a length that is none")


@check("NEG-36", observable="the code of the error that comes of two faults", on={SERVER: ("1.1",)})
def check_looks_at_a_hello_in_order(trial: ServerTrial) -> None:
    """Without the token: a hello without `client`, and one of a version that nobody speaks."""
    with with_token(trial):
        for changes, code in trial.each(WITHOUT_THE_TOKEN):
            connection, answer = trial.answered("msg", token=None, **changes)
            found = (answer or {}).get("code")
            told = f"a hello without the token and with {show(changes)} was answered by"
            trial.expect(found == code, "later-fault", f"{told} {show(found)}")
            trial.delivered += 1
            connection.close()


@check(
    "NEG-38",
    observable="that what was agreed upon goes on, and no welcome comes",
    on={SERVER_IPC: ("1.1",), SERVER_MSG: ("1.1",)},
    cases=Cases(([], ["4000.0", "1.1"], ["1.0"])),
)
def check_answers_no_further_hello(
    trial: ServerTrial, channel: Channel, versions: list[str]
) -> None:
    """A second hello, which lists no capabilities, and other versions, or none."""
    connection = trial.ready(channel)
    dealings = trial.viewer.with_(connection)
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
