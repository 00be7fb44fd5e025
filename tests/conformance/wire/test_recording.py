"""Recordings: what is written reads back, and what breaks the format is named."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from splatbus_conformance.data import read_json
from splatbus_conformance.observe.audit import audit
from splatbus_conformance.wire.recording import (
    Entry,
    RecordingError,
    from_line,
    load,
    to_line,
)
from splatbus_conformance.wire.saving import save

DATA = Path(__file__).parents[2] / "data" / "recordings"
BYTES = {"t": 0.5, "channel": "msg", "conn": 1, "dir": "c2s", "hex": "1c00"}
OPEN = {"t": 0, "channel": "ipc", "conn": 2, "event": "open"}
EOF = {"t": 1.5, "channel": "ipc", "conn": 2, "dir": "s2c", "event": "eof"}

TIMES = st.integers(0, 10**9).map(lambda micro: micro / 1e6)
CHANNELS, DIRECTIONS = st.sampled_from(["ipc", "msg"]), st.sampled_from(["c2s", "s2c"])
EVENTS = st.sampled_from(["eof", "reset"])
ENTRIES = st.tuples(
    TIMES, CHANNELS, st.integers(1, 9), DIRECTIONS, st.binary(max_size=20), st.none()
) | st.tuples(TIMES, CHANNELS, st.integers(1, 9), DIRECTIONS, st.none(), EVENTS)


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    schema = read_json("recording.schema.json")
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@settings(deadline=None, max_examples=100)
@given(st.lists(ENTRIES.map(Entry._make), max_size=5))
def test_what_is_written_reads_back(entries: list[Entry]) -> None:
    assert [from_line(to_line(entry)) for entry in entries] == entries


def test_files(tmp_path: Path) -> None:
    entries = [Entry(0.0, "msg", 1, event="open"), Entry(0.25, "msg", 1, "c2s", b"\x00\xff")]
    save(entries, tmp_path / "session.jsonl")
    assert load(tmp_path / "session.jsonl") == entries


def test_a_file_that_breaks_the_format_is_named_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "bad.jsonl").write_text(f"{json.dumps(OPEN)}\n\n{json.dumps(BYTES)[:-1]}\n")
    with pytest.raises(RecordingError, match=r"bad\.jsonl, line 3: "):
        load(tmp_path / "bad.jsonl")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\x1c\x00\xff", "byte 2 is not UTF-8"),
        (json.dumps(OPEN).encode("utf-16"), "it is UTF-16"),
        (json.dumps(OPEN).encode("utf-16-le"), "it is UTF-16"),
        (gzip.compress(json.dumps(OPEN).encode()), "it is compressed with gzip"),
        (b"\x28\xb5\x2f\xfd\0", "it is compressed with zstd"),
    ],
)
def test_a_file_that_is_no_text_is_named(tmp_path: Path, data: bytes, words: str) -> None:
    (tmp_path / "bad.jsonl").write_bytes(data)
    with pytest.raises(RecordingError, match=rf"bad\.jsonl: {words}"):
        load(tmp_path / "bad.jsonl")


def test_a_byte_order_mark_is_no_part_of_the_first_line(tmp_path: Path) -> None:
    (tmp_path / "marked.jsonl").write_text(json.dumps(OPEN), "utf-8-sig")
    assert len(load(tmp_path / "marked.jsonl")) == 1


def test_only_line_breaks_part_lines(tmp_path: Path) -> None:
    odd = json.dumps({**BYTES, "note": "a\u2028b"}, ensure_ascii=False)
    (tmp_path / "odd.jsonl").write_bytes(f"{odd}\r\n{json.dumps(EOF)}\r\n".encode())
    assert len(load(tmp_path / "odd.jsonl")) == 2


@pytest.mark.parametrize(
    "line", [BYTES, OPEN, EOF, {**OPEN, "dir": "c2s"}, {**BYTES, "hex": "", "note": "odd"}]
)
def test_lines_that_are_right(line: dict[str, Any], validator: Draft202012Validator) -> None:
    assert validator.is_valid(line)
    entry = from_line(json.dumps(line))
    assert (entry.t, entry.channel, entry.conn) == (line["t"], line["channel"], line["conn"])


@pytest.mark.parametrize(
    "line",
    [
        [],
        {},
        {**BYTES, "t": "0.5"},
        {**BYTES, "t": True},
        {**BYTES, "t": 10**400},
        {**BYTES, "channel": "message"},
        {**BYTES, "conn": 1.5},
        {**BYTES, "conn": None},
        {**BYTES, "dir": "up"},
        {**BYTES, "dir": None},
        {k: v for k, v in BYTES.items() if k != "dir"},
        {**BYTES, "hex": "1c0"},
        {**BYTES, "hex": "1c 00"},
        {**BYTES, "hex": "1c00\n"},
        {**BYTES, "hex": 28},
        {**BYTES, "event": "eof"},
        {**OPEN, "event": "opened"},
        {**OPEN, "dir": "up"},
        {k: v for k, v in EOF.items() if k != "dir"},
        {**BYTES, "note": None},
        {k: v for k, v in BYTES.items() if k != "hex"},
    ],
    ids=str,
)
def test_lines_that_are_wrong(line: Any, validator: Draft202012Validator) -> None:
    assert not validator.is_valid(line)
    with pytest.raises(ValueError, match=r"."):
        from_line(json.dumps(line))


@pytest.mark.parametrize("line", ["", "nonsense", "[" * 100_000, '{"t":NaN,"channel":"ipc"}'])
def test_lines_that_are_no_json(line: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        from_line(line)


def test_the_example_of_the_description_is_a_recording(validator: Draft202012Validator) -> None:
    text = (Path(__file__).parents[3] / "conformance" / "RECORDING.md").read_text("utf-8")
    lines = text.split("```")[1].strip().splitlines()
    for line in lines:
        validator.validate(json.loads(line))
    judged = audit(map(from_line, lines))
    assert [f.requirement.id for f in judged.findings if f.broken] == []
    assert "REQ-7" in {f.requirement.id for f in judged.of("server")}


@pytest.mark.parametrize("path", sorted(DATA.glob("*.jsonl")), ids=lambda path: path.stem)
def test_recordings_satisfy_the_schema(path: Path, validator: Draft202012Validator) -> None:
    for line in path.read_text("utf-8").splitlines():
        validator.validate(json.loads(line))
    assert [from_line(to_line(entry)) for entry in load(path)] == load(path)
