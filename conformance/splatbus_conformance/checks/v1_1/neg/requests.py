"""Checks on requests after `hello`, what answers them, and its `id` (spec 1.1 chapter 2)."""

from hypothesis import strategies as st

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.bad_neighbours import work_off
from splatbus_conformance.trials.moves.image_session import errors_after
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import SAFE, show, whole
from splatbus_conformance.wire.message_kinds import NEEDS, REPLY_TO
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

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


@check("NEG-29", on={SERVER: ("1.1",)})
def check_answers_each_request_in_order(trial: ServerTrial) -> None:
    """Requests of every kind, with and without ids, good and broken, many at a time, beside a
    client that floods the server with poses; some on a connection that agreed on nothing. Each is
    answered once, in order.
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
    same: Json = {"type": "set_viewport", "width": width, "height": height}
    if width and height:  # a size that it has already changes nothing
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
            plain = {name: value for name, value in each.items() if name != "id"}
            if len(answers) == number and connection.ended and plain not in (*GOOD, same):
                break
            text = encode(each).decode()
            trial.expect(len(answers) > number, "no-reply", f"{text} was not answered")
            answer, reply = answers[number], REPLY_TO[each["type"]]
            kind, id = answer.get("type"), whole(answer.get("id"))
            told = f"{text} was answered by {kind}"
            trial.expect(kind in (reply, "error"), "another-answer", told)
            told = f"{text} was answered by one with id {id}"
            trial.expect(id in (None, each.get("id")), "wrong-id", told)
    while flooded % len(POSE) and not flooder.ended and trial.fate() is None:
        flooded += flooder.push(FLOOD[flooded % len(POSE) : len(POSE)]) or 0
        trial.rest(REST_SECONDS)
    work_off(trial, flooder)


@check("NEG-23", on={SERVER: ("1.1",)})
def check_errors_name_the_request_that_they_answer(trial: ServerTrial) -> bool:
    """Requests that are broken, and good ones whose capability was not agreed upon, each with an
    id: the least, the greatest and others. An error that comes of one has it.
    """
    connection, seen = trial.greeted("msg", capabilities=[]), False
    refused = [*BAD, *(each for each in GOOD if NEEDS.get(each["type"]))]
    for number, request in enumerate(trial.each(refused)):
        if connection.ended:
            connection = trial.greeted("msg", capabilities=[])
        asked = with_id(request, IDS[number % len(IDS)])
        for error in errors_after(trial, connection, encode(asked))[0]:
            told = f"{encode(asked).decode()} was answered by the error {show(error)}"
            named = whole(error.get("id")) == asked["id"]
            trial.expect(named, "wrong-id", f"{told}, which lacks its id")
            seen = True
    return seen or trial.not_observable("the server sends no error in answer to a request")


@check(
    "NEG-28",
    on={SERVER: ("1.1",)},
    given=lambda trial: trial.greeted("msg"),
    cases=Cases((0, 7, SAFE, None)),
)
def check_answers_repeat_an_id_that_was_used(
    trial: ServerTrial, connection: Connection, id: int | None
) -> bool:
    """Requests of every kind that the server grants, all with the same id, then without any."""
    asked = [with_id(it, id) for it in GOOD for _ in range(2)]
    replies = [it for it in trial.ask_all(connection, asked) if it.get("type") in REPLY_TO.values()]
    for reply in replies:
        told = f"one of several requests with the id {id} was answered by {show(reply)}"
        trial.expect(whole(reply.get("id")) == id, "wrong-id", told)
    return bool(replies)
