"""Checks on peers of later versions (spec 1.1 chapter 10)."""

from splatbus_conformance.checks import (
    CLIENT_IPC,
    CLIENT_MSG,
    OPENS_HOST_MEMORY,
    SERVER_IPC,
    SERVER_MSG,
    check,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.agreement import Trial, agreed, judge_agreement, offered
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.recording import WORDS, Channel

VERSION = "1.4000"
"""That nobody speaks yet."""
MORE: Json = {"later": {"since": VERSION, "values": [None, {}]}}
MARKER: Json = {"type": "later_marker", "generation": 1, "seq": 0, "id": 0, **MORE}
"""A message of a type of that version."""


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
    on={
        CLIENT_IPC: OPENS_HOST_MEMORY,
        CLIENT_MSG: ("hello:msg", "returns:msg"),
        SERVER_MSG: ("1.1",),
        SERVER_IPC: ("1.1",),  # last, for a camera is moved from a message connection that stays
    },
)
def check_speaks_with_later_versions(trial: Trial, channel: Channel) -> None:
    """The other side is of a later version: `hello` lists it first, or an init packet names it;
    there are capabilities that nobody knows, every message has members more, and to a client come
    messages of types that nobody knows.
    """
    what = f"a peer of version {VERSION} on the {WORDS[channel]} channel"
    listed = ["later_markers", *offered(trial, channel)]
    if not isinstance(trial, ClientTrial):
        trial.viewer.encode = writes_later
        versions = [VERSION, "1.1"]
        judge_agreement(trial, agreed(trial, channel, listed, what, versions=versions), what)
        return
    trial.role.encode[channel], trial.role.lends_frames = writes_later, channel == "msg"
    connection = agreed(trial, channel, listed, what)
    trial.role.say(connection, MARKER)
    judge_agreement(trial, connection, what)
    for _ in range(3 if channel == "ipc" and "frames" in listed else 0):
        trial.role.say(connection, MARKER)
        given_back = trial.releases(connection, trial.lend(connection))
        trial.expect(given_back, "not-released", f"{what}: a frame was not released")
