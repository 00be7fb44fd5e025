"""TCP put together again: order, repetitions, overlaps, and what is missing."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_conformance.wire.capture.loose import whole_packets
from splatbus_conformance.wire.capture.segments import Segment
from splatbus_conformance.wire.capture.streams import Followed, followed
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ASK_SIZE,
    CLIENT_ENDS,
    POSE,
    SIZE,
    Step,
    client,
    server,
    talk,
    text,
)
from tests.conformance.wire.capture.writing import SERVER, sent

LISTENS = SERVER, 6000
TALK = talk(
    "msg",
    *[client({**POSE, "timestamp": n}) for n in range(4)],
    client(ASK_SIZE),
    server(SIZE),
    CLIENT_ENDS,
)


def seen(these: Iterable[Segment]) -> Followed:
    found = followed(list(these), LISTENS)
    assert found is not None
    return found


def by_client(it: Segment) -> bool:
    return it.target == LISTENS


def part(it: Segment, begin: int, end: int) -> Segment:
    data = it.data[begin:end]
    return it._replace(seq=(it.seq + begin) % 2**32, data=data, length=len(data))


def said(found: Followed, direction: str) -> bytes:
    return b"".join(it.data or b"" for it in found.pieces if it.direction == direction)


def spoken(entries: list[Entry], direction: str) -> bytes:
    return b"".join(it.data or b"" for it in entries if it.dir == direction)


def with_data(these: list[Segment]) -> list[int]:
    return [i for i, each in enumerate(these) if each.data]


def assert_whole(found: Followed) -> None:
    assert found.is_begun
    assert (found.lost, found.runs) == (None, [])
    for direction in ("c2s", "s2c"):
        assert said(found, direction) == spoken(TALK, direction)
    assert [it.event for it in found.pieces if it.event] == ["eof"]


def test_in_order() -> None:
    assert_whole(seen(sent(TALK)))


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_any_order_repetitions_and_cuts(data: st.DataObject) -> None:
    """Of one direction, behind its beginning, until the other answers."""
    whole = sent(TALK)
    head, rest = whole[:3], [each for each in whole[3:] if by_client(each) and each.data]
    tail = [it for it in whole[3:] if (it.data and not by_client(it)) or it.fin]
    parts: list[Segment] = []
    for each in rest:
        cut = data.draw(st.integers(1, len(each.data)))
        overlap = data.draw(st.integers(0, cut))
        parts.append(part(each, 0, cut))
        if cut < len(each.data):
            parts.append(part(each, cut - overlap, len(each.data)))
    again = data.draw(st.lists(st.sampled_from(parts), max_size=4))
    mixed = data.draw(st.permutations([*parts, *again]))
    assert_whole(seen([*head, *mixed, *tail]))


def test_what_was_repeated_arrived_when_nothing_was_missing_any_more() -> None:
    whole = sent(TALK)
    first, second = with_data(whole)[:2]
    late = [*whole[:first], *whole[first + 1 : second + 1], whole[first]._replace(ns=9 * 10**9)]
    found = seen([*late, *whole[second + 1 :]])
    assert [round(it.ns / 1e9, 3) for it in found.pieces][:2] == [9.0, 9.0]
    assert_whole(found)


def test_a_probe_that_keeps_a_connection_alive_says_nothing() -> None:
    whole = sent(TALK)
    at = with_data(whole)[1]
    probe = whole[at]._replace(seq=(whole[at].seq - 1) % 2**32, data=b"\0", length=1)
    assert_whole(seen([*whole[:at], probe, *whole[at:]]))


def test_the_first_syn_may_be_missing_and_not_both() -> None:
    assert_whole(seen(sent(TALK)[1:]))
    found = seen(sent(TALK)[2:])
    assert not found.is_begun
    assert found.pieces == []


@pytest.mark.parametrize("nth", range(5))
def test_a_segment_that_was_not_captured(nth: int) -> None:
    """What came before it is whole; nobody is heard to answer what was not heard."""
    whole = sent(TALK)
    gap = with_data(whole)[nth]
    found = seen([*whole[:gap], *whole[gap + 1 :]])
    kept = [spoken(TALK[: 1 + nth], "c2s"), b""]
    assert [said(found, "c2s"), said(found, "s2c")] == kept
    assert not any(it.event for it in found.pieces)
    packets = [it.data for run in found.runs for it in whole_packets(run)[0]]
    behind = [entry.data for entry in TALK[2 + nth :] if entry.data]
    assert sorted(packets, key=str) == sorted(behind, key=str)


def test_a_loss_shows_by_what_acknowledges_it() -> None:
    """The question is missing, and nothing of its sender comes after it."""
    whole = sent(talk("msg", client(ASK_SIZE), server(SIZE)))
    found = seen(each for each in whole if not (by_client(each) and each.data))
    assert found.lost is not None
    assert found.pieces == []
    ((run),) = found.runs
    assert whole_packets(run) == ([run[0]], 0)


def test_an_answer_that_was_captured_before_its_question() -> None:
    """As where a network card has several queues."""
    whole = sent(TALK)
    question, answer = with_data(whole)[-2:]
    whole.insert(question, whole.pop(answer))
    found = seen(whole)
    assert_whole(found)
    assert [it.direction for it in found.pieces if it.data] == ["c2s"] * 5 + ["s2c"]


def test_the_end_of_a_capture_is_no_loss() -> None:
    whole = sent(TALK)
    for end in range(3, len(whole)):
        assert seen(whole[:end]).lost is None


def test_numbers_begin_again_after_4_gib() -> None:
    steps: list[Step] = [client({**POSE, "timestamp": n}) for n in range(20)]
    entries = talk("msg", *steps)
    assert said(seen(sent(entries)), "c2s") == spoken(entries, "c2s")


# Packets behind a gap


def run(*parts: bytes) -> list[Any]:
    entries = talk("msg", *[Step("c2s", part) for part in parts])
    return [it for it in seen(sent(entries)).pieces if it.data]


def test_whole_packets_in_the_middle_of_a_stream() -> None:
    first, second = packet(text(POSE)), packet(text(ASK_SIZE))
    found, others = whole_packets(run(first[9:] + second[:7], second[7:] + first, second[:9]))
    assert [it.data for it in found] == [second, first]
    assert others == len(first) - 9 + 9
    assert [a.ns <= b.ns for a, b in pairwise(found)] == [True]


@pytest.mark.parametrize("junk", [b"{", bytes(50), b"\xff\xff\0\0{ and less", b"\0\0\x11\0{}"])
def test_what_is_no_packet_is_passed_over(junk: bytes) -> None:
    whole = packet(text(POSE))
    found, others = whole_packets(run(junk + whole))
    assert [it.data for it in found] == [whole]
    assert others == len(junk)


def test_acknowledgements_alone_are_no_connection() -> None:
    heard = sent(TALK)[2]
    assert heard.ack
    answer = heard._replace(source=LISTENS, target=heard.source, seq=heard.ack, ack=heard.seq)
    assert followed([heard, answer], LISTENS) is None
