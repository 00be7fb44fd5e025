"""What the audit finds in recordings of deployed programs, in captures, and where they stop."""

from pathlib import Path

import pytest
from splatbus_conformance.cli.main import main
from splatbus_conformance.observe.audit import Audit, audit, audit_capture, results
from splatbus_conformance.verdicts import Level, Verdict, worst
from splatbus_conformance.wire import capture
from splatbus_conformance.wire.capture.segments import Segment
from splatbus_conformance.wire.recording import Channel, Entry, load
from splatbus_schemas.requirements import requirements

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    ASK_SIZE,
    INIT,
    POSE,
    SIZE,
    changed,
    client,
    frame,
    joined,
    raw,
    server,
    session,
    talk,
)
from tests.conformance.wire.capture.writing import PORTS, SERVER, pcap, sent

DATA = Path(__file__).parents[2] / "data"
FINDINGS = {
    "server-init-packet": {},
    "python-client": {("client", "FRM-7"): 15, ("server", "FRM-7"): 6},
    "python-client-before-any-view": {("client", "FRM-7"): 2, ("server", "FRM-7"): 2},
    "opengl-viewer": {("client", "FRM-7"): 1, ("client", "JSN-4"): 5},
    "unity-csharp": {("client", "FRM-7"): 5, ("server", "FRM-7"): 1},
}
MESSAGES = {
    "server-init-packet": (0, 1),
    "python-client": (16, 8),
    "python-client-before-any-view": (2, 3),
    "opengl-viewer": (6, 2),
    "unity-csharp": (12, 2),
}


def recorded(name: str) -> list[Entry]:
    return load(DATA / "recordings" / f"{name}.jsonl")


def of_segments(segments: list[Segment]) -> Audit:
    channels: dict[int, Channel] = {PORTS["ipc"]: "ipc", PORTS["msg"]: "msg"}
    return audit_capture(capture.put_together(segments, channels))


def broken(judged: Audit) -> dict[tuple[str, str], int]:
    return {(f.peer, f.requirement.id): f.broken for f in judged.findings if f.broken}


def exercised(judged: Audit, peer: str) -> dict[str, int]:
    return {finding.requirement.id: finding.exercised for finding in judged.of(peer)}


def counts(judged: Audit) -> set[tuple[str, str, int, int]]:
    return {(it.peer, it.requirement.id, it.exercised, it.broken) for it in judged.findings}


# Deployed programs


@pytest.mark.parametrize("name", FINDINGS)
def test_what_deployed_programs_break_in_a_recording_and_in_its_capture(name: str) -> None:
    judged, captured = audit(recorded(name)), of_segments(sent(recorded(name)))
    assert broken(judged) == FINDINGS[name]
    read = tuple(exercised(judged, peer).get("JSN-1", 0) for peer in ("client", "server"))
    assert read == MESSAGES[name]
    assert counts(captured) == counts(judged)
    assert captured.left_over == judged.left_over == ()


def test_every_recording_is_pinned() -> None:
    assert {path.stem for path in (DATA / "recordings").glob("*.jsonl")} == set(FINDINGS)


@pytest.mark.parametrize("name", FINDINGS)
def test_a_recording_may_stop_and_a_capture_begin_anywhere_and_lack_any_segment(name: str) -> None:
    entries, segments = recorded(name), sent(recorded(name))
    cut = [audit(entries[:end]) for end in range(0, len(entries), 2)]
    cut += [of_segments(segments[:at] + segments[at + 1 :]) for at in range(len(segments))]
    some = range(0, len(segments) - 2, max(1, len(segments) // 25))
    cut += [of_segments(segments[at:]) for at in some if any(it.data for it in segments[at:])]
    for found in map(broken, cut):
        assert all(found[key] <= FINDINGS[name].get(key, 0) for key in found)


def test_findings_stand_in_the_order_of_the_specification() -> None:
    order = list(requirements("1.1"))
    found = [f.requirement.id for f in audit(recorded("python-client")).findings]
    assert found == sorted(found, key=order.index)


def test_results_for_a_report_tell_the_first_breach_with_its_place_and_bytes() -> None:
    judged = audit(recorded("opengl-viewer"))
    found = {result.requirement: result for result in results(judged, "client")}
    assert set(found) == set(exercised(judged, "client"))
    assert all(result.level is Level.PASSIVE for result in found.values())
    assert (worst(found.values()), found["FRM-7"].verdict) == (Verdict.FAIL, Verdict.WARN)
    assert worst(results(judged, "server")) is Verdict.PASS
    assert (found["POS-1"].text, found["POS-1"].evidence) == ("held 5 times of 5", ())
    numbers = found["JSN-4"]
    assert numbers.text.startswith("broken 5 times of 6; first: numbers written as strings")
    assert '7, the first "-1.0153546333312988"' in numbers.text
    place, *lines = numbers.evidence
    assert place == "msg #1, 0.7243 s, byte 45 of the client's stream, /position/x"
    text = "\n".join(lines)
    for shown in ("  f3 00 00 00 7b 22 74 79 70 65", '"x": "-1.0153546333312988"', "(247 bytes)"):
        assert shown in text


def test_the_first_breach_is_the_first_in_time() -> None:
    late, early = changed(POSE, "/rotation/w", 2.0), changed(POSE, "/rotation/w", 3.0)
    steps = talk("msg", client(POSE, 5.0), client(late)), talk("msg", client(early), conn=2)
    (finding,) = (f for f in audit(joined(*steps)).findings if f.broken)
    assert finding.first is not None
    assert (finding.broken, finding.first.place.conn) == (2, 2)


def test_what_is_left_over_is_said() -> None:
    lines = audit(
        joined(
            talk("msg", client(ASK_SIZE), client(ASK_CAMERA), raw("c2s", b"\x10\x00")),
            talk("ipc", server(INIT), raw("s2c", b"\xff" * 4), raw("s2c", b"more")),
            talk("msg", client(ASK_SIZE), server(SIZE), client({"type": "later"}), conn=2),
        )
    ).left_over
    assert set(lines) == {
        "msg #1: 2 bytes of the client, no whole packet",
        "msg #1: 2 requests without a reply",
        "ipc #1: 8 bytes of the server from a bad header on",
        "msg #2: 1 messages of unknown types",
    }


def test_an_empty_recording_shows_nothing() -> None:
    assert audit([]) == Audit((), (), ())


# Captures


def test_a_capture_says_what_the_proxy_said_of_the_same_session() -> None:
    judged = audit(load(DATA / "captures" / "pair.jsonl"))
    captured = audit_capture(capture.load(DATA / "captures" / "pair.pcap", 6001, 6000))
    assert broken(captured) == {}
    assert counts(captured) == counts(judged)
    assert captured.left_over == judged.left_over == ()
    assert captured.connections == judged.connections == {"ipc": 2, "msg": 2}


def test_a_capture_that_begins_late() -> None:
    path = DATA / "captures" / "joined-late.pcapng"
    found = audit_capture(capture.load(path, 6001, 6000))
    assert (broken(found), found.connections) == ({}, {"ipc": 1, "msg": 1})
    assert exercised(found, "client")["POS-1"] == 16
    assert ["begins in the middle" in line for line in found.left_over] == [True] * 2


def test_what_was_announced_in_a_gap_is_not_held_against_another_connection() -> None:
    """A size that changed while nothing was captured on the IPC channel."""
    other = changed(SIZE, "/viewport_size", [8, 8])
    sizes = talk("msg", client(ASK_SIZE), server(other), start=9, conn=2)
    told = joined(session(server(frame(1)), server(frame(2))), sizes)
    assert ("server", "REQ-4") in broken(audit(told))
    segments = sent(told)
    gap = next(i for i, it in enumerate(segments) if b'"frame"' in it.data)
    assert broken(of_segments(segments[:gap] + segments[gap + 1 :])) == {}


def test_two_servers_are_two_sessions() -> None:
    asked = sent(talk("msg", client(ASK_SIZE), server(SIZE)))

    def moved(end: tuple[str, int]) -> tuple[str, int]:
        return "192.168.0.3" if end[0] == SERVER else end[0], end[1]

    other = [it._replace(source=moved(it.source), target=moved(it.target)) for it in asked]
    found = capture.put_together([*asked, *other], {6000: "msg"})
    assert [len(each) for each in found.sessions] == [3, 3]
    assert audit_capture(found).connections == {"ipc": 0, "msg": 2}


def test_a_fault_behind_a_gap_is_found() -> None:
    spoiled = changed(POSE, "/rotation/w", 2.0)
    segments = sent(talk("msg", *[client(POSE)] * 3, client(spoiled)))
    gap = next(i for i, it in enumerate(segments) if it.data)
    found = of_segments(segments[:gap] + segments[gap + 1 :])
    assert broken(found) == {("client", "POS-3"): 1}
    (line,) = found.left_over
    assert "segments are missing after" in line
    assert "3 messages were judged one by one, and 0 bytes not read" in line


def test_the_command_judges_a_capture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "session.pcap"
    path.write_bytes(pcap(sent(recorded("opengl-viewer"), {"ipc": 7001, "msg": 7000})))
    line = ["--plain", "audit", str(path), "--peer", "client"]
    assert main(line) == 2
    assert "name yours with --ports IPC,MSG" in capsys.readouterr().out
    assert main([*line, "--ports", "7001,7000"]) == 1
    assert "client: not conforming: JSN-4 broken" in capsys.readouterr().out
