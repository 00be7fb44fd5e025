"""What the audit finds in captures is what it finds in recordings, and no more where one lacks
something.
"""

import json
from pathlib import Path

import pytest
from splatbus_conformance.cli.main import main
from splatbus_conformance.observe.audit import Audit, audit, audit_capture
from splatbus_conformance.wire import capture
from splatbus_conformance.wire.recording import Entry, load

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
from tests.conformance.wire.capture.writing import COOKED_2, ETHERNET, Sent, pcap, pcapng, sent

DATA = Path(__file__).parents[2] / "data" / "captures"


def judged(path: Path) -> Audit:
    return audit_capture(capture.load(path, 6001, 6000))


def of_segments(folder: Path, segments: list[Sent]) -> Audit:
    path = folder / "session.pcap"
    path.write_bytes(pcap(segments))
    return judged(path)


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
@pytest.mark.parametrize("kind", ["pcap", "pcapng"])
def test_a_recording_and_its_capture_show_the_same(tmp_path: Path, name: str, kind: str) -> None:
    path = tmp_path / "session"
    segments = sent(recorded(name))
    path.write_bytes(pcap(segments) if kind == "pcap" else pcapng(segments, [ETHERNET, COOKED_2]))
    found = judged(path)
    assert broken(found) == FINDINGS[name]
    assert counts(found) == counts(audit(recorded(name)))
    assert found.left_over == ()


@pytest.mark.parametrize("name", FINDINGS)
def test_a_capture_may_begin_anywhere(tmp_path: Path, name: str) -> None:
    segments = sent(recorded(name))
    for begin in range(0, len(segments) - 2, max(1, len(segments) // 25)):
        found = broken(of_segments(tmp_path, segments[begin:])) if _talks(segments[begin:]) else {}
        assert all(found[key] <= FINDINGS[name].get(key, 0) for key in found)


@pytest.mark.parametrize("name", FINDINGS)
def test_any_segment_may_be_missing(tmp_path: Path, name: str) -> None:
    segments = sent(recorded(name))
    for gap in range(len(segments)):
        found = broken(of_segments(tmp_path, segments[:gap] + segments[gap + 1 :]))
        assert all(found[key] <= FINDINGS[name].get(key, 0) for key in found), gap


def test_any_segment_of_the_pair_may_be_missing(tmp_path: Path) -> None:
    segments = sent(load(DATA / "pair.jsonl"))
    for gap in range(0, len(segments), 3):
        assert broken(of_segments(tmp_path, segments[:gap] + segments[gap + 1 :])) == {}


def test_what_was_announced_in_a_gap_is_not_held_against_another_connection(
    tmp_path: Path,
) -> None:
    """A size that changed while nothing was captured on the IPC channel."""
    sizes = talk("msg", client(ASK_SIZE), server(changed(SIZE, "/viewport_size", [8, 8])), start=9)
    told: list[Entry] = joined(session(server(frame(1)), server(frame(2))), sizes_of_two(sizes))
    assert ("server", "REQ-4") in broken(audit(told))
    segments = sent(told)
    gap = next(i for i, it in enumerate(segments) if b'"frame"' in it.data)
    found = of_segments(tmp_path, segments[:gap] + segments[gap + 1 :])
    assert broken(found) == {}


def sizes_of_two(entries: list[Entry]) -> list[Entry]:
    return [each._replace(conn=2) for each in entries]


def test_two_servers_are_two_sessions(tmp_path: Path) -> None:
    path = tmp_path / "two.pcap"
    asked = sent(talk("msg", client(ASK_SIZE), server(SIZE)))
    path.write_bytes(pcapng(asked) + pcapng(asked, v6=True))
    found = capture.load(path, 6001, 6000)
    assert [len(each) for each in found.sessions] == [3, 3]
    assert audit_capture(found).connections == {"ipc": 0, "msg": 2}


def test_a_fault_behind_a_gap_is_found(tmp_path: Path) -> None:
    spoiled = changed(POSE, "/rotation/w", 2.0)
    segments = sent(talk("msg", *[client(POSE)] * 3, client(spoiled)))
    gap = next(i for i, it in enumerate(segments) if it.data)
    found = of_segments(tmp_path, segments[:gap] + segments[gap + 1 :])
    assert broken(found) == {("client", "POS-3"): 1}
    (line,) = found.left_over
    assert "segments are missing after" in line
    assert "3 messages were judged one by one, and 0 bytes not read" in line


def _talks(segments: list[Sent]) -> bool:
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


def test_the_command_names_the_byte_at_which_a_capture_breaks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "session.pcap"
    path.write_bytes((DATA / "pair.pcap").read_bytes()[:1000])
    assert main(["--plain", "audit", str(path)]) == 2
    assert "session.pcap, byte 917: the file ends 83 bytes into" in capsys.readouterr().out
