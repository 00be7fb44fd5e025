"""Checks on requests after `hello`, and what answers them (spec 1.1 section 2.6)."""

from hypothesis import strategies as st

from splatbus_conformance.checks import check
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.bad_neighbours import work_off
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import SAFE, show, whole
from splatbus_conformance.wire.message_kinds import NEEDS, REPLY_TO
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection


@check("NEG-29", observable="answers come in order, one each, after hello", needs=("1.1",))
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
        heard = trial.viewer.with_(connection).heard
        before = len(heard)
        flooded += flooder.push(FLOOD[flooded % len(POSE) :]) or 0
        connection.send(b"".join(packet(encode(each)) for each in asked))
        trial.wait(lambda: len(heard) - before >= len(asked) or connection.ended)  # noqa: B023
        answers = heard[before:]
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


@check("NEG-23", observable="the id of errors that answer requests", needs=("1.1",))
def check_errors_name_the_request_that_they_answer(trial: ServerTrial) -> None:
    """Requests that are broken, and good ones whose capability was not agreed upon, each with an
    id: the least, the greatest and others. An error that comes of one has it.
    """
    connection = trial.greeted("msg", capabilities=[])
    refused = [*BAD, *(each for each in GOOD if NEEDS.get(each["type"]))]
    errors = 0
    for number, request in enumerate(trial.each(refused)):
        if connection.ended:
            connection = trial.greeted("msg", capabilities=[])
        heard, asked = (
            trial.viewer.with_(connection).heard,
            with_id(request, IDS[number % len(IDS)]),
        )
        before = len(heard)
        trial.viewer.say(connection, asked)
        trial.answers(connection)
        for error in (it for it in heard[before:] if it.get("type") == "error"):
            told = f"{encode(asked).decode()} was answered by the error {show(error)}"
            trial.expect(
                whole(error.get("id")) == asked["id"], "wrong-id", f"{told}, which lacks its id"
            )
            errors += 1
    if not errors:
        trial.not_observable("the server sends no error in answer to a request")


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
