"""Replies are matched to requests by order, by what they hold, and by id where there is one."""

from splatbus_conformance.rules.exchanges import Exchanges, exchanges, valid_request
from splatbus_conformance.wire.conversation import conversations

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    ASK_SIZE,
    CAMERA,
    GREETING,
    POSE,
    SIZE,
    Step,
    breaches,
    client,
    error,
    server,
    talk,
)

TYPED_SIZE = {"type": "viewport_size", **SIZE}
TYPED_CAMERA = {"type": "camera", **CAMERA}


def matched(*steps: Step) -> Exchanges:
    (conversation,) = conversations(talk("msg", *steps))
    return exchanges(conversation)


def test_replies_in_order() -> None:
    found = matched(client(ASK_SIZE), client(ASK_CAMERA), server(SIZE), server(CAMERA))
    assert [(p.question.value, p.answer.value, p.late) for p in found.pairs] == [
        (ASK_SIZE, SIZE, 0),
        (ASK_CAMERA, CAMERA, 0),
    ]
    assert not found.extra
    assert not found.unanswered


def test_a_reply_that_overtakes_is_late_once() -> None:
    found = matched(client(ASK_SIZE), client(ASK_CAMERA), server(CAMERA), server(SIZE))
    assert [p.late for p in found.pairs] == [1, 0]


def test_a_reply_of_the_other_kind_is_extra_and_its_request_blamed() -> None:
    found = matched(client(ASK_SIZE), server(CAMERA))
    assert [extra.cause.value for extra in found.extra if extra.cause] == [ASK_SIZE]
    assert not found.unanswered


def test_what_has_no_sign_of_a_reply_is_a_broken_one() -> None:
    found = matched(client(ASK_SIZE), server({"size": [1, 2]}))
    assert [p.answer.value for p in found.pairs] == [{"size": [1, 2]}]


def test_1_0_knows_no_ids() -> None:
    first = {**ASK_SIZE, "id": {"of": "mine"}}
    found = matched(client(first), client(ASK_SIZE), server(SIZE), server(SIZE))
    assert [(p.question.value, p.late) for p in found.pairs] == [(first, 0), (ASK_SIZE, 0)]
    assert not found.extra


def test_ids_decide_between_requests_of_one_kind() -> None:
    first, second = {**ASK_SIZE, "id": 1}, {**ASK_SIZE, "id": 2}
    found = matched(*GREETING, client(first), client(second), server({**TYPED_SIZE, "id": 2}))
    assert [(p.question.value, p.late) for p in found.pairs] == [(second, 1)]


def test_an_error_with_an_id_answers_that_request() -> None:
    asked = {**ASK_SIZE, "id": 1}
    found = matched(*GREETING, client(asked), server(error("busy", id=1)))
    assert not found.unanswered


def test_an_error_with_an_id_keeps_to_the_order_too() -> None:
    first, second = {**ASK_SIZE, "id": 1}, {**ASK_SIZE, "id": 2}
    overtaken = (*GREETING, client(first), client(second), server(error("busy", id=2)))
    assert [p.late for p in matched(*overtaken).pairs] == [1]
    assert breaches(talk("msg", *overtaken)) == {("server", "NEG-29"): 1}


def test_an_id_may_have_a_fraction_of_zero() -> None:
    asked = client({**ASK_SIZE, "id": 3.0})
    assert breaches(talk("msg", *GREETING, asked, server({**TYPED_SIZE, "id": 3}))) == {}


def test_an_error_without_id_may_be_the_answer_of_what_is_passed_over() -> None:
    found = matched(
        *GREETING,
        client(ASK_SIZE),
        client(ASK_CAMERA),
        server(error("busy")),
        server(TYPED_CAMERA),
    )
    assert [p.late for p in found.pairs] == [0]
    assert not found.unanswered


def test_requests_that_break_a_rule_need_no_answer() -> None:
    found = matched(client({"type": "get_camera_pose"}), client(ASK_SIZE), server(SIZE))
    assert [p.late for p in found.pairs] == [0]
    assert not found.unanswered


def test_a_request_of_doubtful_timestamp_may_be_answered_or_not() -> None:
    doubtful = {**ASK_SIZE, "timestamp": "noon"}
    assert not matched(client(doubtful)).unanswered
    assert not matched(client(doubtful), server(SIZE)).extra


def test_poses_are_no_requests() -> None:
    (conversation,) = conversations(talk("msg", client(POSE), server(SIZE)))
    assert not valid_request(conversation.messages[0])
    assert [extra.answer.value for extra in exchanges(conversation).extra] == [SIZE]
