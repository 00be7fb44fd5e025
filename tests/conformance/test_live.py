"""A session while it lasts: counts, rates, latencies, and judgements that see what came since."""

from pathlib import Path

import pytest
from splatbus_conformance.audit import audit
from splatbus_conformance.live import Live
from splatbus_conformance.messages import encode
from splatbus_conformance.packets import packet
from splatbus_conformance.recording import Entry, load

RECORDINGS = Path(__file__).parents[1] / "data" / "recordings"


def said(at: float, /, direction: str, channel: str = "msg", **message: object) -> Entry:
    return Entry(at, channel, 1, direction, packet(encode(message)))  # type: ignore[arg-type]


def fed(*entries: Entry) -> Live:
    live = Live()
    for entry in entries:
        live.feed(entry)
    return live


def test_messages_are_counted_and_rates_are_of_the_last_seconds() -> None:
    poses = [said(t / 10, "c2s", type="camera_pose") for t in range(100)]
    live = fed(*poses)
    [line] = live.lines()
    assert (line.channel, line.direction, line.kind, line.seen) == (
        "msg",
        "c2s",
        "camera_pose",
        100,
    )
    assert line.per_second == pytest.approx(10.0, rel=0.1)
    live.now = 60.0
    assert live.lines()[0].per_second == 0.0


def test_latencies_are_those_of_replies_in_order_and_of_tags() -> None:
    live = fed(
        said(0.0, "c2s", type="get_viewport_size"),
        said(0.1, "c2s", type="ping", t=0.0, id=7),
        said(0.2, "s2c", viewport_size=[64, 48]),
        said(0.5, "s2c", type="error", code="unsupported", message="no", id=7),
        said(1.0, "c2s", type="camera_pose", tag="a"),
        said(1.25, "s2c", "ipc", type="frame", camera={"tag": "a"}),
        said(1.5, "s2c", "ipc", type="frame", camera={"tag": "a"}),
    )
    tag, reply = sorted(live.latencies(), key=lambda latency: latency.of, reverse=True)
    assert (tag.of, tag.times, tag.p50) == ("tag", 1, 0.25)
    assert (reply.of, reply.times) == ("reply", 2)
    assert reply.p99 == pytest.approx(0.4, rel=0.05)


def test_a_judgement_now_is_not_bound_by_an_earlier_one() -> None:
    """The `welcome` that had not come then has come since."""
    entries = load(RECORDINGS / "python-client.jsonl")
    live = Live()
    for entry in entries:
        live.feed(entry)
        live.judged()
    assert live.judged() == audit(entries)


def test_judging_all_along_costs_a_few_looks_at_the_whole() -> None:
    live, judged = Live(), 0
    for t in range(2000):
        live.feed(said(float(t), "c2s", type="camera_pose"))
        if live.is_due:
            judged += sum(line.seen for line in live.lines())
            live.judged()
    assert judged < 10 * 2000


def test_a_peer_names_nothing_that_is_shown() -> None:
    live = fed(said(0.0, "c2s", type="\x1b[31mred"), Entry(0.1, "msg", 1, "c2s", packet(b"{")))
    assert [line.kind for line in live.lines()] == ["no message", "of an unknown type"]
