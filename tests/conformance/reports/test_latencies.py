"""Latencies: questions find their answers, and histograms add up to what was measured."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.reports import latencies
from splatbus_conformance.reports.latencies import Histogram
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Direction, Entry, load

RECORDINGS = Path(__file__).parents[2] / "data" / "recordings"
SECONDS = st.floats(1e-6, 1e3)


def said(
    at: float, direction: Direction, channel: Channel = "msg", conn: int = 1, **message: object
) -> Entry:
    return Entry(at, channel, conn, direction, packet(json.dumps(message).encode()))


def took(side: str, *entries: Entry) -> dict[str, list[float]]:
    """What was timed, in milliseconds; no two of a kind may be alike."""
    found = latencies.of(conversations(entries), side)
    return {
        what: sorted(round(1000 * latencies._edge(number + 0.5)) for number in it.counts)
        for what, it in found.items()
    }


def nearly(*milliseconds: float) -> object:
    return pytest.approx(list(milliseconds), rel=0.07, abs=1)


def test_replies_answer_requests_of_their_kind_in_order() -> None:
    found = took(
        "server",
        said(0.0, "c2s", type="get_viewport_size"),
        said(0.1, "c2s", type="ping", t=0.0),
        said(0.2, "c2s", type="get_viewport_size"),
        said(0.3, "s2c", type="pong", t=0.0, serverTime=0.0),
        said(0.4, "s2c", viewport_size=[64, 48]),
        said(0.9, "s2c", viewport_size=[64, 48]),
    )
    assert found == {
        "get_viewport_size → viewport_size": nearly(400, 700),
        "ping → pong": nearly(200),
    }


def test_an_id_tells_which_request_was_answered_and_connections_are_apart() -> None:
    found = took(
        "server",
        said(0.0, "c2s", type="ping", t=0.0, id=1),
        said(0.1, "c2s", type="ping", t=0.0, id=2),
        said(0.2, "c2s", conn=2, type="ping", t=0.0, id=2),
        said(0.3, "s2c", type="pong", id=3),
        said(0.4, "s2c", type="error", code="busy", id=2),
        said(0.5, "s2c", type="pong", id=1.0),
    )
    assert found == {"ping → error": nearly(300), "ping → pong": nearly(500)}


def test_a_tag_is_timed_until_the_first_frame_that_shows_it() -> None:
    entries = (
        said(0.0, "c2s", type="camera_pose", tag="a"),
        said(0.1, "c2s", type="camera_pose", tag="b"),
        said(0.5, "s2c", "ipc", type="frame", generation=1, seq=1, camera={"tag": "b"}),
        said(0.9, "s2c", "ipc", type="frame", generation=1, seq=2, camera={"tag": "b"}),
    )
    assert took("server", *entries) == {"camera_pose → frame": nearly(400)}
    assert took("client", *entries) == {}


def test_what_a_client_does_about_memory_and_frames_is_timed() -> None:
    entries = (
        said(0.0, "c2s", "ipc", type="hello"),
        said(0.1, "s2c", "ipc", type="welcome", version="1.1"),
        said(0.2, "s2c", "ipc", generation=1, meta={}),
        said(1.0, "s2c", "ipc", generation=1, meta={}),
        said(1.2, "c2s", "ipc", type="opened", generation=1),
        said(1.3, "s2c", "ipc", type="frame", generation=1, seq=4),
        said(1.4, "c2s", "ipc", type="release", generation=1, seq=3),
        said(1.8, "c2s", "ipc", type="release", generation=1, seq=4),
    )
    assert took("client", *entries) == {
        "init packet → opened": nearly(200),
        "frame → release": nearly(500),
    }
    assert took("server", *entries) == {"hello → welcome": nearly(100)}


@pytest.mark.parametrize("id", [[], {}, None, 1e400, True, "\ud800", "x" * 10_000])
def test_nothing_that_a_peer_calls_things_stops_the_watch(id: object) -> None:
    name: dict[str, Any] = {"id": id, "generation": id, "seq": id, "tag": id}
    found = took(
        "server",
        said(0.0, "c2s", type="ping", t=0.0, **name),
        said(0.1, "s2c", "ipc", type="frame", camera=id, **name),
        said(0.2, "s2c", "ipc", type="frame", camera={"tag": id}, **name),
        said(0.3, "s2c", type="pong", **name),
    )
    assert found == {"ping → pong": nearly(300)}


def test_questions_without_answers_do_not_pile_up() -> None:
    stopwatch = latencies.Stopwatch()
    asked = [said(0.0, "c2s", type="ping", t=0.0, id=number) for number in range(2000)]
    asked += [said(0.0, "c2s", type="ping", t=0.0) for _ in range(2000)]
    (conversation,) = conversations(asked)
    for message in conversation.messages:
        assert not list(stopwatch.take(conversation, message))
    waiting = stopwatch._waiting.values()
    assert len(waiting) <= latencies.MOST_WAITING
    assert max(map(len, waiting)) <= latencies.MOST_WAITING


def test_a_recorded_session_has_latencies_of_both_peers() -> None:
    entries = load(RECORDINGS / "python-client.jsonl")
    assert latencies.of(conversations(entries), "server")


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


def test_a_histogram_is_told_in_a_report() -> None:
    histogram = Histogram()
    for seconds in (0.001, 0.0011, 0.5, 0.0):
        histogram.take(seconds)
    (told,) = latencies.as_json({"ping → pong": histogram})
    assert (told["what"], told["count"], told["max"]) == ("ping → pong", 4, 0.5)
    assert [count for _, _, count in told["bins"]] == [1, 2, 1]
    assert all(low < high for low, high, _ in told["bins"])
