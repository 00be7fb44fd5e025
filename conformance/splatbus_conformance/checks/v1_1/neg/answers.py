"""Checks on requests after `hello`, what answers them, and its `id` (spec 1.1 chapter 2)."""

from contextlib import nullcontext

from hypothesis import strategies as st

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.checks.v1_1.neg.errors import IN_MESSAGES, IN_TEXT
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.bad_neighbours import work_off
from splatbus_conformance.trials.moves.image_session import errors_after
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import SAFE, show, whole
from splatbus_conformance.wire.message_kinds import NEEDS, REPLY_TO
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection


@check("NEG-29", observable="answers come in order, one each, after hello", on={SERVER: ("1.1",)})
def check_answers_each_request_in_order(trial: ServerTrial) -> None:
    """Requests of every kind, with and without ids, good and broken, many at a time, beside a
    client that floods the server with poses; some on a connection that agreed on nothing.
    """
    requests = st.lists(st.sampled_from(GOOD) | st.sampled_from(BAD), min_size=1, max_size=20)
    numbered = st.lists(st.none() | st.integers(0, SAFE), min_size=20, max_size=20)
    cases = st.tuples(requests, numbered, st.booleans()).map(
        lambda drawn: ([with_id(*each) for each in zip(*drawn[:2], strict=False)], drawn[2])
    )
    good, all_ = (
        [with_id(each, number) for number, each in enumerate(some)] for some in (GOOD, GOOD + BAD)
    )
    listed = [(good, True), (list(GOOD), True), (all_, True), (all_, False)]
    width, height = trial.facts.size
    if width and height:  # a size that it has already changes nothing
        same = {"type": "set_viewport", "width": width, "height": height}
        listed += [([*GOOD, same, *GOOD], True), ([with_id(same, 7), VIEWPORT_REQUEST], True)]
    flooder, flooded = trial.dial("msg"), 0
    kept: dict[bool, Connection] = {}
    for asked, agreed in trial.each(listed, cases, quick=18, full=1000):
        connection = kept.get(agreed)
        if connection is None or connection.ended:
            offer: Json = {} if agreed else {"capabilities": []}
            connection = kept[agreed] = trial.greeted("msg", **offer)
        flooded += flooder.push(FLOOD[flooded % len(POSE) :]) or 0
        answers = trial.ask_all(connection, asked)
        for number, each in enumerate(asked):
            if len(answers) == number and connection.ended and not is_good(each):
                break
            trial.expect(
                len(answers) > number, "no-reply", f"{encode(each).decode()} was not answered"
            )
            expect_answer(trial, each, answers[number])
        trial.delivered += 1
    while flooded % len(POSE) and not flooder.ended and trial.fate() is None:
        flooded += flooder.push(FLOOD[flooded % len(POSE) : len(POSE)]) or 0
        trial.rest(REST_SECONDS)
    work_off(trial, flooder)


@check("NEG-23", observable="the id of errors that answer requests", on={SERVER: ("1.1",)})
def check_errors_name_the_request_that_they_answer(trial: ServerTrial) -> None:
    """Requests that are broken, and good ones whose capability was not agreed upon, each with an
    id: the least, the greatest and others. An error that comes of one has it.
    """
    connection, errors = trial.greeted("msg", capabilities=[]), 0
    refused = [*BAD, *(each for each in GOOD if NEEDS.get(each["type"]))]
    for number, request in enumerate(trial.each(refused)):
        if connection.ended:
            connection = trial.greeted("msg", capabilities=[])
        asked = with_id(request, IDS[number % len(IDS)])
        for error in errors_after(trial, connection, encode(asked))[0]:
            told = f"{encode(asked).decode()} was answered by the error {show(error)}"
            named = whole(error.get("id")) == asked["id"]
            trial.expect(named, "wrong-id", f"{told}, which lacks its id")
            errors += 1
    if not errors:
        trial.not_observable("the server sends no error in answer to a request")


@check("NEG-23", observable="that errors about no request have no id", on={SERVER: ("1.1",)})
def check_errors_about_no_request_name_none(trial: ServerTrial) -> None:
    """Faults in what is no request, behind a request that has an id: a client would take an error
    with that for the answer to its request.
    """
    connection, errors = trial.greeted("msg"), 0
    for payload in trial.each([fault.script[4:] for fault in (IN_TEXT[0], *OF_NO_REQUEST)]):
        if connection.ended:
            connection = trial.greeted("msg")
        trial.answers(connection)  # a request with an id
        for error in errors_after(trial, connection, payload)[0]:
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


@check(
    "NEG-28",
    observable="the ids of answers to requests that share one",
    on={SERVER: ("1.1",)},
    given=lambda trial: nullcontext(trial.greeted("msg")),
    cases=Cases((0, 7, SAFE, None)),
)
def check_answers_repeat_an_id_that_was_used(
    trial: ServerTrial, connection: Connection, id: int | None
) -> None:
    """Requests of every kind that the server grants, all with the same id, then without any."""
    asked = [with_id(it, id) for it in GOOD for _ in range(2)]
    for reply in trial.ask_all(connection, asked):
        if reply.get("type") in REPLY_TO.values():
            told = f"one of several requests with the id {id} was answered by {show(reply)}"
            trial.expect(whole(reply.get("id")) == id, "wrong-id", told)
            trial.delivered += 1


IDS = (0, SAFE, 1, 2**32, 2**53 - 2)
GOOD: tuple[Json, ...] = (
    VIEWPORT_REQUEST,
    *({"type": "get_camera_pose", "cam_idx": index} for index in (0, 1, -(2**31), 2**31)),
    {"type": "get_scene"},
    {"type": "ping", "t": 12.5},
)
BAD: tuple[Json, ...] = (
    *({"type": "get_camera_pose", "cam_idx": it} for it in ("0", 0.5, True, None, [0], 2**60)),
    {"type": "ping"},
    {"type": "ping", "t": "now"},
    {"type": "ping", "t": []},
    *({"type": "set_viewport", "width": 64, "height": it} for it in (0, -1, 1.5, 2**40, "48")),
)
POSE = packet(encode(camera_pose()))
REST_SECONDS = 0.02
FLOOD = POSE * 1000
"""Of a client that keeps no measure."""


def with_id(request: Json, id: int | None) -> Json:
    """A request that may have an id."""
    return request if id is None else request | {"id": id}


def is_good(asked: Json) -> bool:
    """Whether a request breaks no rule."""
    plain = {name: value for name, value in asked.items() if name != "id"}
    return plain in GOOD or (plain.get("type") == "set_viewport" and plain not in BAD)


def expect_answer(trial: ServerTrial, asked: Json, answer: Json) -> None:
    """The answer is a reply to this request, or an error that names it if it has an id."""
    text, kind = encode(asked).decode(), answer.get("type")
    reply = REPLY_TO[asked["type"]]
    trial.expect(kind in (reply, "error"), "another-answer", f"{text} was answered by {kind}")
    named = whole(answer.get("id"))
    trial.expect(
        named in (None, asked.get("id")),
        "wrong-id",
        f"{text} was answered by one with id {named}",
    )
