"""Every rule on what a server answers, kept and broken."""

import pytest
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    ASK_SIZE,
    CAMERA,
    CLIENT_ENDS,
    GREETING,
    INIT,
    POSE,
    SERVER_ENDS,
    SIZE,
    Case,
    Step,
    breaches,
    changed,
    client,
    ends,
    error,
    first_breach,
    frame,
    joined,
    server,
    session,
    talk,
)

TYPED_SIZE = {"type": "viewport_size", **SIZE}
TYPED_CAMERA = {"type": "camera", **CAMERA}
BAD_REQUEST = {"type": "get_camera_pose", "cam_idx": "first"}
UNKNOWN = {"type": "later"}


def msg(*steps: Step) -> list[Entry]:
    return talk("msg", *steps)


def told(size: object) -> list[Entry]:
    return msg(client(ASK_SIZE), server({"viewport_size": size}))


def camera(reply: dict) -> list[Entry]:
    return msg(client(ASK_CAMERA), server(reply))


KEPT = msg(
    client(ASK_SIZE),
    server(SIZE),
    client(POSE),
    client(ASK_CAMERA),
    server(CAMERA),
    CLIENT_ENDS,
    SERVER_ENDS,
)
NEGOTIATED = msg(
    *GREETING,
    client({**ASK_SIZE, "id": 7}),
    server({**TYPED_SIZE, "id": 7}),
    client(ASK_CAMERA),
    server(TYPED_CAMERA),
)
MEMORY = talk("ipc", server(INIT), start=0.5)
NOT_YET = talk("msg", client(ASK_SIZE), server({"viewport_size": [0, 0]}), start=0.1, conn=2)

CASES = [
    Case("REQ-3", "server", KEPT, told([64, 48.5])),
    Case("REQ-4", "server", joined(NOT_YET, MEMORY, KEPT), joined(MEMORY, told([64, 49]))),
    Case("REQ-5", "server", KEPT, camera(changed(CAMERA, "/rotation"))),
    Case("REQ-7", "server", KEPT, msg(client(ASK_SIZE), server(SIZE), server(SIZE))),
    Case("CHN-11", "server", KEPT, msg(server({"type": "news"}))),
    Case("POS-10", "server", KEPT, msg(client(POSE), server({"ok": True}))),
    Case(
        "CHN-16",
        "server",
        KEPT,
        msg(client(ASK_SIZE), client(ASK_CAMERA), CLIENT_ENDS, server(SIZE), SERVER_ENDS),
    ),
    Case(
        "NEG-29",
        "server",
        NEGOTIATED,
        msg(
            *GREETING,
            client(ASK_SIZE),
            client(ASK_CAMERA),
            server(TYPED_CAMERA),
            server(TYPED_SIZE),
        ),
    ),
    Case("NEG-28", "server", NEGOTIATED, msg(*GREETING, client(ASK_SIZE), server(SIZE))),
]


@pytest.mark.parametrize(
    ("requirement", "message", "client_s_fault"),
    [("REQ-9", BAD_REQUEST, "REQ-2"), ("REQ-8", UNKNOWN, "REQ-14")],
)
def test_what_deserves_no_reply(requirement: str, message: dict, client_s_fault: str) -> None:
    for silent, reply in ((True, []), (False, [server(CAMERA)])):
        found = breaches(msg(client(message), *reply))
        expected = {("client", client_s_fault): 1}
        assert found == (expected if silent else {**expected, ("server", requirement): 1})


def test_a_reply_without_the_member_breaks_req_3() -> None:
    assert breaches(msg(client(ASK_SIZE), server({"size": [64, 48]}))) == {("server", "REQ-3"): 1}


def test_numbers_as_strings_break_jsn_4_alone() -> None:
    assert breaches(told(["64", "48"])) == {("server", "JSN-4"): 1}
    assert breaches(camera(changed(CAMERA, "/position/0", "1.5"))) == {("server", "JSN-4"): 1}


def test_half_a_size_breaks_req_4() -> None:
    assert breaches(told([0, 48])) == {("server", "REQ-4"): 1}


def test_no_size_is_told_while_nothing_is_rendered() -> None:
    assert breaches(joined(MEMORY, told([0, 0]))) == {}
    rendering = session(server(frame()), server(error("busy")), conn=3)
    late = talk("msg", client(ASK_SIZE), server({"viewport_size": [0, 0]}), start=9.0)
    assert breaches(joined(rendering, late)) == {("server", "REQ-4"): 1}


def test_a_size_that_the_newest_init_packet_does_not_have_breaks_req_4() -> None:
    assert breaches(joined(MEMORY, told([63, 48]))) == {("server", "REQ-4"): 1}


def test_a_size_that_is_announced_right_afterwards_is_none() -> None:
    wider = changed(changed(INIT, "/meta/w", 128), "/meta/pitchColor", 2048)
    wider = changed(wider, "/meta/pitchDepth", 512)
    later = talk("ipc", server(wider), start=3.0, conn=2)
    assert breaches(joined(MEMORY, told([128, 48]), later)) == {}


def test_replies_out_of_order_are_one_breach() -> None:
    asked = (client(ASK_SIZE), client(ASK_CAMERA))
    assert breaches(msg(*asked, server(CAMERA), server(SIZE))) == {("server", "REQ-7"): 1}


def test_a_reply_of_the_wrong_kind_is_one_breach() -> None:
    wrong = msg(client(ASK_SIZE), server(CAMERA), SERVER_ENDS)
    assert breaches(wrong) == {("server", "REQ-7"): 1}


def test_a_spoiled_reply_breaks_jsn_1_alone() -> None:
    spoiled = msg(client(ASK_SIZE), server(b"{"), SERVER_ENDS)
    assert breaches(spoiled) == {("server", "JSN-1"): 1}


SERVED = (client(ASK_SIZE), server(SIZE))


def test_a_server_that_ends_a_connection_that_it_served_owes_the_reply() -> None:
    assert breaches(msg(*SERVED, client(ASK_CAMERA), SERVER_ENDS)) == {("server", "REQ-7"): 1}
    negotiated = msg(*GREETING, client(ASK_CAMERA), SERVER_ENDS)
    assert breaches(negotiated) == {("server", "NEG-29"): 1}


@pytest.mark.parametrize(
    "steps",
    [
        [*SERVED, client(ASK_CAMERA)],
        [*SERVED, client(ASK_CAMERA), CLIENT_ENDS],
        [*SERVED, client(ASK_CAMERA), ends("c2s", "reset"), SERVER_ENDS],
        [client(ASK_CAMERA), SERVER_ENDS],
        [*GREETING, client(ASK_CAMERA), server(error("too_many_clients")), SERVER_ENDS],
    ],
    ids=["nobody ended", "the client ended", "the client reset", "never served", "told why"],
)
def test_a_missing_reply_that_shows_nothing(steps: list[Step]) -> None:
    assert breaches(msg(*steps)) == {}


def test_a_server_may_close_on_a_client_that_breaks_a_rule() -> None:
    provoked = msg(*SERVED, client(BAD_REQUEST), client(ASK_CAMERA), SERVER_ENDS)
    assert breaches(provoked) == {("client", "REQ-2"): 1}


def test_a_server_may_close_an_older_connection_in_favour_of_a_newer() -> None:
    older = msg(*SERVED, client(ASK_CAMERA), Step("s2c", event="eof", pause=2.0))
    newer = talk("msg", *SERVED, conn=2, start=2.0)
    assert breaches(joined(older, newer)) == {}


@pytest.mark.parametrize(
    ("reply", "pointer"),
    [
        (SIZE, "/type"),
        ({**TYPED_SIZE, "type": "size"}, "/type"),
        (TYPED_SIZE, "/id"),
        ({**TYPED_SIZE, "id": 8}, "/id"),
    ],
)
def test_neg_28_wants_type_and_id(reply: dict, pointer: str) -> None:
    asked = {**ASK_SIZE, "id": 7}
    reply = {"id": 7, **reply} if pointer == "/type" else reply
    broken = msg(*GREETING, client(asked), server(reply))
    assert breaches(broken) == {("server", "NEG-28"): 1}
    assert first_breach(broken).pointer == pointer


def test_after_hello_a_message_that_nothing_defines_is_no_unasked_reply() -> None:
    assert breaches(msg(*GREETING, server({"type": "weather", "seq": 1}))) == {
        ("server", "EVO-2"): 1
    }


def test_an_error_in_answer_to_a_pose_is_no_reply_to_it() -> None:
    turned = changed(POSE, "/rotation/w", 2.0)
    answered = msg(*GREETING, client(turned), server(error("invalid_rotation")))
    assert breaches(answered) == {("client", "POS-3"): 1}


def test_a_welcome_that_nobody_asked_for_breaks_chn_11() -> None:
    assert breaches(msg(server({"type": "welcome"}))) == {("server", "CHN-11"): 1}


BROKEN = b'{"type":"get_viewport_size",}'
NO_INDEX = {"type": "get_camera_pose"}


@pytest.mark.parametrize(
    ("asked", "beside", "reply", "requirement"),
    [(BROKEN, ASK_SIZE, SIZE, "JSN-8"), (NO_INDEX, ASK_CAMERA, CAMERA, "REQ-9")],
)
def test_what_answers_nothing_is_about_what_was_sent_before_it(
    asked: object, beside: object, reply: object, requirement: str
) -> None:
    """Also where valid requests had followed before it came."""
    pipelined = msg(*map(client, (beside, asked, beside)), *map(server, (reply, reply, reply)))
    found = breaches(pipelined)
    assert {name: n for (peer, name), n in found.items() if peer == "server"} == {requirement: 1}


@pytest.mark.parametrize("silent", [(POSE, UNKNOWN), (UNKNOWN, POSE)])
def test_what_may_be_about_several_messages_is_one_answer_too_many(silent: tuple) -> None:
    """Whichever came first: each is left alone by a sentence of its own."""
    pipelined = msg(*map(client, (*silent, ASK_SIZE)), server({"ok": True}), server({"ok": True}))
    found = breaches(pipelined)
    assert {name for peer, name in found if peer == "server"} == {"REQ-3", "REQ-7"}


def test_an_answer_without_the_id_of_what_has_none_is_not_about_that() -> None:
    """After hello: it is for another, as those are for whom it is the one too many."""
    asked = [ASK_CAMERA | {"id": 1}, NO_INDEX | {"id": 2}]
    typed = {"type": "camera", **CAMERA}
    named = msg(*GREETING, *map(client, asked), server(typed | {"id": 1}), server(typed))
    assert {name for peer, name in breaches(named) if peer == "server"} == {"REQ-7"}
    told = msg(*GREETING, *map(client, asked), *(server(typed | {"id": n}) for n in (1, 2)))
    assert {name for peer, name in breaches(told) if peer == "server"} == {"REQ-9"}
