"""Captures read as recordings."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from splatbus_conformance.wire import capture
from splatbus_conformance.wire.capture import Capture, CaptureError, is_capture, load
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ASK_SIZE,
    CLIENT_ENDS,
    INIT,
    POSE,
    SERVER_ENDS,
    SIZE,
    client,
    ends,
    joined,
    server,
    talk,
)
from tests.conformance.wire.capture.writing import pcap, sent

TALK = joined(
    talk("ipc", server(INIT), SERVER_ENDS, CLIENT_ENDS),
    talk("msg", client(ASK_SIZE), server(SIZE), client(POSE), ends("c2s", "reset")),
)
Read = Callable[..., Capture]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def read(data: bytes, ports: tuple[int, int] = (6001, 6000)) -> Capture:
        path = tmp_path / "session.pcap"
        path.write_bytes(data)
        return load(path, *ports)

    return read


def assert_same(told: list[Entry], entries: list[Entry]) -> None:
    """What a capture tells, its times from its first frame on, is what was recorded."""
    times = [each.t - entries[0].t for each in entries]
    assert [each.t for each in told] == pytest.approx(times, abs=2e-6)
    assert [each[1:] for each in told] == [each[1:] for each in entries]


# Files


@pytest.mark.parametrize("kind", ["pcap", "nsecpcap", "pcapng"])
def test_every_format(tmp_path: Path, kind: str) -> None:
    written, path = tmp_path / "written.pcap", tmp_path / "session.jsonl"
    written.write_bytes(pcap(sent(TALK)))
    subprocess.run(["editcap", "-F", kind, str(written), str(path)], check=True)
    assert is_capture(path)
    (session,), *lacking = load(path, 6001, 6000)
    assert lacking == [[], ()]
    assert_same(session, TALK)


@pytest.mark.parametrize("text", [b"", b"{", b'{"t": 0}', b"\xa1\xb2"])
def test_what_is_no_capture(tmp_path: Path, text: bytes) -> None:
    path = tmp_path / "session.jsonl"
    path.write_bytes(text)
    assert not is_capture(path)
    assert not is_capture(tmp_path)
    assert not is_capture(tmp_path / "missing")


def test_a_file_that_is_cut_short_is_judged_as_far_as_it_goes(read: Read) -> None:
    (session,), _, (line,) = read(pcap(sent(TALK))[:-7])
    assert [each[1:] for each in session] == [each[1:] for each in TALK[:-1]]
    assert "cut short in the middle of a packet" in line


def test_a_file_of_nonsense(read: Read) -> None:
    with pytest.raises(CaptureError, match=r"session\.pcap: tshark: "):
        read(pcap([])[:10])


def test_without_tshark_it_says_what_is_missing(
    read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(CaptureError, match="apt install tshark"):
        read(pcap(sent(TALK)))


def test_packets_that_were_captured_in_part(read: Read) -> None:
    """Each is known to have been longer."""
    sessions, messages, lines = read(pcap(sent(TALK), most=80))
    assert not any(entry.data for session in sessions for entry in session[2:])
    assert messages == []
    assert len(lines) == 2
    assert "segments are missing" in lines[0]


# Ports


def test_other_ports(read: Read) -> None:
    data = pcap(sent(TALK, {"ipc": 7001, "msg": 7000}))
    (session,) = read(data, (1, 7000)).sessions
    assert {entry.channel for entry in session} == {"msg"}, "one channel is enough"
    with pytest.raises(CaptureError, match=r"it has TCP ports 7000, 7001: .*--ports IPC,MSG"):
        read(data)
    with pytest.raises(CaptureError, match="no TCP at all"):
        read(pcap([]))


@pytest.mark.parametrize(("limit", "most"), [("MOST_SEGMENTS", 8), ("MOST_BYTES", 40)])
def test_what_is_too_much_is_left_over(
    read: Read, monkeypatch: pytest.MonkeyPatch, limit: str, most: int
) -> None:
    monkeypatch.setattr(capture, limit, most)
    (session,), _, (line,) = read(pcap(sent(TALK)))
    assert session == [entry for entry in session if entry.t < 0.02]
    assert line.startswith("what came after 0.0")


def test_a_refused_connection_is_none_and_the_same_ports_again_are_another(read: Read) -> None:
    knock, *_ = whole = sent(TALK)
    knock = knock._replace(source=("192.168.0.1", 50_000), seq=7)
    refusal = knock._replace(source=knock.target, target=knock.source, syn=False, rst=True, ack=8)
    again = [it._replace(seq=it.seq + 5000, ack=it.ack and it.ack + 5000) for it in whole]
    (session,) = read(pcap([knock, refusal, *whole, *again])).sessions
    assert {(entry.channel, entry.conn) for entry in session} == {
        (channel, number) for channel in ("ipc", "msg") for number in (1, 2)
    }
