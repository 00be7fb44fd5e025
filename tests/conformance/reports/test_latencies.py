"""Latencies: questions find their answers, and histograms add up to what was measured."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.reports import latencies
from splatbus_conformance.reports.latencies import Histogram
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Direction, Entry

SECONDS = st.floats(1e-6, 1e3)


def said(
    at: float, direction: Direction, channel: Channel = "msg", conn: int = 1, **message: object
) -> Entry:
    return Entry(at, channel, conn, direction, packet(json.dumps(message).encode()))


def ask(at: float, type: str, **more: Any) -> Entry:
    return said(at, "c2s", type=type, t=0.0, **more)


SIZES_IN_ORDER = (
    ask(0.0, "get_viewport_size"),
    ask(0.1, "ping"),
    ask(0.2, "get_viewport_size"),
    said(0.3, "s2c", type="pong", t=0.0, serverTime=0.0),
    said(0.4, "s2c", viewport_size=[64, 48]),
    said(0.9, "s2c", viewport_size=[64, 48]),
)
PINGS_BY_ID = (
    ask(0.0, "ping", id=1),
    ask(0.1, "ping", id=2),
    ask(0.2, "ping", id=2, conn=2),
    said(0.3, "s2c", type="pong", id=3),
    said(0.4, "s2c", type="error", code="busy", id=2),
    said(0.5, "s2c", type="pong", id=1.0),
)
TAGS = (
    ask(0.0, "camera_pose", tag="a"),
    ask(0.1, "camera_pose", tag="b"),
    said(0.5, "s2c", "ipc", type="frame", generation=1, seq=1, camera={"tag": "b"}),
    said(0.9, "s2c", "ipc", type="frame", generation=1, seq=2, camera={"tag": "b"}),
)
IPC = (
    said(0.0, "c2s", "ipc", type="hello"),
    said(0.1, "s2c", "ipc", type="welcome", version="1.1"),
    said(0.2, "s2c", "ipc", generation=1, meta={}),
    said(1.0, "s2c", "ipc", generation=1, meta={}),
    said(1.2, "c2s", "ipc", type="opened", generation=1),
    said(1.3, "s2c", "ipc", type="frame", generation=1, seq=4),
    said(1.4, "c2s", "ipc", type="release", generation=1, seq=3),
    said(1.8, "c2s", "ipc", type="release", generation=1, seq=4),
)


def odd(name: object) -> tuple[Entry, ...]:
    names: dict[str, Any] = {"id": name, "generation": name, "seq": name, "tag": name}
    return (
        ask(0.0, "ping", **names),
        said(0.1, "s2c", "ipc", type="frame", camera=name, **names),
        said(0.2, "s2c", "ipc", type="frame", camera={"tag": name}, **names),
        said(0.3, "s2c", type="pong", **names),
    )


@pytest.mark.parametrize(
    ("side", "entries", "milliseconds"),
    [
        (
            "server",
            SIZES_IN_ORDER,
            {"get_viewport_size → viewport_size": [400, 700], "ping → pong": [200]},
        ),
        ("server", PINGS_BY_ID, {"ping → error": [300], "ping → pong": [500]}),
        ("server", TAGS, {"camera_pose → frame": [400]}),
        ("client", TAGS, {}),
        ("client", IPC, {"init packet → opened": [200], "frame → release": [500]}),
        ("server", IPC, {"hello → welcome": [100]}),
        *(
            ("server", odd(name), {"ping → pong": [300]})
            for name in ([], {}, None, 1e400, True, "\ud800", "x" * 10_000)
        ),
    ],
    ids=str,
)
def test_questions_find_their_answers(
    side: str, entries: tuple[Entry, ...], milliseconds: dict[str, list[float]]
) -> None:
    found = latencies.of(conversations(entries), side)
    told = latencies.as_json(found)
    assert [it["what"] for it in told] == sorted(milliseconds)
    for it in told:
        middles = [500 * (low + high) for low, high, _ in it["bins"]]
        assert middles == pytest.approx(milliseconds[it["what"]], rel=0.07)


def test_questions_without_answers_do_not_pile_up() -> None:
    stopwatch = latencies.Stopwatch()
    asked = [ask(0.0, "ping", id=number) for number in range(2000)]
    asked += [ask(0.0, "ping") for _ in range(2000)]
    (conversation,) = conversations(asked)
    for message in conversation.messages:
        assert not list(stopwatch.take(conversation, message))
    waiting = stopwatch._waiting.values()
    assert len(waiting) <= latencies.MOST_WAITING
    assert max(map(len, waiting)) <= latencies.MOST_WAITING


@given(st.lists(SECONDS, min_size=1), st.lists(SECONDS), st.sampled_from([0.5, 0.99]))
def test_two_histograms_add_up_to_that_of_all_and_tell_its_quantiles(
    some: list[float], others: list[float], share: float
) -> None:
    parts = Histogram(), Histogram()
    for histogram, durations in zip(parts, (some, others), strict=True):
        for seconds in durations:
            histogram.take(seconds)
    total = parts[0]
    total.add(parts[1])
    everything = sorted(some + others)
    assert total.count == len(everything)
    assert total.slowest == everything[-1]
    exact = everything[max(0, -int(-share * len(everything) // 1) - 1)]
    assert total.quantile(share) == pytest.approx(exact, rel=0.06)
    told = total.as_json()
    assert (told["count"], told["max"]) == (total.count, pytest.approx(total.slowest, rel=1e-3))
    assert sum(count for *_, count in told["bins"]) == total.count
    assert all(low < high for low, high, _ in told["bins"])
