"""What a testee and the harness agree upon by `hello` and `welcome`, and whether it goes on then:
at either end.
"""

from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import show, within
from splatbus_conformance.wire.message_kinds import newer
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection

Trial = ClientTrial | ServerTrial
LETTERS = "abcdefghijklmnopqrstuvwxyz_"
CHARACTERS = LETTERS + "AZ09 .-/\\\"'{}\x00\x1f\x7f\xa0\u00e9\u03a9\u4e2d\u202e\uffff\U0001f642"
"""Of one to four bytes each, and such that need an escape."""


def unwelcome(trial: ClientTrial, channel: Channel) -> Connection:
    """A new connection on which the testee has said hello, for a welcome of the check's own."""
    trial.role.welcomes = False
    connection = trial.connection(channel)
    trial.says_hello(connection)
    return connection


def offered(trial: Trial, channel: Channel) -> list[str]:
    """The capabilities that the client has there, whoever plays it."""
    if isinstance(trial, ClientTrial):
        return trial.facts.capabilities(channel)
    return trial.viewer.capabilities[channel]


def agreed(
    trial: Trial, channel: Channel, capabilities: list[str], what: str, **more: object
) -> Connection:
    """A new connection with a hello or welcome of the harness's that lists these capabilities, all
    that the client has among them: by a server no fewer may be granted. To a hello more is added.
    """
    if isinstance(trial, ClientTrial):
        connection = unwelcome(trial, channel)
        trial.role.welcome(connection, capabilities=capabilities)
        return connection
    connection, answer = trial.answered(channel, capabilities=capabilities, **more)
    welcomed = within(answer, "version") == "1.1"
    trial.expect(welcomed, "no-welcome", f"{what} was answered by {show(answer)}")
    granted, usual = trial.with_(connection).granted, trial.facts.capabilities(channel)
    told = f"{what} was granted {show(granted)}, and is granted {show(usual)} otherwise"
    trial.expect({*granted} == {*usual}, "other-capabilities", told)
    return connection


def judge_agreement(trial: Trial, connection: Connection, what: str) -> None:
    """After hello and welcome the testee goes on as with who lists nothing unknown.

    A client opens memory; on the message channel it says what it said when it was met that 1.0
    does not define, and one that says no such thing just goes on.
    """
    if isinstance(trial, ServerTrial):
        outcome = trial.outcome(connection)
        connection.close()
    elif connection.channel == "ipc":
        trial.expect(trial.opens(connection), "not-opened", f"{what}: its memory was not opened")
        return
    else:
        heard = trial.with_(connection).heard
        if trial.facts.says_more:
            agrees = trial.wait(lambda: any(map(newer, heard)) or connection.ended)
            told = f"{what}: it goes on as with a server of 1.0"
            trial.expect(agrees or connection.ended, "not-agreed", told)
        outcome = trial.outcome_on_msg(connection)
    trial.judge("accepts" if outcome == "ignores" else outcome, what)


def agreeing(trial: Trial, channel: Channel) -> Connection:
    """A connection on which all was agreed upon: the newest, unless it is gone. A client can be
    sent an init packet there.
    """
    if isinstance(trial, ClientTrial) and channel == "ipc":
        trial.role.offers_memory = False
        return trial.for_init_packet()
    for connection in reversed(trial.peer.connections):
        if (
            connection.channel == channel
            and trial.with_(connection).welcome
            and not connection.gone
        ):
            return connection
    return trial.greeted(channel) if isinstance(trial, ClientTrial) else trial.ready(channel)


def named(trial: ServerTrial, channel: Channel, versions: list[str], **more: object) -> object:
    """The version that `welcome` names after a hello that lists these; None without `welcome`."""
    connection, answer = trial.answered(channel, versions=versions, **more)
    connection.close()
    return within(answer, "version")


def refused(
    trial: ServerTrial, channel: Channel, code: str, what: str, **changes: object
) -> Connection:
    """A connection whose hello, with members changed as named, is answered by an error of this
    code, as it has to be, and then closed.
    """
    connection, answer = trial.answered(channel, **changes)
    told = answer or {}
    got = told.get("code", told.get("type", "no error"))
    unlike = "another-answer" if answer else "no-reply"
    trial.expect(got == code, unlike, f"{what} got {show(got)}, not {code}")
    trial.expect(trial.ends(connection), "not-closed", f"{what} was refused, and not closed")
    connection.close()
    return connection
