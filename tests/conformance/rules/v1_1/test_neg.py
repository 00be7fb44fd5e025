"""Every rule on the client's side of the negotiation, kept and broken."""

import pytest
from splatbus_conformance.wire.recording import Channel, Entry

from tests.conformance.rules.talk import (
    ALL,
    ALL_MSG,
    ASK_CAMERA,
    ASK_SIZE,
    CAMERA,
    GREETING,
    HOST_INIT,
    INIT,
    INTRINSICS,
    OBJECT_POSE,
    OPENED,
    POSE,
    SIZE,
    Case,
    Step,
    about_generation,
    breaches,
    changed,
    client,
    greeting,
    hello,
    raw,
    server,
    session,
    talk,
    welcome,
)

TYPED_SIZE = {"type": "viewport_size", **SIZE}
FALLEN_BACK = (client(hello()), client(ASK_SIZE), server(SIZE))
ASKS_3 = client({**ASK_SIZE, "id": 3}), server({**TYPED_SIZE, "id": 3})
RELEASE = client(about_generation("release", seq=1))


def msg(*steps: Step) -> list[Entry]:
    return talk("msg", *steps)


def ipc(*steps: Step) -> list[Entry]:
    return talk("ipc", *steps)


def greets(message: dict) -> list[Entry]:
    return msg(client(message))


def asks_with(number: object) -> list[Entry]:
    return msg(*GREETING, client({**ASK_SIZE, "id": number}))


CASES = [
    Case("NEG-1", "client", msg(*GREETING), msg(client(POSE), *GREETING)),
    Case("NEG-2", "client", msg(*GREETING), greets(changed(hello(), "/versions"))),
    Case("NEG-3", "client", msg(*GREETING), msg(*GREETING, client(hello()))),
    Case("NEG-5", "client", session(), ipc(client(hello(*ALL)), OPENED)),
    Case(
        "NEG-13",
        "client",
        msg(*FALLEN_BACK, client(POSE), client(ASK_CAMERA), server(CAMERA)),
        msg(*FALLEN_BACK, client({**ASK_CAMERA, "id": 1}), server(CAMERA)),
    ),
    Case(
        "NEG-14",
        "client",
        ipc(server(INIT), client(hello(*ALL))),
        ipc(server(INIT), client(hello(*ALL)), OPENED),
    ),
    Case("NEG-27", "client", asks_with(2**53 - 1), asks_with(-1)),
    Case("NEG-37", "client", msg(*GREETING, *ASKS_3, *ASKS_3), msg(*GREETING, *ASKS_3[:1] * 2)),
]


@pytest.mark.parametrize("id", [{"id": 3}, {}])
def test_an_error_answers_too_and_one_without_id_any_request(id: dict) -> None:
    refused = server({"type": "error", "code": "internal", "message": "", **id})
    assert ("client", "NEG-37") not in breaches(msg(*GREETING, ASKS_3[0], refused, *ASKS_3))


def test_another_id_may_be_used_while_one_waits() -> None:
    other = client({**ASK_CAMERA, "id": 4})
    assert breaches(msg(*GREETING, ASKS_3[0], other, *ASKS_3[1:])) == {}


def test_an_id_as_a_string_breaks_jsn_4_where_an_id_belongs() -> None:
    assert breaches(asks_with("3")) == {("client", "JSN-4"): 1}
    assert breaches(msg(client({**ASK_SIZE, "id": "3"}), server(SIZE))) == {}


@pytest.mark.parametrize(
    ("message", "needed"),
    [
        (about_generation("release", seq=1), "frames"),
        ({"type": "subscribe", "channels": ["color"]}, "subscribe"),
        (about_generation("closed"), "reinit"),
    ],
)
def test_neg_5_wants_the_capability(message: dict, needed: str) -> None:
    others = [name for name in ALL if name != needed]
    opened = session(client(message), capabilities=others)
    assert breaches(opened) == {("client", "NEG-5"): 1}


@pytest.mark.parametrize(
    ("message", "needed"),
    [
        ({**POSE, "intrinsics": INTRINSICS}, "intrinsics"),
        (OBJECT_POSE, "objects"),
        ({"type": "get_scene"}, "scene"),
        ({"type": "set_viewport", "width": 64, "height": 48}, "viewport"),
        ({"type": "set_time", "time": 0.5}, "time"),
        ({"type": "ping", "t": 0.5}, "ping"),
        ({"type": "subscribe_telemetry", "names": None}, "telemetry"),
    ],
)
def test_neg_5_wants_the_capability_of_the_message_channel(message: dict, needed: str) -> None:
    others = [name for name in ALL_MSG if name != needed]
    assert breaches(msg(*greeting(*ALL_MSG), client(message))) == {}
    assert breaches(msg(*greeting(*others), client(message))) == {("client", "NEG-5"): 1}
    assert breaches(msg(client(hello(*ALL_MSG)), client(message))) == {("client", "NEG-5"): 1}


@pytest.mark.parametrize("member", [{"tag": "a"}, {"intrinsics": INTRINSICS}])
def test_members_of_1_1_wait_for_welcome(member: dict) -> None:
    pose = client({**POSE, **member})
    early = msg(client(hello(*ALL_MSG)), pose, server(welcome(*ALL_MSG)), pose)
    assert breaches(early) == {("client", "NEG-5"): 1}
    assert breaches(msg(*FALLEN_BACK, pose)) == {("client", "NEG-13"): 1}
    assert breaches(msg(pose)) == {}


def test_a_tag_needs_no_capability() -> None:
    assert breaches(msg(*GREETING, client({**POSE, "tag": "a"}))) == {}


@pytest.mark.parametrize("channel", ["ipc", "msg"])
def test_neg_5_before_welcome(channel: Channel) -> None:
    early = talk(channel, client(hello(*ALL)), RELEASE)
    assert breaches(early) == {("client", "NEG-5"): 1}


def test_messages_of_1_1_without_any_hello() -> None:
    assert breaches(msg(RELEASE)) == {("client", "NEG-5"): 1}
    assert breaches(ipc(RELEASE)) == {("client", "CHN-6"): 1}


def test_a_message_that_cannot_be_read_is_none_before_hello() -> None:
    assert breaches(msg(client(b"{"), *GREETING)) == {("client", "JSN-1"): 1}


def test_what_a_client_sends_before_the_reply_arrives_shows_no_fallback() -> None:
    piped = msg(client(hello()), client(ASK_SIZE), client({**ASK_CAMERA, "id": 1}), server(SIZE))
    assert breaches(piped) == {("client", "NEG-5"): 1}


def test_a_welcome_that_comes_too_late_is_the_server_s_fault_alone() -> None:
    late = msg(*FALLEN_BACK, server(welcome()), client({**ASK_SIZE, "id": 1}))
    assert breaches(late) == {("server", "NEG-6"): 1}
    unversioned = ipc(server(INIT), *greeting(*ALL), server(HOST_INIT), OPENED)
    assert breaches(unversioned) == {("server", "MEM-1"): 1}


@pytest.mark.parametrize(
    "rubbish",
    [
        server(b"NaN"),
        server({**INIT, "meta": {}}),
        server({"type": "welcome", "capabilities": "all"}),
        raw("s2c", b"GET / HTTP/1.1"),
    ],
    ids=["no object", "no size", "no list of capabilities", "no packet"],
)
def test_a_server_s_rubbish_is_never_the_client_s_fault(rubbish: Step) -> None:
    steps = (client(hello(*ALL)), rubbish, server(welcome(*ALL)), server(HOST_INIT), OPENED)
    assert not any(peer == "client" for peer, _ in breaches(ipc(*steps)))
    assert not any(peer == "client" for peer, _ in breaches(msg(*GREETING, rubbish, client(POSE))))
