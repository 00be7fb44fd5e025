"""Telemetry [annex A]: what is computed, what is sent to whom, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from splatbus_schemas import LIMITS
from splatbus_wire.messages import Histogram, Scalar, Text
from splatbus_wire.series import series

from tests.server.stage import Client, Stage


def subscriber(stage: Stage, *names: str) -> Client:
    """Of some series, or of all."""
    client = stage.steerer()
    client.say({"type": "subscribe_telemetry", "names": list(names) or None})
    return client


def give(stage: Stage, now: float = 0.0, /, **values: Any) -> bool:
    given = stage.session.readings.give(values, now)
    stage.catch_up()
    return given


def values(client: Client) -> list[dict[str, Any]]:
    """Of each message that it is sent."""
    return [{each["name"]: each["value"] for each in told["series"]} for told in client.hear()]


def test_nothing_is_looked_at_that_nobody_wants(stage: Stage) -> None:
    """[TEL-1, TEL-3, TEL-4]"""
    computed: list[str] = []

    def call() -> bool:
        def compute(name: str) -> float:
            computed.append(name)
            return 1.0

        return give(stage, a=lambda: compute("a"), b=lambda: compute("b"), c=math.nan)

    assert not call()
    client = subscriber(stage, "b", "unheard of")
    assert call()
    assert values(client) == [{"b": 1.0}]
    client.leave()
    assert not call()
    assert computed == ["b"]
    assert (stage.statistics.series_computed, stage.statistics.telemetry_sent) == (1, 1)


def test_who_has_not_taken_the_last_one_is_sent_the_newest_of_each_then(stage: Stage) -> None:
    """[TEL-2, TEL-5]: so that a reply comes behind one message of telemetry at most."""
    slow, prompt = subscriber(stage), subscriber(stage, "a", "b")
    for value in range(3):
        give(stage, a=value, c="only for one")
        assert values(prompt) == [{"a": value}]
    stage.session.readings.give({"b": "said once", "a": 3}, 1.0)
    give(stage, 1041.25, a=(4, "ms"))
    slow.say({"type": "get_viewport_size"})
    assert [message["type"] for message in slow.hear()] == ["telemetry", "viewport_size"]
    stage.catch_up()
    (late,) = slow.hear()
    assert (late["time"], late["seq"]) == (1041.25, 6)
    a = {"name": "a", "kind": "scalar", "value": 4, "unit": "ms"}
    assert late["series"][0] == a
    assert [each["value"] for each in late["series"][1:]] == ["only for one", "said once"]
    stage.catch_up()
    assert values(slow) == []


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (3, Scalar("x", 3.0)),
        (np.array(2.0), Scalar("x", 2.0)),
        ((np.float32(0.5), "1/s"), Scalar("x", 0.5, "1/s")),
        ("", Text("x", "")),
        (np.histogram([0.1, 0.2, 0.9], 2, (0.0, 1.0)), Histogram("x", (0.0, 0.5, 1.0), (2, 1))),
        (([2.0, 2**53 - 1], [0, 1, 4]), Histogram("x", (0.0, 1.0, 4.0), (2, 2**53 - 1))),
    ],
)
def test_readings_that_can_be_sent(value: Any, expected: Any) -> None:
    assert series("x", value) == expected


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (math.nan, "nan is not finite"),
        ((math.inf, "ms"), "inf is not finite"),
        (None, "NoneType"),
        (np.zeros(3), "scalar"),
        ((1.0, "u" * 65), "65 characters"),
        ("x" * 4097, "4097 characters"),
        ("\ud800", "surrogate"),
        (([1, 2], [0.0, 1.0]), "are not n and n \\+ 1"),
        (([], [0.0]), "are not n and n \\+ 1"),
        (([1], [[0.0, 1.0]]), "are not n and n \\+ 1"),
        (([1] * 1025, range(1026)), "of at most 1025"),
        (([1], [1.0, 1.0]), "do not ascend"),
        (([1], [0.0, math.inf]), "not finite"),
        (([-1], [0.0, 1.0]), "whole numbers"),
        (([0.5], [0.0, 1.0]), "whole numbers"),
        (([math.nan], [0.0, 1.0]), "whole numbers"),
        (([2.0**53], [0.0, 1.0]), "whole numbers"),
    ],
)
def test_what_cannot_be_sent_is_told_to_who_gave_it(stage: Stage, value: Any, message: str) -> None:
    """[TEL-2]: and harms nobody."""
    client = subscriber(stage)
    with pytest.raises(ValueError, match=f"telemetry 'x': .*{message}.*TEL-2"):
        give(stage, fine=1.0, x=lambda: value)
    assert give(stage, x=1.0)
    assert values(client) == [{"x": 1.0}]


@pytest.mark.parametrize("name", ["", "n" * 65])
def test_a_name_has_its_length(name: str) -> None:
    with pytest.raises(ValueError, match="characters"):
        series(name, 1.0)


BINS = np.arange(1025)


@pytest.mark.parametrize(
    ("count", "value"),
    [
        (LIMITS["max_series"] + 1, 1.0),
        (60, (np.full(1024, 2**53 - 1), BINS + 1 / 3)),
        (60, (np.zeros(1024), BINS)),
    ],
)
def test_more_than_a_message_or_a_packet_holds_comes_in_several(
    stage: Stage, count: int, value: Any
) -> None:
    """[TEL-2, FRM-2], and of small numbers [JSN-12]."""
    client, found = subscriber(stage), list[str]()
    given = {f"h{n}": value for n in range(count)}
    give(stage, **given)
    while received := client.hear():
        (message,) = received
        found += [each["name"] for each in message["series"]]
        stage.catch_up()
    assert found == [*given]
    assert stage.statistics.telemetry_sent == message["seq"] > 1
