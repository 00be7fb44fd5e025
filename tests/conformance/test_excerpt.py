"""What people are shown of a recording."""

from splatbus_conformance.excerpt import excerpt, fold
from splatbus_conformance.recording import Entry

POSE = b'\x10\x00\x00\x00{"type":"camera_pose"}'
ERROR = b'\x10\x00\x00\x00{"type":"error"}'


def test_poses_do_not_hide_what_tells() -> None:
    entries = [Entry(0.0, "msg", 1, "s2c", ERROR), *[Entry(1.0, "msg", 1, "c2s", POSE)] * 100]
    lines = list(excerpt(entries, 12))
    assert "error" in lines[0]
    assert lines[1:] == ["           and 100 poses of the testee"]


def test_where_there_are_only_poses_they_are_shown() -> None:
    lines = list(excerpt([Entry(1.0, "msg", 1, "c2s", POSE)] * 100, 5))
    assert len([line for line in lines if "camera_pose" in line]) == 5


def test_long_data_is_folded_and_its_length_told() -> None:
    folded = fold(bytes(1000))
    assert "(1000 bytes)" in folded
    assert len(folded) < 400


def test_what_is_no_letter_is_a_dot() -> None:
    assert fold(b"a\x00\x1b[31mb").startswith("|a··[31mb|")
