"""Every rule on telemetry, kept and broken."""

from typing import Any

import pytest
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ASK_SIZE,
    SIZE,
    TELEMETRY,
    Case,
    Step,
    breaches,
    changed,
    client,
    greeting,
    server,
    talk,
)

ANSWERED = (client(ASK_SIZE), server({"type": "viewport_size", **SIZE}))
TOLD = server(TELEMETRY)
NAMES = [series["name"] for series in TELEMETRY["series"]]


def wishes(names: Any) -> Step:
    return client({"type": "subscribe_telemetry", "names": names})


def agreed(*steps: Step) -> list[Entry]:
    return talk("msg", *greeting("telemetry"), *steps)


def tells(message: dict) -> list[Entry]:
    return agreed(wishes(None), server(message))


AGAIN = server(changed(TELEMETRY, "/seq", 18))
CASES = [
    Case("TEL-1", "client", agreed(wishes(["render_ms"])), agreed(wishes("render_ms"))),
    Case("TEL-2", "server", agreed(wishes(None), TOLD, AGAIN), agreed(wishes(None), TOLD, TOLD)),
    Case("TEL-3", "server", agreed(wishes(NAMES), TOLD), agreed(wishes(NAMES[1:]), TOLD)),
]


@pytest.mark.parametrize("names", [None, [], ["n" * 64], [str(n) for n in range(256)]])
def test_tel_1_takes(names: Any) -> None:
    assert breaches(agreed(wishes(names))) == {}


@pytest.mark.parametrize(
    "steps",
    [
        (TOLD,),
        (wishes([]), TOLD),
        (wishes(None), wishes([]), *ANSWERED, TOLD),
        (wishes(None), wishes(NAMES[:2]), *ANSWERED, TOLD),
        (*ANSWERED, TOLD, wishes(None)),
    ],
    ids=["before any", "none wanted", "given up", "fewer", "too early"],
)
def test_tel_3_wants_what_is_in_force(steps: tuple[Step, ...]) -> None:
    assert breaches(agreed(*steps)) == {("server", "TEL-3"): 1}


@pytest.mark.parametrize(
    "steps",
    [
        (wishes(None), wishes([]), TOLD),
        (client(ASK_SIZE), wishes([]), server({"type": "viewport_size", **SIZE})),
        (wishes(None), client(ASK_SIZE), wishes([]), ANSWERED[1], TOLD),
        (wishes(NAMES[:1]), wishes(NAMES[1:]), TOLD),
    ],
    ids=["on its way", "nothing told", "after the request", "either of two"],
)
def test_tel_3_knows_what_may_have_been_on_its_way(steps: tuple[Step, ...]) -> None:
    assert breaches(agreed(*steps)) == {}


def test_tel_3_wants_the_capability() -> None:
    unasked = talk("msg", *greeting(), wishes(None), TOLD)
    assert breaches(unasked) == {("client", "NEG-5"): 1, ("server", "TEL-3"): 1}


def test_after_a_broken_wish_nothing_is_judged() -> None:
    assert breaches(agreed(wishes("all"), TOLD)) == {("client", "TEL-1"): 1}
