"""Every rule on what a client asks, kept and broken."""

import pytest
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    ASK_SIZE,
    CAMERA,
    CLIENT_ENDS,
    GREETING,
    POSE,
    SIZE,
    Case,
    Step,
    breaches,
    changed,
    client,
    greeting,
    hello,
    server,
    talk,
    welcome,
)

UNKNOWN_YET = {"viewport_size": [0, 0]}


def asks(*messages: dict | bytes) -> list[Entry]:
    return talk("msg", *(client(message) for message in messages))


def asks_size(*after: Step) -> list[Entry]:
    return talk("msg", client(ASK_SIZE), server(UNKNOWN_YET), *after)


def agreed(message: dict, capabilities: tuple[str, ...]) -> list[Entry]:
    return talk("msg", *greeting(*capabilities), client(message))


KEPT = asks(ASK_SIZE, ASK_CAMERA)
RESIZE = {"type": "set_viewport", "width": 640, "height": 480}
PING = {"type": "ping", "t": -12.5}
KEPT_1_1 = talk(
    "msg",
    *greeting("scene", "viewport", "ping"),
    *map(client, ({"type": "get_scene"}, RESIZE, PING)),
)

CASES = [
    Case("REQ-1", "client", KEPT, asks({"type": "getViewportSize"})),
    Case("REQ-2", "client", KEPT, asks(changed(ASK_CAMERA, "/cam_idx"))),
    Case("SCN-1", "client", KEPT_1_1, agreed({"type": "getScene"}, ("scene",))),
    Case("VPT-1", "client", KEPT_1_1, agreed(changed(RESIZE, "/width"), ("viewport",))),
    Case("PNG-1", "client", KEPT_1_1, agreed(changed(PING, "/t"), ("ping",))),
    Case("REQ-14", "client", KEPT, asks(ASK_SIZE, {"type": "weather"})),
    Case(
        "REQ-12",
        "client",
        asks_size(client(ASK_SIZE, pause=0.12)),
        asks_size(client(ASK_SIZE, pause=0.05)),
    ),
    Case(
        "CHN-15",
        "client",
        talk("msg", client(ASK_SIZE), CLIENT_ENDS),
        talk("msg", client(ASK_SIZE), client(POSE), client(POSE, pause=16.0), client(POSE)),
    ),
]


@pytest.mark.parametrize("index", [-1, 5.0, 2**53 - 1, -(2**53 - 1)])
def test_req_2_takes_every_safe_integer(index: object) -> None:
    assert breaches(asks(changed(ASK_CAMERA, "/cam_idx", index))) == {}


def test_an_index_as_a_string_breaks_jsn_4_alone() -> None:
    assert breaches(asks(changed(ASK_CAMERA, "/cam_idx", "0"))) == {("client", "JSN-4"): 1}


def test_an_index_without_a_type_is_meant_as_a_request() -> None:
    assert breaches(asks({"cam_idx": 0})) == {("client", "REQ-2"): 1}


@pytest.mark.parametrize("message", [{}, {"type": 5}, {"type": "get_viewport"}, {"type": None}])
def test_a_type_that_nothing_defines_breaks_req_14(message: dict) -> None:
    assert breaches(asks(message)) == {("client", "REQ-14"): 1}


def test_types_of_a_version_unknown_to_the_harness_are_not_judged() -> None:
    future = {**hello(), "versions": ["2.0", "1.1"]}
    greeted = talk("msg", client(future), server({**welcome(), "version": "2.0"}))
    assert breaches([*greeted, *talk("msg", client({"type": "weather"}), start=2.0)[1:]]) == {}
    strict = talk("msg", *GREETING, client({"type": "weather"}))
    assert breaches(strict) == {("client", "EVO-2"): 1}


def test_a_question_that_was_on_its_way_when_the_size_was_told_is_no_second_one() -> None:
    ahead = client(ASK_SIZE), client(ASK_CAMERA), server(UNKNOWN_YET), client(ASK_SIZE)
    assert "REQ-12" not in breaches(talk("msg", *ahead))


def test_a_client_that_waits_less_than_the_limit_is_not_blamed() -> None:
    assert breaches(talk("msg", client(ASK_SIZE), client(POSE, pause=14.0))) == {}


def test_a_client_whose_reply_came_late_or_spoiled_is_not_blamed_for_the_rest() -> None:
    spoiled = talk("msg", client(ASK_SIZE), server(b"{"), client(POSE, pause=20.0))
    assert breaches(spoiled) == {("server", "JSN-1"): 1}
    pipelined = talk("msg", client(ASK_SIZE), client(ASK_CAMERA), server(SIZE), server(CAMERA))
    assert breaches(pipelined) == {}


def test_a_fraction_of_zero_is_an_integer() -> None:
    assert breaches(agreed(changed(RESIZE, "/width", 640.0), ("viewport",))) == {}


def test_before_hello_requests_of_1_1_are_none() -> None:
    assert ("client", "PNG-1") not in breaches(asks({"type": "ping"}))
