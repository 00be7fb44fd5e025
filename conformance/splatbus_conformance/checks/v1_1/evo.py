"""Checks on peers of later versions (spec 1.1 chapter 10)."""

from splatbus_conformance.checks import (
    CLIENT_IPC,
    CLIENT_MSG,
    OPENS_HOST_MEMORY,
    SERVER_IPC,
    SERVER_MSG,
    check,
)
from splatbus_conformance.checks.v1_1.neg.clients import declared, judge_agreement
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import within
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.recording import WORDS, Channel

VERSION = "1.4000"
"""That nobody speaks yet."""
MORE: Json = {"later": {"since": VERSION, "values": [None, {}]}}
MARKER: Json = {"type": "later_marker", "generation": 1, "seq": 0, "id": 0, **MORE}
"""A message of a type of that version."""
CAPABILITY = "later_markers"


def of_later(message: Json) -> Json:
    """A message as that version would write it: with a member more at each level of objects."""
    more = {
        name: of_later(member) if isinstance(member, dict) else member
        for name, member in message.items()
    }
    return more | MORE


def writes_later(message: Json) -> bytes:
    """The payload of a message of that version; init packets name it."""
    named = {"version": VERSION} if "meta" in message else {}
    return encode(of_later(message | named))


@check(
    "EVO-1",
    observable="memory is opened, frames are released, requests answered, as of one's own version",
    on={
        CLIENT_IPC: OPENS_HOST_MEMORY,
        CLIENT_MSG: ("hello:msg", "returns:msg"),
        SERVER_MSG: ("1.1",),
        SERVER_IPC: ("1.1",),  # last, for a camera is moved from a message connection that stays
    },
)
def check_speaks_with_later_versions(trial: ClientTrial | ServerTrial, channel: Channel) -> None:
    """The other side is of a later version: `hello` lists it first, or an init packet names it;
    there are capabilities that nobody knows, every message has members more, and to a client come
    messages of types that nobody knows.
    """
    if isinstance(trial, ServerTrial):
        _serves_a_later_client(trial, channel)
    else:
        _reads_a_later_server(trial, channel)


def _reads_a_later_server(trial: ClientTrial, channel: Channel) -> None:
    role = trial.role
    role.welcomes, role.lends_frames = False, channel == "msg"
    role.encode[channel] = writes_later
    connection = trial.connection(channel)
    trial.says_hello(connection)
    real = trial.facts.capabilities() if channel == "ipc" else declared(trial)
    role.welcome(connection, capabilities=[CAPABILITY, *real])
    role.say(connection, MARKER)
    what = f"a server of version {VERSION} on the {WORDS[channel]} channel"
    if channel == "msg":
        judge_agreement(trial, connection, what)
        return
    trial.expect(trial.opens(connection), "not-opened", f"{what}: its memory was not opened")
    for _ in range(3 if "frames" in real else 0):
        role.say(connection, MARKER)
        given_back = trial.releases(connection, trial.lend(connection))
        trial.expect(given_back, "not-released", f"{what}: a frame was not released")
    trial.delivered += 1


def _serves_a_later_client(trial: ServerTrial, channel: Channel) -> None:
    trial.viewer.encode = writes_later
    offered = [CAPABILITY, *trial.viewer.capabilities[channel]]
    connection, answer = trial.answered(channel, versions=[VERSION, "1.1"], capabilities=offered)
    what = f"a client of version {VERSION} on the {WORDS[channel]} channel"
    version = within(answer, "version")
    trial.expect(version == "1.1", "no-welcome", f"{what} was answered by {answer}")
    outcome = trial.outcome(connection)
    trial.judge("accepts" if outcome == "ignores" else outcome, what)
    connection.close()
