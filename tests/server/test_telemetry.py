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


def subscribe(*names: str) -> dict[str, Any]:
    return {"type": "subscribe_telemetry", "names": list(names)}


EVERYTHING = {"type": "subscribe_telemetry", "names": None}


def give(stage: Stage, now: float = 0.0, /, **values: Any) -> bool:
    given = stage.readings.give(values, now)
    stage.catch_up()
    return given


def names(client: Client) -> list[list[str]]:
    return [[series["name"] for series in message["series"]] for message in client.hear()]


def test_each_is_sent_what_it_subscribed_to(stage: Stage) -> None:
    """[TEL-2, TEL-3]"""
    some, everything, none = stage.steerer(), stage.steerer(), stage.steerer()
    some.say(subscribe("render_ms", "unheard_of"))
    everything.say(EVERYTHING)
    none.say(subscribe())
    assert give(stage, 1041.25, render_ms=(3.5, "ms"), stage="training")
    (message,) = some.hear()
    render_ms = {"name": "render_ms", "kind": "scalar", "value": 3.5, "unit": "ms"}
    assert message == {"type": "telemetry", "seq": 1, "time": 1041.25, "series": [render_ms]}
    assert names(everything) == [["render_ms", "stage"]]
    assert names(none) == []
    give(stage, stage="rendering")
    assert names(some) == []
    assert everything.hear()[0]["seq"] > 1


def test_a_later_subscription_takes_the_place_of_an_earlier_one(stage: Stage) -> None:
    """[TEL-1, TEL-3]"""
    client = stage.steerer()
    for names_wanted, expected in ((["a"], [["a"]]), (["b"], [["b"]]), ([], [])):
        client.say(subscribe(*names_wanted))
        give(stage, a=1, b=2)
        assert names(client) == expected


def test_nothing_is_computed_that_nobody_wants(stage: Stage) -> None:
    """[TEL-4]: not even looked at."""
    computed: list[str] = []

    def compute(name: str) -> float:
        computed.append(name)
        return 1.0

    def call() -> bool:
        return give(stage, a=lambda: compute("a"), b=lambda: compute("b"), c=math.nan)

    assert not call()
    assert stage.statistics.series_computed == 0
    client = stage.steerer()
    client.say(subscribe("b"))
    assert call()
    assert computed == ["b"]
    assert (stage.statistics.series_computed, stage.statistics.telemetry_sent) == (1, 1)
    client.leave()
    assert not call()
    assert computed == ["b"]


def test_who_has_not_taken_the_last_one_misses_the_next(stage: Stage) -> None:
    """[TEL-5]: so that a reply comes behind one message of telemetry at most."""
    slow, prompt = stage.steerer(), stage.steerer()
    for client in (slow, prompt):
        client.say(subscribe("a", "b"))
    for value in range(3):
        give(stage, a=value)
        assert prompt.hear()[0]["series"][0]["value"] == value
    give(stage, b="said once")
    slow.say({"type": "get_viewport_size"})
    assert [message["type"] for message in slow.hear()] == ["telemetry", "viewport_size"]
    stage.catch_up()
    (late,) = slow.hear()
    assert [each["value"] for each in late["series"]] == [2, "said once"], "the newest of each"
    stage.catch_up()
    assert slow.hear() == []


def test_of_what_comes_together_the_newest_of_each_name_is_sent(stage: Stage) -> None:
    client = stage.steerer()
    client.say(EVERYTHING)
    stage.readings.give({"a": 1, "b": 1}, 1.0)
    stage.readings.give({"a": 2}, 2.0)
    stage.catch_up()
    (message,) = client.hear()
    assert message["time"] == 2.0
    assert {each["name"]: each["value"] for each in message["series"]} == {"a": 2, "b": 1}


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (3, Scalar("x", 3.0)),
        (np.float32(0.5), Scalar("x", 0.5)),
        (np.array(2.0), Scalar("x", 2.0)),
        ((7, "1/s"), Scalar("x", 7.0, "1/s")),
        ("training", Text("x", "training")),
        ("", Text("x", "")),
        (np.histogram([0.1, 0.2, 0.9], 2, (0.0, 1.0)), Histogram("x", (0.0, 0.5, 1.0), (2, 1))),
        (([2.0, 1.0], [0, 1, 4]), Histogram("x", (0.0, 1.0, 4.0), (2, 1))),
        (([2**53 - 1], [0, 1]), Histogram("x", (0.0, 1.0), (2**53 - 1,))),
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
    client = stage.steerer()
    client.say(EVERYTHING)
    with pytest.raises(ValueError, match=f"telemetry 'x': .*{message}.*TEL-2"):
        give(stage, fine=1.0, x=lambda: value)
    assert client.hear() == []
    assert give(stage, x=1.0)
    assert names(client) == [["x"]]


@pytest.mark.parametrize("name", ["", "n" * 65])
def test_a_name_has_its_length(name: str) -> None:
    with pytest.raises(ValueError, match="characters"):
        series(name, 1.0)


def test_more_series_than_a_message_has_come_in_several(stage: Stage) -> None:
    """[TEL-2]"""
    most = LIMITS["max_series"]
    client = stage.steerer()
    client.say(EVERYTHING)
    given = {f"s{n}": n for n in range(most + 1)}
    give(stage, **given)
    (first,) = client.hear()
    stage.catch_up()
    (second,) = client.hear()
    assert first["seq"] < second["seq"]
    found = [each["name"] for message in (first, second) for each in message["series"]]
    assert sorted(found) == sorted(given)
    stage.catch_up()
    assert client.hear() == []


@pytest.mark.parametrize(("count", "edge"), [(2**53 - 1, 1 / 3), (0, 0.0)])
def test_more_than_a_packet_holds_comes_in_several(stage: Stage, count: int, edge: float) -> None:
    """[FRM-2], and of small numbers [JSN-12]."""
    client = stage.steerer()
    client.say(EVERYTHING)
    edges = np.arange(1025) + edge
    given = {f"h{n}": (np.full(1024, count), edges) for n in range(60)}
    give(stage, **given)
    found: list[str] = []
    while received := names(client):
        assert len(received) == 1
        found += received[0]
        stage.catch_up()
    assert sorted(found) == sorted(given)
    assert stage.statistics.telemetry_sent > 1
