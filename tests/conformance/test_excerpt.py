"""What people are shown of a recording."""

from splatbus_conformance.excerpt import excerpt, fold
from splatbus_conformance.recording import Entry

POSE = b'\x16\x00\x00\x00{"type":"camera_pose"}'
ERROR = b'\x10\x00\x00\x00{"type":"error"}'


def test_poses_do_not_hide_what_tells() -> None:
    entries = [Entry(0.0, "msg", 1, "s2c", ERROR), *[Entry(1.0, "msg", 1, "c2s", POSE)] * 100]
    lines = list(excerpt(entries, 12))
    assert '16 bytes: {"type":"error"}' in lines[1]
    assert lines[-1].strip() == "and poses of the client, 100 times"
    assert len(lines) == 4


def test_where_there_are_only_poses_they_are_shown() -> None:
    lines = list(excerpt([Entry(1.0, "msg", 1, "c2s", POSE)] * 100, 5))
    assert len([line for line in lines if "client → server" in line]) == 5


def test_long_data_is_folded_and_its_length_told() -> None:
    folded = fold(bytes(1000))
    assert "(1000 bytes)" in folded
    assert len(folded) < 400


def test_what_cannot_be_printed_is_a_dot() -> None:
    assert fold(b"a\x00\x1b[31mb\xff").startswith("|a··[31mb·|")
    assert "\u202e" not in fold("a\u202eb".encode())


def test_packets_are_told_from_what_is_none() -> None:
    two = b"\x02\x00\x00\x00{}" * 2
    lines = list(excerpt([Entry(0.0, "ipc", 3, "s2c", two + b"\x05\x00\x00\x00{")], 1))
    assert [line.strip() for line in lines[1:4]] == [
        "2 bytes: {}",
        "2 bytes: {}",
        "5 bytes that are no whole packet: ····{",
    ]
    assert lines[0].endswith("ipc #3  server → client")


def test_a_bad_header_is_read_out() -> None:
    lines = list(excerpt([Entry(0.0, "ipc", 1, "s2c", b"\xff\xff\xff\xff")], 1))
    assert "a header that announces 4,294,967,295 bytes" in lines[1]


def test_a_packet_that_came_in_parts_is_read_as_one() -> None:
    """A client that writes header and payload apart is read as well as any other."""
    entries = [Entry(0.1, "msg", 1, "c2s", ERROR[:4]), Entry(0.2, "msg", 1, "c2s", ERROR[4:])]
    lines = [line.strip() for line in excerpt(entries, 12)]
    assert lines[0] == "0.1000 s  msg #1  client → server, in 2 parts"
    assert lines[1] == '16 bytes: {"type":"error"}'
    assert len(lines) == 3


def test_parts_of_other_streams_are_kept_apart() -> None:
    other = Entry(0.2, "msg", 2, "c2s", ERROR)
    halves = [Entry(0.1, "msg", 1, "c2s", ERROR[:9]), other, Entry(0.3, "msg", 1, "c2s", ERROR[9:])]
    lines = [line.strip() for line in excerpt(halves, 12)]
    assert lines.count('16 bytes: {"type":"error"}') == 2


def test_what_follows_a_bad_header_is_not_read_as_headers() -> None:
    header, text = b"\x00\x00\x00\x10", ERROR[4:]
    entries = [Entry(0.1, "msg", 1, "c2s", header), Entry(0.2, "msg", 1, "c2s", text)]
    lines = [line.strip() for line in excerpt(entries, 12)]
    assert "a header that announces 268,435,456 bytes" in lines
    assert '16 bytes after a header that is none: {"type":"error"}' in lines
