"""Captures read as recordings: every format and link, and what TCP does on the way."""

import contextlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
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
from tests.conformance.wire.capture import writing
from tests.conformance.wire.capture.writing import Sent, block, pcap, pcapng, sent

TALK = joined(
    talk("ipc", server(INIT), SERVER_ENDS, CLIENT_ENDS),
    talk("msg", client(ASK_SIZE), server(SIZE), client(POSE), ends("c2s", "reset")),
)
LINKS = {
    "Ethernet": writing.ETHERNET,
    "raw": writing.RAW,
    "null": writing.NULL,
    "loop": writing.LOOP,
    "cooked": writing.COOKED,
    "cooked 2": writing.COOKED_2,
}
FORMATS: dict[str, Callable[[int, bool], bytes]] = {
    "pcap": lambda link, v6: pcap(sent(TALK), link, v6=v6),
    "pcap, big-endian": lambda link, v6: pcap(sent(TALK), link, order=">", v6=v6),
    "pcap, ns": lambda link, v6: pcap(sent(TALK), link, nano=True, v6=v6),
    "pcap, big-endian, ns": lambda link, v6: pcap(sent(TALK), link, order=">", nano=True, v6=v6),
    "pcapng": lambda link, v6: pcapng(sent(TALK), [link], v6=v6),
    "pcapng, big-endian": lambda link, v6: pcapng(sent(TALK), [link], order=">", v6=v6),
    "pcapng, three clocks": lambda link, v6: pcapng(sent(TALK), [link] * 3, v6=v6),
    "pcapng, links of all kinds": lambda link, v6: pcapng(sent(TALK), [link, 1, 276], v6=v6),
}


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Capture]:
    def read(data: bytes, ports: tuple[int, int] = (6001, 6000)) -> Capture:
        path = tmp_path / "session.pcap"
        path.write_bytes(data)
        return load(path, *ports)

    return read


Read = Callable[..., Capture]


def assert_same(told: list[Entry], entries: list[Entry]) -> None:
    """What a capture tells, its times from its first frame on, is what was recorded."""
    times = [each.t - entries[0].t for each in entries]
    assert [each.t for each in told] == pytest.approx(times, abs=2e-6)
    assert [each[1:] for each in told] == [each[1:] for each in entries]


# Formats


@pytest.mark.parametrize("v6", [False, True], ids=["IPv4", "IPv6"])
@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("kind", FORMATS)
def test_every_format_and_link(read: Read, kind: str, link: str, v6: bool) -> None:
    (session,), *lacking = read(FORMATS[kind](LINKS[link], v6))
    assert lacking == [[], ()]
    assert_same(session, TALK)


def test_a_file_is_told_by_its_first_bytes(tmp_path: Path) -> None:
    path = tmp_path / "session.jsonl"
    for number, make in enumerate(FORMATS.values()):
        path.write_bytes(make(1, False))
        assert is_capture(path), number
    for text in (b"", b"{", b'{"t": 0}', b"\xa1\xb2"):
        path.write_bytes(text)
        assert not is_capture(path)
    assert not is_capture(tmp_path)
    assert not is_capture(tmp_path / "missing")


def test_frames_with_a_vlan_and_others(read: Read) -> None:
    frames = [writing.framed(each, vlan=True) for each in sent(TALK)]
    arp, udp = bytes(12) + b"\x08\x06" + bytes(28), bytearray(frames[0])
    udp[12 + 4 + 2 + 9] = 17
    packets = b"".join(
        block(6, bytes(12) + 2 * len(data).to_bytes(4, "little") + data + bytes(-len(data) % 4))
        for data in (arp, bytes(udp), b"", b"\x08", *frames)
    )
    (session,) = read(pcapng([]) + packets).sessions
    assert Counter(each[1:] for each in session) == Counter(each[1:] for each in TALK)


def test_a_simple_packet_has_no_time(read: Read) -> None:
    packets = b"".join(
        block(3, len(data).to_bytes(4, "little") + data + bytes(-len(data) % 4))
        for data in map(writing.framed, sent(TALK))
    )
    (session,) = read(pcapng([]) + packets).sessions
    assert {entry.t for entry in session} == {0.0}
    assert len(session) == len(TALK)


# Broken files


@pytest.mark.parametrize("kind", FORMATS)
def test_a_file_that_is_cut_short_is_told_with_its_byte(read: Read, kind: str) -> None:
    data = FORMATS[kind](1, False)
    with pytest.raises(
        CaptureError, match=r"session\.pcap, byte \d+: the file ends .*`head -c \d+"
    ):
        read(data[:-7])


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_no_bytes_make_it_fail_otherwise(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    whole = bytearray(FORMATS[data.draw(st.sampled_from(sorted(FORMATS)))](1, False))
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(4, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.getbasetemp() / "spoiled.pcap"
    path.write_bytes(whole)
    with contextlib.suppress(CaptureError):
        load(path, 6001, 6000)


def test_a_header_that_is_cut_short(read: Read) -> None:
    with pytest.raises(CaptureError, match="24 bytes, this one 10"):
        read(pcap([])[:10])


@pytest.mark.parametrize("length", [0, 8, 13, 1 << 31])
def test_a_block_of_no_length_a_block_can_have(read: Read, length: int) -> None:
    head = pcapng([])
    bad = block(6, bytes(20)).replace((32).to_bytes(4, "little"), length.to_bytes(4, "little"))
    with pytest.raises(CaptureError, match=f"byte {len(head)}: "):
        read(head + bad)


def test_a_packet_of_no_interface(read: Read) -> None:
    head = pcapng([])
    bad = block(6, (9).to_bytes(4, "little") + bytes(16))
    with pytest.raises(CaptureError, match=f"byte {len(head)}: a block that is not as it says"):
        read(head + bad)


# Ports


def test_other_ports(read: Read) -> None:
    data = pcap(sent(TALK, {"ipc": 7001, "msg": 7000}))
    assert len(read(data, (7001, 7000)).sessions[0]) == len(TALK)
    with pytest.raises(CaptureError, match=r"it has TCP ports 7000, 7001: .*--ports IPC,MSG"):
        read(data)


def test_one_channel_is_enough(read: Read) -> None:
    (session,) = read(pcap(sent(TALK)), (1, 6000)).sessions
    assert {entry.channel for entry in session} == {"msg"}


def test_nothing_at_all(read: Read) -> None:
    with pytest.raises(CaptureError, match="no TCP at all"):
        read(pcap([]))
    with pytest.raises(CaptureError, match="links of type 147 are not read"):
        read(pcap(sent(TALK), 147))


@pytest.mark.parametrize(("limit", "most"), [("MOST_SEGMENTS", 8), ("MOST_BYTES", 40)])
def test_what_is_too_much_is_left_over(
    read: Read, monkeypatch: pytest.MonkeyPatch, limit: str, most: int
) -> None:
    monkeypatch.setattr(capture, limit, most)
    (session,), _, (line,) = read(pcap(sent(TALK)))
    assert session == [entry for entry in session if entry.t < 0.02]
    assert line.startswith("what came after 0.0")


def test_a_refused_connection_is_none(read: Read) -> None:
    refused = [
        Sent(0, True, 50_000, 6001, 7, 0, writing.SYN),
        Sent(0, False, 50_000, 6001, 0, 8, writing.RST | writing.ACK),
    ]
    (session,) = read(pcap([*refused, *sent(TALK)])).sessions
    assert len(session) == len(TALK)


def test_the_same_ports_again_are_another_connection(read: Read) -> None:
    again = [each._replace(seq=each.seq + 5000, ack=each.ack + 5000) for each in sent(TALK)]
    (session,) = read(pcap([*sent(TALK), *again])).sessions
    assert {(entry.channel, entry.conn) for entry in session} == {
        (channel, number) for channel in ("ipc", "msg") for number in (1, 2)
    }
