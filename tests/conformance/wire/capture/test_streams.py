"""TCP put together again: order, repetitions, overlaps, and what is missing."""

from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.wire.capture.loose import whole_packets
from splatbus_conformance.wire.capture.segments import Segment
from splatbus_conformance.wire.capture.streams import Followed, Piece, followed
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ASK_SIZE,
    CLIENT_ENDS,
    POSE,
    SIZE,
    client,
    server,
    talk,
    text,
)
from tests.conformance.wire.capture.writing import SERVER, sent

LISTENS = SERVER, 6000
POSES = [client({**POSE, "timestamp": n}) for n in range(20)]
TALK = talk("msg", *POSES[:4], client(ASK_SIZE), server(SIZE), CLIENT_ENDS)
WHOLE = sent(TALK)
SAID = [at for at, each in enumerate(WHOLE) if each.data]


def seen(these: Iterable[Segment]) -> Followed:
    found = followed(list(these), LISTENS)
    assert found is not None
    return found


def part(it: Segment, begin: int, end: int) -> Segment:
    data = it.data[begin:end]
    return it._replace(seq=(it.seq + begin) % 2**32, data=data, length=len(data))


def said(pieces: list[Piece], direction: str) -> bytes:
    return b"".join(it.data or b"" for it in pieces if it.direction == direction)


def spoken(entries: list[Entry], direction: str) -> bytes:
    return b"".join(it.data or b"" for it in entries if it.dir == direction)


def assert_whole(found: Followed) -> None:
    assert (found.is_begun, found.lost, found.runs) == (True, None, [])
    for direction in ("c2s", "s2c"):
        assert said(found.pieces, direction) == spoken(TALK, direction)
    assert [it.event for it in found.pieces if it.event] == ["eof"]


@given(st.data())
def test_any_order_repetitions_and_cuts(data: st.DataObject) -> None:
    """Of one direction, behind its beginning, until the other answers."""
    parts: list[Segment] = []
    for each in (WHOLE[at] for at in SAID[:-1]):
        cut = data.draw(st.integers(1, len(each.data)))
        overlap = data.draw(st.integers(0, cut))
        parts.append(part(each, 0, cut))
        if cut < len(each.data):
            parts.append(part(each, cut - overlap, len(each.data)))
    again = data.draw(st.lists(st.sampled_from(parts), max_size=4))
    mixed = data.draw(st.permutations([*parts, *again]))
    assert_whole(seen([*WHOLE[:3], *mixed, *(it for it in WHOLE[SAID[-1] :] if it.data or it.fin)]))


def test_what_was_repeated_arrived_when_nothing_was_missing_any_more() -> None:
    first, second = SAID[:2]
    late = [*WHOLE[first + 1 : second + 1], WHOLE[first]._replace(ns=9 * 10**9)]
    found = seen([*WHOLE[:first], *late, *WHOLE[second + 1 :]])
    assert [round(it.ns / 1e9, 3) for it in found.pieces][:2] == [9.0, 9.0]


def test_the_first_syn_may_be_missing_and_not_both() -> None:
    assert_whole(seen(WHOLE[1:]))
    found = seen(WHOLE[2:])
    assert (found.is_begun, found.pieces) == (False, [])


@pytest.mark.parametrize("nth", range(5))
def test_a_segment_that_was_not_captured(nth: int) -> None:
    """What came before it is whole; nobody is heard to answer what was not heard."""
    gap = SAID[nth]
    found = seen([*WHOLE[:gap], *WHOLE[gap + 1 :]])
    assert said(found.pieces, "c2s") == spoken(TALK[: 1 + nth], "c2s")
    assert not any(it.event or it.direction == "s2c" for it in found.pieces)
    packets = [it.data for run in found.runs for it in whole_packets(run)[0]]
    behind = [entry.data for entry in TALK[2 + nth :] if entry.data]
    assert sorted(packets, key=str) == sorted(behind, key=str)
    assert all(seen(WHOLE[:end]).lost is None for end in range(3, gap)), "the end is no loss"


def test_a_loss_shows_by_what_acknowledges_it() -> None:
    """The question is missing, and nothing of its sender comes after it."""
    whole = sent(talk("msg", client(ASK_SIZE), server(SIZE)))
    found = seen(each for each in whole if not (each.target == LISTENS and each.data))
    assert found.lost is not None
    ((run),) = found.runs
    assert (found.pieces, whole_packets(run)) == ([], ([run[0]], 0))


def test_an_answer_that_was_captured_before_its_question() -> None:
    """As where a network card has several queues."""
    whole = [*WHOLE]
    question, answer = SAID[-2:]
    whole.insert(question, whole.pop(answer))
    found = seen(whole)
    assert_whole(found)
    assert [it.direction for it in found.pieces if it.data] == ["c2s"] * 5 + ["s2c"]


def test_acknowledgements_alone_are_no_connection() -> None:
    heard = WHOLE[2]
    answer = heard._replace(source=LISTENS, target=heard.source, seq=heard.ack, ack=heard.seq)
    assert followed([heard, answer], LISTENS) is None


@pytest.mark.parametrize("junk", [b"{", bytes(50), b"\xff\xff\0\0{ and less", b"\0\0\x11\0{}"])
def test_what_is_no_packet_is_passed_over_in_the_middle_of_a_stream(junk: bytes) -> None:
    first, second = packet(text(POSE)), packet(text(ASK_SIZE))
    parts = first[9:] + junk + second[:7], second[7:] + first, second[:9]
    run = [Piece(ns, "c2s", each) for ns, each in enumerate(parts)]
    found, others = whole_packets(run)
    assert [(it.data, it.ns) for it in found] == [(second, 1), (first, 1)]
    assert others == len(first) - 9 + len(junk) + 9
