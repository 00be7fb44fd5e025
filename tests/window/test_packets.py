"""The log of packets."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_viewer.window import packets
from splatbus_viewer.window.packets import Packets
from splatbus_wire.framing import encode_packet


def heard(*events: tuple[str, str, bytes]) -> Packets:
    log = Packets(lambda: 1.5)
    for event in events:
        log.hear(*event)
    return log


@given(st.lists(st.binary(min_size=1, max_size=40), max_size=8), st.integers(1, 7))
def test_packets_are_cut_as_they_were_framed(payloads: list[bytes], step: int) -> None:
    stream = b"".join(map(encode_packet, payloads))
    pieces = [stream[at : at + step] for at in range(0, len(stream), step)]
    lost = [("IPC", "connected", b""), ("IPC", "received", b"\x09\0\0\0unfinished"[:9])]
    log = heard(*lost, lost[0], *(("IPC", "received", each) for each in pieces))
    assert [each.payload for each in log.newest] == payloads
    assert {each.way for each in log.newest} <= {"received"}


@pytest.mark.parametrize("token", ["secret", 'a "quoted\\ one', "ü"])
@pytest.mark.parametrize("separators", [(",", ":"), (", ", " : ")])
def test_no_token_is_kept(token: str, separators: tuple[str, str]) -> None:
    hello = {"type": "hello", "token": token, "client": {"name": "x"}}
    payload = json.dumps(hello, separators=separators).encode()
    log = heard(("message", "connected", b""), ("message", "sent", encode_packet(payload)))
    (kept,) = log.newest
    assert json.loads(kept.payload) == hello | {"token": "..."}
    for shown in (kept.summary, kept.text, kept.dump):
        assert json.dumps(token)[1:-1] not in shown


def test_the_oldest_go_when_there_are_too_many() -> None:
    log = heard(("IPC", "connected", b""))
    for number in range(packets.KEPT + 10):
        log.hear("IPC", "sent", encode_packet(str(number).encode()))
    assert len(log.newest) == packets.KEPT
    assert log.newest[0].payload == b"10"
    for _ in range(6):
        log.hear("IPC", "sent", encode_packet(bytes(1 << 20)))
    assert sum(each.size for each in log.newest) <= packets.KEPT_BYTES


def test_nothing_is_kept_while_it_is_paused_and_later_packets_are_whole() -> None:
    log = heard(("IPC", "connected", b""))
    log.is_paused = True
    log.hear("IPC", "sent", encode_packet(b"first") + encode_packet(b"second")[:6])
    log.is_paused = False
    log.hear("IPC", "sent", encode_packet(b"second")[6:])
    assert [each.payload for each in log.newest] == [b"second"]


def test_bytes_are_shown_sixteen_a_row() -> None:
    log = heard(
        ("IPC", "connected", b""), ("IPC", "sent", encode_packet(b'{"type":"x"}\x00\xff345'))
    )
    (packet,) = log.newest
    first, second = packet.dump.splitlines()
    assert first.startswith("000000  7b 22 74 79 70 65 22 3a 22 78 22 7d 00 ff 33 34 ")
    assert first.endswith('{"type":"x"}..34')
    assert second.split() == ["000010", "35", "5"]
    assert packet.size == 4 + 17
