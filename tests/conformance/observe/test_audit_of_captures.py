"""What the audit finds in captures is what it finds in recordings, and no more where one lacks
something.
"""

import json
from pathlib import Path

import pytest
from splatbus_conformance.cli.main import main
from splatbus_conformance.observe.audit import Audit, audit, audit_capture
from splatbus_conformance.wire import capture
from splatbus_conformance.wire.capture.segments import Endpoint, Segment
from splatbus_conformance.wire.recording import Channel, Entry, load

from tests.conformance.observe.test_audit import FINDINGS, broken, exercised, recorded
from tests.conformance.rules.talk import (
    ASK_SIZE,
    POSE,
    SIZE,
    changed,
    client,
    frame,
    joined,
    server,
    session,
    talk,
)
from tests.conformance.wire.capture.writing import PORTS, SERVER, pcap, sent

DATA = Path(__file__).parents[2] / "data" / "captures"


def judged(path: Path) -> Audit:
    return audit_capture(capture.load(path, 6001, 6000))


def of_segments(segments: list[Segment]) -> Audit:
    channels: dict[int, Channel] = {PORTS["ipc"]: "ipc", PORTS["msg"]: "msg"}
    return audit_capture(capture.put_together(segments, channels))


def counts(judged: Audit) -> set[tuple[str, str, int, int]]:
    return {(it.peer, it.requirement.id, it.exercised, it.broken) for it in judged.findings}


# Real ones


def test_a_capture_says_what_the_proxy_said_of_the_same_session() -> None:
    captured, proxied = judged(DATA / "pair.pcap"), audit(load(DATA / "pair.jsonl"))
    assert broken(captured) == broken(proxied) == {}
    assert counts(captured) == counts(proxied)
    assert captured.left_over == proxied.left_over == ()
    assert captured.connections == proxied.connections == {"ipc": 2, "msg": 2}


def test_a_capture_that_begins_late() -> None:
    found = judged(DATA / "joined-late.pcapng")
    assert broken(found) == {}
    assert found.connections == {"ipc": 1, "msg": 1}
    assert exercised(found, "client")["POS-1"] == 16
    assert len(found.left_over) == 2
    assert all("begins in the middle" in line for line in found.left_over)


# Recordings as captures


@pytest.mark.parametrize("name", FINDINGS)
def test_a_recording_and_its_capture_show_the_same(name: str) -> None:
    found = of_segments(sent(recorded(name)))
    assert broken(found) == FINDINGS[name]
    assert counts(found) == counts(audit(recorded(name)))
    assert found.left_over == ()


@pytest.mark.parametrize("name", FINDINGS)
def test_a_capture_may_begin_anywhere(name: str) -> None:
    segments = sent(recorded(name))
    for begin in range(0, len(segments) - 2, max(1, len(segments) // 25)):
        found = broken(of_segments(segments[begin:])) if _talks(segments[begin:]) else {}
        assert all(found[key] <= FINDINGS[name].get(key, 0) for key in found)


@pytest.mark.parametrize("name", FINDINGS)
def test_any_segment_may_be_missing(name: str) -> None:
    segments = sent(recorded(name))
    for gap in range(len(segments)):
        found = broken(of_segments(segments[:gap] + segments[gap + 1 :]))
        assert all(found[key] <= FINDINGS[name].get(key, 0) for key in found), gap


def test_any_segment_of_the_pair_may_be_missing() -> None:
    segments = sent(load(DATA / "pair.jsonl"))
    for gap in range(0, len(segments), 3):
        assert broken(of_segments(segments[:gap] + segments[gap + 1 :])) == {}


def test_what_was_announced_in_a_gap_is_not_held_against_another_connection() -> None:
    """A size that changed while nothing was captured on the IPC channel."""
    sizes = talk("msg", client(ASK_SIZE), server(changed(SIZE, "/viewport_size", [8, 8])), start=9)
    told: list[Entry] = joined(session(server(frame(1)), server(frame(2))), sizes_of_two(sizes))
    assert ("server", "REQ-4") in broken(audit(told))
    segments = sent(told)
    gap = next(i for i, it in enumerate(segments) if b'"frame"' in it.data)
    found = of_segments(segments[:gap] + segments[gap + 1 :])
    assert broken(found) == {}


def sizes_of_two(entries: list[Entry]) -> list[Entry]:
    return [each._replace(conn=2) for each in entries]


def test_two_servers_are_two_sessions() -> None:
    asked = sent(talk("msg", client(ASK_SIZE), server(SIZE)))
    other = {SERVER: "192.168.0.3"}
    moved = [
        it._replace(**{end: (other.get(at[0], at[0]), at[1]) for end, at in ends(it).items()})
        for it in asked
    ]
    found = capture.put_together([*asked, *moved], {6000: "msg"})
    assert [len(each) for each in found.sessions] == [3, 3]
    assert audit_capture(found).connections == {"ipc": 0, "msg": 2}


def ends(it: Segment) -> dict[str, Endpoint]:
    return {"source": it.source, "target": it.target}


def test_a_fault_behind_a_gap_is_found() -> None:
    spoiled = changed(POSE, "/rotation/w", 2.0)
    segments = sent(talk("msg", *[client(POSE)] * 3, client(spoiled)))
    gap = next(i for i, it in enumerate(segments) if it.data)
    found = of_segments(segments[:gap] + segments[gap + 1 :])
    assert broken(found) == {("client", "POS-3"): 1}
    (line,) = found.left_over
    assert "segments are missing after" in line
    assert "3 messages were judged one by one, and 0 bytes not read" in line


def _talks(segments: list[Segment]) -> bool:
    return any(each.data for each in segments)


# The command


def test_the_command_judges_a_capture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, report = tmp_path / "session.jsonl", tmp_path / "report.json"
    path.write_bytes(pcap(sent(recorded("opengl-viewer"), {"ipc": 7001, "msg": 7000})))
    line = ["--plain", "audit", str(path), "--peer", "client", "--json", str(report)]
    assert main(line) == 2
    assert "it has TCP ports 7000, 7001: name yours with --ports IPC,MSG" in capsys.readouterr().out
    assert main([*line, "--ports", "7001,7000"]) == 1
    assert "client: not conforming: JSN-4 broken" in capsys.readouterr().out
    (stored,) = json.loads(report.read_text("utf-8"))
    assert stored["exitCode"] == 1
