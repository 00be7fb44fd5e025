"""Every rule on the replies that capabilities of 1.1 promise, kept and broken."""

from typing import Any

import pytest
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ASK_SIZE,
    PONG,
    SCENE,
    Case,
    Step,
    about_generation,
    breaches,
    changed,
    client,
    error,
    frame,
    greeting,
    joined,
    seen,
    server,
    session,
    talk,
)

GET_SCENE = {"type": "get_scene"}
RESIZE = {"type": "set_viewport", "width": 640, "height": 480}
PING = {"type": "ping", "t": 12.5}
RELEASED = client(about_generation("release", seq=1))


def msg(*steps: Step, start: float = 1.0) -> list[Entry]:
    return talk("msg", *greeting("scene", "viewport", "ping"), *steps, start=start)


def told(question: dict, answer: dict) -> list[Entry]:
    return msg(client({**question, "id": 5}), server({**answer, "id": 5}))


def sized(width: Any, height: Any) -> dict:
    return {"type": "viewport_size", "viewport_size": [width, height]}


def pings(*times: float) -> list[Step]:
    return [step for t in times for step in (client(PING), server({**PONG, "serverTime": t}))]


def rendered(*times: float) -> list[Entry]:
    (first, second) = ({**frame(1 + i), "renderedAt": t} for i, t in enumerate(times))
    return session(server(first), RELEASED, server(second))


KEPT = joined(
    rendered(1040.5, 1041.0),
    msg(
        client(GET_SCENE),
        server(SCENE),
        client(RESIZE),
        server(sized(640, 480)),
        client(ASK_SIZE),
        server(sized(640, 480)),
        *pings(1041.0, 1041.5),
        start=3.0,
    ),
)

CASES = [
    Case("SCN-2", "server", KEPT, told(GET_SCENE, changed(SCENE, "/cameras"))),
    Case("VPT-2", "server", KEPT, told(RESIZE, sized(640, 481))),
    Case("PNG-2", "server", KEPT, told(PING, {**PONG, "t": 12.25})),
    Case("PNG-3", "server", KEPT, msg(*pings(1041.0, 1040.5))),
]


@pytest.mark.parametrize("empty", [{"timeRange": None}, {"timeRange": [1, 1]}])
def test_scn_2_takes(empty: dict) -> None:
    assert breaches(told(GET_SCENE, {**SCENE, **empty})) == {}


@pytest.mark.parametrize(("question", "requirement"), [(GET_SCENE, "SCN-2"), (PING, "PNG-2")])
def test_an_error_keeps_no_promise_but_owns_up_to_a_defect(
    question: dict, requirement: str
) -> None:
    assert breaches(told(question, error("busy"))) == {("server", requirement): 1}
    assert breaches(told(question, error("internal"))) == {("server", "NEG-41"): 1}


def test_an_error_may_answer_what_was_not_agreed_or_is_broken() -> None:
    for greeted, broken in ((), "NEG-5"), (("ping",), "PNG-1"):
        ping = {"type": "ping", "id": 5} if greeted else {**PING, "id": 5}
        steps = (client(ping), server(error("unsupported", id=5)))
        found = talk("msg", *greeting(*greeted), *steps)
        assert breaches(found) == {("client", broken): 1}
        assert ("server", "PNG-2") not in seen(found)


@pytest.mark.parametrize("code", ["busy", "unsupported"])
def test_vpt_2_takes_errors(code: str) -> None:
    assert breaches(told(RESIZE, error(code))) == {}


def test_rest_of_vpt_2() -> None:
    for size in (sized(480, 640), sized("a", 480), {"type": "viewport_size"}):
        assert breaches(told(RESIZE, size)) == {("server", "VPT-2"): 1}


def test_a_size_that_was_granted_is_told_from_then_on() -> None:
    granted = (client(RESIZE), server(sized(640, 480)), client(ASK_SIZE))
    kept, broken = (joined(session(), msg(*granted, server(s), start=3.0)) for s in SIZES)
    assert breaches(kept) == {}
    assert breaches(broken) == {("server", "REQ-4"): 1}


SIZES = (sized(640, 480), sized(64, 48))


@pytest.mark.parametrize(("asked", "back"), [(3, 3.0), (2**53 + 1, 2**53), (1e300, 10**300)])
def test_png_2_compares_in_double_precision(asked: float, back: float) -> None:
    assert breaches(told({**PING, "t": asked}, {**PONG, "t": back})) == {}


def test_png_3_compares_images() -> None:
    assert breaches(rendered(1041.0, 1040.5)) == {("server", "PNG-3"): 1}


def test_png_3_compares_pongs_with_images() -> None:
    early, late = (msg(*pings(1040.75), start=start) for start in (1.0, 3.0))
    waits = [entry._replace(t=entry.t + 1) if entry.t > 1.025 else entry for entry in early]
    assert breaches(joined(rendered(1040.5, 1041.0), waits)) == {("server", "PNG-3"): 1}
    assert breaches(joined(rendered(1040.5, 1041.0), late)) == {}


def test_clocks_of_pings_on_their_way_may_be_read_in_any_order() -> None:
    first, second = ({**PONG, "id": i, "serverTime": 2.0 - i} for i in range(2))
    asked = (client({**PING, "id": 0}), client({**PING, "id": 1}))
    assert breaches(msg(*asked, server(first), server(second))) == {}
