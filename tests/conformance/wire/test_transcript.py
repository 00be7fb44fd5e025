"""What people are shown of a recording."""

from collections.abc import Iterable

import pytest
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Entry
from splatbus_conformance.wire.transcript import Mark, excerpt

ERROR = b'\x10\x00\x00\x00{"type":"error"}'


def pose(number: int) -> bytes:
    return packet(encode({"type": "camera_pose", "timestamp": number}))


POSES = [Entry(1.0 + number, "msg", 1, "c2s", pose(number)) for number in range(100)]


def stripped(lines: Iterable[str]) -> list[str]:
    return [line.strip() for line in lines]


def test_poses_do_not_hide_what_tells_and_the_last_is_shown() -> None:
    lines = stripped(excerpt([Entry(0.0, "msg", 1, "s2c", ERROR), *POSES], 12))
    assert lines[1] == '16 bytes: {"type":"error"}'
    assert lines[-1] == "and poses of the client, 99 times"
    assert len([line for line in lines if "camera_pose" in line]) == 1
    assert '"timestamp":99' in lines[4].replace(" ", "")


def test_poses_are_shown_where_there_is_nothing_else_or_the_harness_sends_them() -> None:
    error = Entry(200.0, "ipc", 1, "s2c", ERROR)
    for lines in (excerpt(POSES, 5), excerpt([*POSES, error], 6, ours="c2s")):
        assert sum("client → server" in line for line in lines) == 5


def test_equal_packets_are_told_once_in_one_write_and_in_many() -> None:
    flood = [
        Entry(0.0, "msg", 1, "c2s", ERROR * 8000),
        *[Entry(1.0, "msg", 1, "s2c", ERROR)] * 8000,
    ]
    lines = stripped(excerpt([*flood, Entry(2.5, "msg", 1, "c2s", event="eof")], 12))
    assert lines[1:3] == ['16 bytes: {"type":"error"}', "… 7,999 more like it"]
    assert "… 7,999 more like it, until 1.0000 s" in lines
    assert len(lines) < 12


def test_a_flood_of_different_packets_is_cut_in_its_middle_but_for_what_is_marked() -> None:
    data = b"".join(map(pose, range(1000)))
    offset = len(b"".join(map(pose, range(500))))
    entries = [Entry(0.0, "msg", 1, "c2s", data)]
    lines = list(excerpt(entries, 12, [Mark("msg", 1, "c2s", offset)]))
    assert len(lines) < 20
    [marked] = [line for line in lines if line.startswith(">") and "bytes: {" in line]
    assert '"timestamp":500' in marked.replace(" ", "")


def test_what_a_failure_is_about_is_marked_and_shown_though_it_is_long_ago() -> None:
    message = {"a": "x" * 200, "width": 0, "b": "y" * 500}
    later = [Entry(float(t), "ipc", 2, "c2s", packet(encode({"t": t}))) for t in range(1, 50)]
    entries = [Entry(0.2, "ipc", 1, "s2c", ERROR + packet(encode(message))), *later]
    lines = list(excerpt(entries, 3, [Mark("ipc", 1, "s2c", len(ERROR), "/width")]))
    head, whole, member, _ = (line for line in lines if line.startswith(">"))
    assert head == ">  0.2000 s  ipc #1  server → client"
    assert encode(message).decode() in whole, "not folded"
    at = encode(message).index(b'"width"')
    assert member.strip("> ").startswith(f"/width, from byte {at}: |")
    assert b'"width"'.hex(" ") in member
    assert any("… 46 more between" in line for line in lines)


@pytest.mark.parametrize("before", [0, 5_000, 500_000])
def test_the_member_that_matters_is_never_folded(before: int) -> None:
    message = {"a": "x" * before, "memory": {"kind": 7}, "b": "y" * 500_000}
    entries = [Entry(0.2, "ipc", 1, "s2c", packet(encode(message)))]
    text = "".join(excerpt(entries, 3, [Mark("ipc", 1, "s2c", 0, "/memory/kind")]))
    assert text.count('"kind"') == 2
    assert len(text) < 3000


def test_what_is_no_packet_is_told_by_its_length() -> None:
    two = b"\x02\x00\x00\x00{}" * 2
    lines = stripped(excerpt([Entry(0.0, "ipc", 3, "s2c", two + b"\x05\x00\x00\x00{")], 1))
    assert lines[0].endswith("ipc #3  server → client")
    assert lines[1:4] == [*["2 bytes: {}"] * 2, "5 bytes that are no whole packet: ····{"]


def test_a_packet_that_came_in_parts_is_read_as_one_and_those_of_others_are_kept_apart() -> None:
    other = Entry(0.2, "msg", 2, "c2s", ERROR)
    halves = [Entry(0.1, "msg", 1, "c2s", ERROR[:4]), other, Entry(0.3, "msg", 1, "c2s", ERROR[4:])]
    lines = stripped(excerpt(halves, 12))
    assert lines[0] == "0.1000 s  msg #1  client → server, in 2 parts"
    assert lines.count('16 bytes: {"type":"error"}') == 2


def test_what_follows_a_bad_header_is_not_read_as_headers() -> None:
    parts = b"\x00\x00\x00\x10", ERROR[4:]
    lines = stripped(excerpt([Entry(0.1, "msg", 1, "c2s", part) for part in parts], 12))
    assert "a header that announces 268,435,456 bytes" in lines
    assert '16 bytes after a header that is none: {"type":"error"}' in lines
