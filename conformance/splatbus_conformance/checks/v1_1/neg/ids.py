"""Checks on the `id` that answers and errors have after `hello` (spec 1.1 sections 2.5 and 2.6)."""

from splatbus_conformance.checks import check
from splatbus_conformance.checks.v1_1.neg.answers import GOOD
from splatbus_conformance.checks.v1_1.neg.errors import IN_MESSAGES, IN_TEXT
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import SAFE, show, whole
from splatbus_conformance.wire.message_kinds import REPLY_TO
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet

IDS = (0, 7, SAFE)


@check("NEG-23", observable="that errors about no request have no id", needs=("1.1",))
def check_errors_about_no_request_name_none(trial: ServerTrial) -> None:
    """Faults in what is no request, behind a request that has an id: a client would take an error
    with that for the answer to its request.
    """
    connection, errors = trial.greeted("msg"), 0
    for payload in trial.each([fault.script[4:] for fault in (IN_TEXT[0], *OF_NO_REQUEST)]):
        if connection.ended:
            connection = trial.greeted("msg")
        trial.answers(connection)  # a request with an id
        heard = trial.viewer.with_(connection).heard
        before = len(heard)
        connection.send(packet(payload))
        trial.answers(connection)
        for error in (it for it in heard[before:] if it.get("type") == "error"):
            told = f"{shorten(repr(payload))} was answered by the error {show(error)}"
            trial.expect("id" not in error, "has-an-id", f"{told}, which has the id of a request")
            errors += 1
    if not errors:
        trial.not_observable("the server sends no error about what is no request")


OF_NO_REQUEST = [
    fault
    for fault in IN_MESSAGES
    if fault.channel == "msg" and not any(name.encode() in fault.script for name in REPLY_TO)
]


@check("NEG-28", observable="the ids of answers to requests that share one", needs=("1.1",))
def check_answers_repeat_an_id_that_was_used(trial: ServerTrial) -> None:
    """Requests of every kind that the server grants, all with the same id, then without any."""
    connection = trial.greeted("msg")
    heard = trial.viewer.with_(connection).heard
    for id in trial.each([*IDS, None]):
        before = len(heard)
        asked = [it if id is None else it | {"id": id} for it in GOOD for _ in range(2)]
        connection.send(b"".join(packet(encode(each)) for each in asked))
        trial.wait(lambda: len(heard) - before >= len(asked) or connection.ended)  # noqa: B023
        for reply in (it for it in heard[before:] if it.get("type") in REPLY_TO.values()):
            told = f"one of several requests with the id {id} was answered by {show(reply)}"
            trial.expect(whole(reply.get("id")) == id, "wrong-id", told)
            trial.delivered += 1
