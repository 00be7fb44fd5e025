"""Checks on what a client says to a server of 1.0 (spec 1.1 section 2.3)."""

from typing import NamedTuple

from splatbus_conformance.checks import CLIENT, CLIENT_IPC, CLIENT_MSG, Cases, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.reading import answer_all
from splatbus_conformance.trials.moves.listening import heard, listen
from splatbus_conformance.wire.message_kinds import newer
from splatbus_conformance.wire.messages import welcome
from splatbus_conformance.wire.recording import WORDS, Channel
from splatbus_conformance.wire.sockets import Connection


class Fallen(NamedTuple):
    """A connection whose server has shown to speak 1.0."""

    connection: Connection
    said: int
    """How many objects the testee had sent before: what they are is left to NEG-5."""


def fall_back(trial: ClientTrial, channel: Channel) -> Fallen:
    """Play a server that knows no `hello`: it offers memory at once, or answers requests, once the
    testee has said what it says unasked.
    """
    trial.role.speaks, trial.role.replies = "1.0", False
    if channel == "ipc":
        return Fallen(trial.connection(channel), 0)
    trial.role.has_image = False  # who waits for images asks on (REQ-12)
    connection = trial.connection(channel)
    dealings = trial.with_(connection)
    if not trial.wait(lambda: dealings.count("get_viewport_size")):
        trial.not_observable("the testee does not ask for the size after hello")
    listen(trial, connection)
    before = len(dealings.heard)
    trial.role.replies = True
    answer_all(trial, connection)
    return Fallen(connection, before)


def beyond_1_0(trial: ClientTrial, fallen: Fallen) -> list[str]:
    """Listen to the testee; the types of what it has said that 1.0 does not know there."""
    connection, before = fallen
    dealings = trial.with_(connection)
    if connection.channel == "ipc":
        listen(trial, connection)
        return sorted(heard(trial, connection) - {"hello"})
    if trial.facts.poses:  # which show that it has run since
        trial.grows(connection, dealings.heard, len(dealings.heard) + 1)
    listen(trial, connection)
    return sorted(set().union(*map(newer, dealings.heard[before:])))


@check(
    "NEG-13",
    on={CLIENT: ("hello:msg",)},
)
def check_falls_back_on_the_message_channel(trial: ClientTrial) -> None:
    """A server that knows no hello answers get_viewport_size, once the testee has said what it
    says unasked; the testee is listened to.
    """
    fallen = fall_back(trial, "msg")
    more = ", ".join(beyond_1_0(trial, fallen))
    trial.expect(not fallen.connection.ended, "closes", "it closed the connection to a 1.0 server")
    trial.expect(not more, "newer-version", f"it sent {more} to a 1.0 server")


@check(
    "NEG-14",
    on={CLIENT: ("hello:ipc",)},
)
def check_falls_back_on_the_ipc_channel(trial: ClientTrial) -> bool:
    """A server that knows no hello sends its init packet at once; the testee is listened to, and
    again when the server has gone.
    """
    fallen = fall_back(trial, "ipc")
    connection = fallen.connection
    said_hello = trial.says_hello(connection)
    for moment in ("", " that has gone"):
        if moment:
            connection.end_stream()
            trial.ends(connection)
        more = ", ".join(beyond_1_0(trial, fallen))
        trial.expect(not more, "newer-version", f"it sent {more} to a 1.0 server{moment}")
        if connection.ended and not moment:
            trial.not_observable("the testee closed the connection to a 1.0 server")
    return said_hello and connection.ended is not None


@check(
    "NEG-40",
    on={CLIENT_IPC: ("hello:ipc",), CLIENT_MSG: ("hello:msg",)},
    cases=Cases(("1.1", "9.9")),
)
def check_ignores_a_late_welcome(trial: ClientTrial, channel: Channel, version: str) -> None:
    """A server that has shown to speak 1.0 says `welcome` after all, to the version that the
    testee wants or to one that it did not list; on the IPC channel, memory of 1.1 follows it.
    """
    fallen = fall_back(trial, channel)
    connection, _ = fallen
    if not trial.says_hello(connection):
        trial.not_observable(f"the testee said no hello on the {WORDS[channel]} channel")
    if beyond_1_0(trial, fallen) or connection.ended:
        trial.not_observable("the testee does not go on with a 1.0 server")
    trial.role.say(connection, welcome(channel, trial.facts.capabilities(channel), version))
    if channel == "ipc":
        trial.role.offer(connection)
    more = ", ".join(beyond_1_0(trial, fallen))
    what = f"a late welcome to {version!r} on the {WORDS[channel]} channel"
    trial.expect(not more, "newer-version", f"it sent {more} after {what}")
    trial.judge(trial.end_of(connection) if connection.ended else "ignores", what)


@check(
    "NEG-39",
    on={CLIENT: ("hello:msg", "returns:msg")},
)
def check_asks_for_the_size_after_hello(trial: ClientTrial) -> None:
    """A server that says nothing to `hello` is listened to by a testee that declares capabilities
    of the message channel.
    """
    if not trial.facts.capabilities("msg"):
        trial.not_observable("the testee wants no more than 1.0 defines, by what it declares")
    trial.role.speaks, trial.role.replies = "1.0", False
    connection = trial.connection("msg")
    dealings = trial.with_(connection)
    if not trial.says_hello(connection):
        trial.not_observable("the testee said no hello on the message channel")
    asked = trial.wait(lambda: dealings.count("get_viewport_size") or connection.ended)
    if connection.ended and not dealings.count("get_viewport_size"):
        trial.not_observable("the testee closed the connection")
    trial.expect(asked, "not-asked", "no get_viewport_size followed its hello")
