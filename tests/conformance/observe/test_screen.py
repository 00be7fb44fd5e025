"""What the proxy shows: all that is known, at any size, and nothing that commands a terminal."""

import io
import json

import pytest
from splatbus_conformance.observe.audit import AuditFinding, audit_of
from splatbus_conformance.observe.live import LiveSession
from splatbus_conformance.observe.screen import line, screen
from splatbus_conformance.reports.console import CleanConsole
from splatbus_conformance.wire.message_kinds import CLIENT_1_0, CLIENT_1_1
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Direction, Entry


def said(at: float, direction: Direction, channel: Channel, **message: object) -> Entry:
    return Entry(at, channel, 1, direction, packet(json.dumps(message).encode()))


def session() -> LiveSession:
    live = LiveSession()
    for entry in (
        Entry(0.0, "ipc", 1, event="open"),
        Entry(0.0, "msg", 1, event="open"),
        said(0.1, "s2c", "ipc", meta={}),
        said(0.2, "c2s", "msg", type="get_viewport_size"),
        said(0.21, "s2c", "msg", viewport_size=[64, 48]),
        *(said(0.3 + i / 100, "c2s", "msg", type="camera_pose") for i in range(120)),
        Entry(1.6, "ipc", 1, "s2c", event="reset"),
    ):
        live.feed(entry)
    return live


def broken(live: LiveSession) -> list[AuditFinding]:
    return [finding for finding in audit_of(live.so_far()).findings if finding.broken]


def drawn(live: LiveSession, columns: int, rows: int, *, colour: bool = False) -> str:
    text = io.StringIO()
    out = CleanConsole(file=text, width=columns, height=rows, force_terminal=colour)
    found = broken(live)
    out.print(screen("here → there", live.seen(), found, 0.0, columns, rows))
    return text.getvalue()


@pytest.mark.parametrize("columns", [80, 140])
def test_everything_is_shown(columns: int) -> None:
    shown = drawn(session(), columns, 40)
    for part in (
        *("here → there", "0:00:01", "POS-1 (client)", "position is missing"),
        *("camera_pose", "120", "get_viewport_size → viewport_size", "10"),
        *("ipc #1", "reset", "msg #1", "open"),
    ):
        assert part in shown, part


@pytest.mark.parametrize("columns", [40, 80, 140])
@pytest.mark.parametrize("rows", [10, 24, 40])
def test_it_fits_where_it_can(columns: int, rows: int) -> None:
    shown = drawn(session(), columns, rows).splitlines()
    assert all(len(each) <= columns for each in shown)
    assert rows < 24 or len(shown) < rows


def test_with_many_kinds_the_busiest_are_shown_and_the_rest_counted() -> None:
    live = session()
    for kind in (*CLIENT_1_0, *CLIENT_1_1):
        live.feed(said(2.0, "c2s", "msg", type=kind))
    shown = drawn(live, 80, 24)
    assert len(shown.splitlines()) < 24
    assert "camera_pose" in shown
    assert "more kinds" in shown


def test_before_anything_is_said_it_says_so() -> None:
    assert "nobody has said anything yet" in drawn(LiveSession(), 80, 24)


def test_one_line_says_the_same() -> None:
    live = session()
    text = line(live.seen(), broken(live), 3.0)
    for part in ("123 messages", "ipc 0 of 1", "msg 1 of 1", "POS-1 (client)", "3 s late"):
        assert part in text, part
    assert "\n" not in text
