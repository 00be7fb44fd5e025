"""Targets: the readers of the harness, of what was recorded, stored or sent."""

from __future__ import annotations

import atexit
import contextlib
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from splatbus_conformance.cases import script as scripts
from splatbus_conformance.observe.audit import audit
from splatbus_conformance.plan import Usage
from splatbus_conformance.reports.files import stored
from splatbus_conformance.wire import json_reading, packets, recording
from splatbus_schemas import first_bytes
from splatbus_wire.errors import ProtocolError
from splatbus_wire.framing import PacketDecoder
from splatbus_wire.json_text import parse_object

IPC_PORT, MESSAGE_PORT = 6001, 6000
LEFT_TO_OTHERS = {"JSN-12"}
"""Which the lenient reader leaves to others."""


def file(data: bytes) -> Path:
    """A file with this in it."""
    path = _folder() / "fuzzed"
    path.write_bytes(data)
    return path


@cache
def _folder() -> Path:
    folder = tempfile.TemporaryDirectory(prefix="splatbus-fuzz-")
    atexit.register(folder.cleanup)
    return Path(folder.name)


def recorded(data: bytes) -> None:
    """A recording is read, written as it was read, and judged."""
    try:
        entries = recording.load(file(data))
    except recording.RecordingError:
        return
    for entry in entries:
        again = recording.from_line(recording.to_line(entry))
        assert again._replace(t=0.0) == entry._replace(t=0.0)
        assert abs(again.t - entry.t) <= max(1e-6, 1e-9 * abs(entry.t))
    audit(entries)


def reported(data: bytes) -> None:
    """A report is read."""
    with contextlib.suppress(Usage):
        stored.load(file(data))


def scripted(data: bytes) -> None:
    """A script is read, and is the same after it was written."""
    try:
        script = scripts.load(file(data))
    except scripts.ScriptError:
        return
    text = scripts.as_text(script)
    assert scripts.as_text(scripts.from_text(text)) == text


def leniently(data: bytes) -> None:
    """What the strict reader takes, the lenient one takes as the same; what not, not unnoticed."""
    read, refused = json_reading.read(data), None
    first_bytes.misread(data)
    first_bytes.cut_short(data)
    try:
        value = parse_object(data)
    except ProtocolError as error:
        refused = error.requirement
    if refused is None:
        assert not read.faults, read.faults
        assert _with_floats(read.value) == _with_floats(value)
    else:
        assert read.faults or read.value is None or refused in LEFT_TO_OTHERS, refused


def _with_floats(value: Any) -> Any:
    """The value with every number in double precision: of long ones the one keeps the digits."""
    if isinstance(value, dict):
        return {name: _with_floats(member) for name, member in value.items()}
    if isinstance(value, list):
        return [_with_floats(item) for item in value]
    return float(value) if type(value) in (int, float) else value


def streamed(data: bytes) -> None:
    """The judge cuts a stream as the decoder does."""
    first_bytes.recognised(data)
    splitter, decoder = packets.Splitter(), PacketDecoder()
    found = [packet.payload for packet in splitter.feed(data, 0.0)]
    decoder.receive(data)
    for payload in found:
        assert decoder.next_packet() == payload
    with contextlib.suppress(ProtocolError):
        assert decoder.next_packet() is None
        assert splitter.refused is None
        assert splitter.rest == bytes(decoder.unfinished)
