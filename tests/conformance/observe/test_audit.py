"""What the audit finds in recordings of deployed programs, and in the same recordings spoiled."""

from collections import Counter
from pathlib import Path

import pytest
from splatbus_conformance.observe.audit import Audit, audit, results
from splatbus_conformance.verdicts import Level, Verdict, worst
from splatbus_conformance.wire.recording import Entry, load
from splatbus_schemas.requirements import requirements

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    ASK_SIZE,
    HOST_INIT,
    INIT,
    POSE,
    SIZE,
    changed,
    client,
    frame,
    greeting,
    joined,
    raw,
    server,
    session,
    talk,
)

DATA = Path(__file__).parents[2] / "data" / "recordings"

FINDINGS = {
    "server-init-packet": {},
    "python-client": {("client", "FRM-7"): 15, ("server", "FRM-7"): 6},
    "python-client-before-any-view": {
        ("client", "FRM-7"): 2,
        ("server", "FRM-7"): 2,
    },
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
    return load(DATA / f"{name}.jsonl")


def broken(judged: Audit) -> dict[tuple[str, str], int]:
    return {(f.peer, f.requirement.id): f.broken for f in judged.findings if f.broken}


def exercised(judged: Audit, peer: str) -> dict[str, int]:
    return {finding.requirement.id: finding.exercised for finding in judged.of(peer)}


def spoil(name: str, old: bytes, new: bytes) -> list[Entry]:
    """The recording with the first such bytes replaced by as many others."""
    assert len(old) == len(new)
    entries = recorded(name)
    i = next(i for i, entry in enumerate(entries) if entry.data and old in entry.data)
    data = entries[i].data or b""
    entries[i] = entries[i]._replace(data=data.replace(old, new, 1))
    return entries


# Deployed programs


@pytest.mark.parametrize("name", FINDINGS)
def test_what_deployed_programs_break(name: str) -> None:
    assert broken(audit(recorded(name))) == FINDINGS[name]


def test_every_recording_is_pinned() -> None:
    assert {path.stem for path in DATA.glob("*.jsonl")} == set(FINDINGS)


@pytest.mark.parametrize("name", FINDINGS)
def test_every_message_was_read(name: str) -> None:
    judged = audit(recorded(name))
    for peer, count in zip(("client", "server"), MESSAGES[name], strict=True):
        assert exercised(judged, peer).get("JSN-1", 0) == count
    assert judged.left_over == ()


def test_the_opengl_viewer_writes_its_numbers_as_strings() -> None:
    (finding,) = (
        f
        for f in audit(recorded("opengl-viewer")).of("client")
        if f.first is not None and f.requirement.id == "JSN-4"
    )
    assert finding.verdict is Verdict.FAIL
    assert (finding.exercised, finding.broken) == (6, 5)
    assert finding.first is not None
    place = finding.first.place
    assert (place.channel, place.conn, place.t, place.sender) == ("msg", 1, 0.724304, "client")
    assert (place.offset, place.pointer) == (45, "/position/x")
    assert str(place) == "msg #1, 0.7243 s, byte 45 of the client's stream, /position/x"
    assert '7, the first "-1.0153546333312988"' in finding.first.text
    assert "  f3 00 00 00 7b 22 74 79 70 65" in finding.first.excerpt
    assert '"x": "-1.0153546333312988"' in finding.first.excerpt
    assert "(247 bytes)" in finding.first.excerpt


def test_the_python_server_tells_no_size_before_it_renders_and_may() -> None:
    server = exercised(audit(recorded("python-client-before-any-view")), "server")
    assert server["REQ-4"] == 1


def test_two_writes_are_a_warning() -> None:
    judged = audit(recorded("unity-csharp"))
    verdicts = {f.requirement.id: f.verdict for f in judged.findings if f.broken}
    assert verdicts == {"FRM-7": Verdict.WARN}
    assert judged.connections == {"ipc": 0, "msg": 1}


def test_what_each_program_exercised() -> None:
    python = exercised(audit(recorded("python-client")), "client")
    assert [python[name] for name in ("POS-1", "POS-3", "REQ-1", "REQ-2")] == [9, 9, 2, 5]
    assert "POS-8" not in python
    unity = exercised(audit(recorded("unity-csharp")), "client")
    assert [unity[name] for name in ("POS-1", "POS-8", "POS-9")] == [10, 11, 11]
    only_init = audit(recorded("server-init-packet"))
    assert set(exercised(only_init, "client")) == {"CHN-6"}
    assert not any(name.startswith(("NEG", "MEM", "OPN", "IMG")) for name in python)


# The same, spoiled

INIT_ONLY, PYTHON, UNITY = "server-init-packet", "python-client", "unity-csharp"
SPOILS = [
    (INIT_ONLY, b"RGBA32F", b"RGBA16F", ("server", "INI-3")),
    (INIT_ONLY, b'"pitchDepth": 256', b'"pitchDepth": 512', ("server", "INI-4")),
    (INIT_ONLY, b'"offsetDepth": 0', b'"offsetDepth": 2', ("server", "INI-5")),
    (INIT_ONLY, b'"device": 0}', b'"device": []', ("server", "JSN-1")),
    (INIT_ONLY, b'"evt_done"', b'"evt_late"', ("server", "INI-1")),
    (INIT_ONLY, b"VQ==", b"VVVV", ("server", "INI-7")),
    (PYTHON, b'"w": 1.0', b'"w": 1.1', ("client", "POS-3")),
    (PYTHON, b"1e+21", b"1e+99", ("client", "POS-2")),
    (PYTHON, b'"z": 1.5', b'"z": NaN', ("client", "JSN-4")),
    (PYTHON, b'"y": 2, "z": 3', b'"z": 3, "y": 2', ("client", "POS-4")),
    (PYTHON, b"point_cloud_pose", b"point_sound_pose", ("client", "POS-1")),
    (PYTHON, b"[64, 48]", b"[64, 49]", ("server", "REQ-4")),
    (PYTHON, b"[64, 48]", b"[6.4, 8]", ("server", "REQ-3")),
    (PYTHON, b"0.981060262190407", b"9.981060262190407", ("server", "REQ-5")),
    (UNITY, b"0.1960", b"0.0160", ("client", "POS-9")),
    (UNITY, b"0.04582500085234642", b'"0.045825000852346"', ("client", "JSN-4")),
    (UNITY, b'"x":27.07174', b'"x":1,"x":2.', ("client", "JSN-3")),
    (UNITY, b'"type":"camera_pose"', b'"type":"cAMERA_pOSE"', ("client", "POS-1")),
]


@pytest.mark.parametrize(("name", "old", "new", "found"), SPOILS)
def test_one_spoiled_place_is_one_finding(
    name: str, old: bytes, new: bytes, found: tuple[str, str]
) -> None:
    expected = Counter(FINDINGS[name]) + Counter({found: 1})
    assert broken(audit(spoil(name, old, new))) == expected


def test_a_request_that_deserves_no_reply_and_has_one_is_a_fault_on_either_side() -> None:
    for old, new, found in (
        (b'"cam_idx": 5', b'"camera_": 5', [("client", "REQ-2"), ("server", "REQ-9")]),
        (b"get_viewport_size", b"get_viewport_area", [("client", "REQ-14"), ("server", "REQ-8")]),
    ):
        expected = Counter(FINDINGS[PYTHON]) + Counter(found)
        assert broken(audit(spoil(PYTHON, old, new))) == expected


def test_a_reply_that_was_lost_and_one_that_was_sent_twice() -> None:
    entries = recorded("unity-csharp")
    reply = next(e for e in entries if e.dir == "s2c" and e.data)
    without = [entry for entry in entries if entry is not reply]
    assert broken(audit(without))[("server", "REQ-7")] == 1
    at = entries.index(reply)
    twice = [*entries[: at + 1], reply, *entries[at + 1 :]]
    assert broken(audit(twice))[("server", "REQ-7")] == 1


@pytest.mark.parametrize("name", FINDINGS)
def test_a_recording_may_stop_anywhere(name: str) -> None:
    entries = recorded(name)
    for end in range(len(entries)):
        found = broken(audit(entries[:end]))
        assert all(found[key] <= FINDINGS[name].get(key, 0) for key in found)


# The report


def test_findings_stand_in_the_order_of_the_specification() -> None:
    order = list(requirements("1.1"))
    found = [f.requirement.id for f in audit(recorded("python-client")).findings]
    assert found == sorted(found, key=order.index)


def test_results_for_a_report() -> None:
    judged = audit(recorded("opengl-viewer"))
    found = {result.requirement: result for result in results(judged, "client")}
    assert set(found) == set(exercised(judged, "client"))
    assert all(result.level is Level.PASSIVE for result in found.values())
    assert worst(found.values()) is Verdict.FAIL
    assert found["POS-1"].text == "held 5 times of 5"
    assert found["POS-1"].evidence == ()
    assert found["JSN-4"].text.startswith("broken 5 times of 6; first: numbers written as strings")
    assert found["JSN-4"].evidence[0].startswith("msg #1, 0.7243 s")
    assert found["FRM-7"].verdict is Verdict.WARN
    assert worst(results(judged, "server")) is Verdict.PASS


def test_the_first_breach_is_the_first_in_time() -> None:
    late, early = changed(POSE, "/rotation/w", 2.0), changed(POSE, "/rotation/w", 3.0)
    judged = audit(
        joined(talk("msg", client(POSE, 5.0), client(late)), talk("msg", client(early), conn=2))
    )
    (finding,) = (f for f in judged.findings if f.broken)
    assert finding.first is not None
    assert (finding.broken, finding.first.place.conn) == (2, 2)


def test_a_breach_of_a_stream_shows_its_bytes() -> None:
    judged = audit(talk("msg", client(ASK_SIZE), raw("c2s", b"GET / HTTP/1.1\r\n")))
    (finding,) = (f for f in judged.findings if f.broken)
    assert finding.first is not None
    assert finding.first.place.offset == 33
    assert [line.strip("> ") for line in finding.first.excerpt.splitlines()] == [
        "a header that announces 542,393,671 bytes: GET / HTTP/1.1··",
        "47 45 54 20 2f 20 48 54 54 50 2f 31 2e 31 0d 0a",
    ]


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


def test_a_session_of_1_1_that_breaks_nothing() -> None:
    steps = (client({"type": "release", "generation": 1, "seq": 1}), server(frame(2)))
    judged = audit(session(server(frame(1)), *steps))
    assert broken(judged) == {}
    names = set(exercised(judged, "client")) | set(exercised(judged, "server"))
    assert {"NEG-1", "NEG-6", "MEM-9", "OPN-1", "IMG-1", "IMG-2", "IMG-12"} <= names


def test_rules_of_1_1_bind_whoever_begins_to_speak_it() -> None:
    hasty = talk("ipc", *greeting("host_shm"), server(changed(HOST_INIT, "/ring")))
    assert broken(audit(hasty)) == {("server", "MEM-8"): 1}
