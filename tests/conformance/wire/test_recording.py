"""Recordings: what is written reads back, and what breaks the format is named."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from splatbus_conformance.data import read_json
from splatbus_conformance.observe.audit import audit
from splatbus_conformance.wire.recording import RecordingError, from_line, load, to_line

DATA = Path(__file__).parents[2] / "data" / "recordings"
PAGE = Path(__file__).parents[3] / "conformance" / "RECORDING.md"
BYTES = {"t": 0.5, "channel": "msg", "conn": 1, "dir": "c2s", "hex": "1c00"}
OPEN = {"t": 0, "channel": "ipc", "conn": 2, "event": "open"}
EOF = {"t": 1.5, "channel": "ipc", "conn": 2, "dir": "s2c", "event": "eof"}


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    schema = read_json("recording.schema.json")
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


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


def test_only_line_breaks_part_lines_and_a_byte_order_mark_is_part_of_none(tmp_path: Path) -> None:
    odd = json.dumps({**BYTES, "note": "a\u2028b"}, ensure_ascii=False)
    (tmp_path / "odd.jsonl").write_text(f"{odd}\r\n{json.dumps(EOF)}\r\n", "utf-8-sig", newline="")
    assert len(load(tmp_path / "odd.jsonl")) == 2


@pytest.mark.parametrize(
    "line",
    [
        BYTES,
        OPEN,
        EOF,
        {**EOF, "event": "reset"},
        {**OPEN, "dir": "c2s"},
        {**BYTES, "hex": "", "note": "odd"},
    ],
)
def test_lines_that_are_right(line: dict[str, Any], validator: Draft202012Validator) -> None:
    assert validator.is_valid(line)
    entry = from_line(json.dumps(line))
    assert (entry.t, entry.channel, entry.conn) == (line["t"], line["channel"], line["conn"])
    assert from_line(to_line(entry)) == entry


@pytest.mark.parametrize(
    "line",
    [
        [],
        {**BYTES, "dir": None},
        {k: v for k, v in BYTES.items() if k != "hex"},
        {**BYTES, "t": "0.5"},
        {**BYTES, "t": True},
        {**BYTES, "t": 10**400},
        {**BYTES, "channel": "message"},
        {**BYTES, "conn": 1.5},
        {**BYTES, "hex": "1c0"},
        {**BYTES, "hex": "1c00\n"},
        {**BYTES, "event": "eof"},
        {**OPEN, "event": "opened"},
        {**OPEN, "dir": "up"},
        {k: v for k, v in EOF.items() if k != "dir"},
        {**BYTES, "note": None},
    ],
    ids=str,
)
def test_lines_that_are_wrong(line: Any, validator: Draft202012Validator) -> None:
    assert not validator.is_valid(line)
    with pytest.raises(ValueError, match=r"."):
        from_line(json.dumps(line))


@pytest.mark.parametrize("path", [PAGE, *sorted(DATA.glob("*.jsonl"))], ids=lambda it: it.stem)
def test_recordings_satisfy_the_schema(path: Path, validator: Draft202012Validator) -> None:
    """Also the example of the description, which breaks nothing."""
    text = path.read_text("utf-8")
    lines = (text.split("```")[1] if path == PAGE else text).strip().splitlines()
    for line in lines:
        validator.validate(json.loads(line))
    entries = [*map(from_line, lines)]
    assert [*map(from_line, map(to_line, entries))] == entries
    assert path != PAGE or not [it for it in audit(entries).findings if it.broken]
