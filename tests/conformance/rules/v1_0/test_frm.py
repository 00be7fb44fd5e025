"""Every rule on packets, kept and broken, for both peers."""

import pytest
from splatbus_conformance.rules import sightings
from splatbus_conformance.wire.recording import Direction, Entry

from tests.conformance.rules.talk import (
    ASK_SIZE,
    CLIENT_ENDS,
    SERVER_ENDS,
    SIZE,
    Case,
    Step,
    breaches,
    client,
    first_breach,
    raw,
    server,
    talk,
    text,
)

PEERS: dict[str, Direction] = {"client": "c2s", "server": "s2c"}
END = {"client": CLIENT_ENDS, "server": SERVER_ENDS}
HALF = b"\x1c\x00\x00\x00{"


def msg(*steps: Step) -> list[Entry]:
    return talk("msg", client(ASK_SIZE), server(SIZE), *steps)


def apart(peer: str) -> list[Entry]:
    if peer == "client":
        return talk("msg", *pieces("c2s", text(ASK_SIZE)), server(SIZE))
    return talk("msg", client(ASK_SIZE), *pieces("s2c", text(SIZE)))


def pieces(direction: Direction, payload: bytes) -> list[Step]:
    return [raw(direction, len(payload).to_bytes(4, "little")), raw(direction, payload)]


CASES = [
    case
    for peer, direction in PEERS.items()
    for case in (
        Case("FRM-1", peer, msg(), msg(raw(direction, HALF), END[peer])),
        Case("FRM-2", peer, msg(), msg(raw(direction, b"\x00\x00\x00\x00more"))),
        Case("FRM-7", peer, msg(), apart(peer)),
    )
]


@pytest.mark.parametrize("header", [b"\x00\x00\x00\x00", b"\x01\x00\x10\x00", b"GET ", b"\xff" * 4])
def test_frm_2_names_the_place_of_the_header(header: bytes) -> None:
    broken = msg(raw("c2s", header + b"more"), raw("c2s", b"and more"), CLIENT_ENDS)
    assert breaches(broken) == {("client", "FRM-2"): 1}
    sighting = first_breach(broken)
    assert sighting.offset == len(text(ASK_SIZE)) + 4
    assert sighting.data.startswith(header)


def test_the_longest_payload_breaks_nothing() -> None:
    longest = b'{"type":"get_viewport_size"}'.ljust(1 << 20)
    assert breaches(talk("msg", client(longest))) == {}


def test_half_a_packet_is_no_breach_while_the_stream_lasts() -> None:
    assert breaches(msg(raw("c2s", HALF))) == {}


def test_half_a_packet_is_no_breach_where_the_other_side_left_first() -> None:
    assert breaches(msg(raw("c2s", HALF), SERVER_ENDS, CLIENT_ENDS)) == {}


def test_a_header_that_arrives_with_what_comes_before_it_is_apart_too() -> None:
    first, second = text(SIZE), text(SIZE)
    joined = len(first).to_bytes(4, "little") + first + len(second).to_bytes(4, "little")
    parted = talk("msg", client(ASK_SIZE), client(ASK_SIZE), raw("s2c", joined), raw("s2c", second))
    assert breaches(parted) == {("server", "FRM-7"): 1}


def test_a_packet_cut_elsewhere_is_not_two_writes() -> None:
    whole = len(text(SIZE)).to_bytes(4, "little") + text(SIZE)
    for cut in (3, 5, len(whole) - 1):
        halves = (raw("s2c", whole[:cut]), raw("s2c", whole[cut:]))
        assert breaches(talk("msg", client(ASK_SIZE), *halves)) == {}


@pytest.mark.parametrize("following", [b"", b"\x20\x00\x00\x00"])
def test_a_length_that_counts_the_header_is_named(following: bytes) -> None:
    payload = b'{"type":"get_viewport_size"}'
    sent = (len(payload) + 4).to_bytes(4, "little") + payload + following
    found = list(sightings(talk("msg", raw("c2s", sent))))
    (named,) = [it.breach for it in found if it.requirement == "FRM-1"]
    assert named is not None
    assert named.code == "header-counted"
