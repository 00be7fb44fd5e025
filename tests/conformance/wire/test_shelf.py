"""What is put away comes back as it was, and a long recording takes no more memory than a short."""

import json
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.observe.audit import audit
from splatbus_conformance.wire import shelf
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Entry, load
from splatbus_conformance.wire.shelf import Picked, Row, Shelf

DATA = Path(__file__).parents[2] / "data" / "recordings"


@given(st.lists(st.binary(max_size=4)), st.lists(st.integers(-40, 40)), st.slices(20))
def test_a_row_is_a_list(given_: list[bytes], places: list[int], cut: slice) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shelf, "MOST_KEPT", 9)
        patch.setattr(shelf, "MOST_ROW", 3)
        row: Row[bytes] = Row(Shelf(lambda it: [it], lambda it: bytes(it[0]), len))
        for each in given_:
            row.extend([each])
        assert list(row) == given_
        assert len(row) == len(given_)
        assert list(row[cut]) == given_[cut]
        for place in places:
            if -len(given_) <= place < len(given_):
                assert row[place] == given_[place]
            else:
                with pytest.raises(IndexError):
                    row[place]
        picked = Picked(row, range(0, len(given_), 2))
        assert (list(picked), list(picked[1:])) == (given_[::2], given_[::2][1:])


@pytest.mark.parametrize("path", sorted(DATA.glob("*.jsonl")), ids=lambda path: path.stem)
def test_messages_come_back_as_they_were(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found, kept = audit(load(path)).findings, conversations(load(path))
    monkeypatch.setattr(shelf, "MOST_KEPT", 0)
    monkeypatch.setattr(shelf, "MOST_ROW", 2)
    monkeypatch.setattr(shelf, "MOST_FETCHED", 1)
    for one, other in zip(conversations(load(path), shelved=True), kept, strict=True):
        assert repr(list(one.placed())) == repr(list(other.placed()))
    assert audit(load(path)).findings == found


def session(poses: int) -> Iterator[Entry]:
    for number in range(poses):
        place = dict.fromkeys("xyz", number / 7)
        pose = {"type": "camera_pose", "position": place, "rotation": {**place, "w": 1.0}}
        yield Entry(number / 60, "msg", 1, "c2s", packet(json.dumps(pose).encode()))


def peak(poses: int) -> int:
    tracemalloc.start()
    try:
        assert audit(session(poses)).findings
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_long_recording_takes_no_more_memory_than_a_short_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(shelf, "MOST_KEPT", 1 << 14)
    peak(100)  # what is found once and kept
    short, long = peak(2_000), peak(4_000)
    assert long < short + 2_000 * 100, "a pose has 160 bytes, and takes 1,500 as values"
