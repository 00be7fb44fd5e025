"""A session while it lasts: counts, rates, latencies, and judgements that see what came since."""

from pathlib import Path

import pytest
from splatbus_conformance.observe.audit import audit
from splatbus_conformance.observe.live import LiveSession
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Entry, load

RECORDINGS = Path(__file__).parents[2] / "data" / "recordings"


def said(at: float, /, direction: str, channel: str = "msg", **message: object) -> Entry:
    return Entry(at, channel, 1, direction, packet(encode(message)))  # type: ignore[arg-type]


def fed(*entries: Entry) -> LiveSession:
    live = LiveSession()
    for entry in entries:
        live.feed(entry)
    return live


def test_messages_are_counted_and_rates_are_of_the_last_seconds() -> None:
    poses = [said(t / 10, "c2s", type="camera_pose") for t in range(100)]
    live = fed(*poses)
    [line] = live.seen().lines
    assert line[:4] == ("msg", "c2s", "camera_pose", 100)
    assert line.per_second == pytest.approx(10.0, rel=0.1)
    live.now = 60.0
    assert live.seen().lines[0].per_second == 0.0


def test_latencies_are_told_by_what_was_asked() -> None:
    live = fed(
        said(0.0, "c2s", type="get_viewport_size"),
        said(0.2, "s2c", viewport_size=[64, 48]),
        said(0.3, "c2s", type="get_viewport_size"),
        said(0.7, "s2c", viewport_size=[64, 48]),
        said(1.0, "c2s", type="camera_pose", tag="a"),
        said(1.25, "s2c", "ipc", type="frame", camera={"tag": "a"}),
        said(1.5, "s2c", "ipc", type="frame", camera={"tag": "a"}),
    )
    tag, viewport = live.seen().latencies
    assert (tag.what, tag.by, tag.times) == ("camera_pose → frame", "server", 1)
    assert (viewport.what, viewport.times) == ("get_viewport_size → viewport_size", 2)
    assert viewport.p50 == pytest.approx(0.2, rel=0.06)
    assert viewport.slowest == pytest.approx(0.4)


def test_connections_are_shown_while_they_are_open_and_the_last_one_after() -> None:
    live = fed(
        Entry(0.0, "msg", 1, event="open"),
        Entry(0.1, "msg", 2, event="open"),
        Entry(0.2, "msg", 1, "c2s", event="eof"),
    )
    assert [each[1:] for each in live.seen().connections] == [
        (1, "ended", "open"),
        (2, "open", "open"),
    ]
    live.feed(Entry(0.3, "msg", 1, "s2c", event="eof"))
    assert [each.number for each in live.seen().connections] == [2]
    live.feed(Entry(0.4, "msg", 2, "s2c", event="reset"))
    assert [each[1:] for each in live.seen().connections] == [(2, "ended", "reset")]
    assert dict(live.seen().counts) == {"ipc": 0, "msg": 2}


def test_a_long_session_is_judged_by_its_beginning_and_counted_to_its_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("splatbus_conformance.observe.live.MOST_JUDGED", 10)
    live = fed(*(said(float(t), "c2s", type="get_viewport_size") for t in range(25)))
    assert live.seen().lines[0].seen == 25
    [conversation] = live.so_far()
    assert len(conversation.messages) == 10
    assert not live.is_due
    assert "15 messages after 9.000 s" in live.judged().left_over[-1]


def test_a_judgement_now_is_not_bound_by_an_earlier_one() -> None:
    """The `welcome` that had not come then has come since."""
    entries = load(RECORDINGS / "python-client.jsonl")
    live = LiveSession()
    for entry in entries:
        live.feed(entry)
        live.judged()
    assert live.judged().findings == audit(entries).findings
    assert live.judged().left_over == audit(entries).left_over


def test_judging_all_along_costs_a_few_looks_at_the_whole() -> None:
    live, judged = LiveSession(), 0
    for t in range(2000):
        live.feed(said(float(t), "c2s", type="camera_pose"))
        if live.is_due:
            judged += sum(line.seen for line in live.seen().lines)
            live.judged()
    assert judged < 10 * 2000
