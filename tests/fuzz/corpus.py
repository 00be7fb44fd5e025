"""What a target begins with: the examples of the specification, and what was found before.

`inputs/NAME.jsonl` has an input on each line: a JSON string whose characters are its bytes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from splatbus_conformance.cases import script as scripts
from splatbus_schemas import examples, names
from splatbus_wire.framing import encode_packet
from splatbus_wire.messages import Opened, Release, Welcome, encode

from tests.fuzz.targets.machines import HELLO, MARK, PROGRAM

FOLDER = Path(__file__).parent / "inputs"
ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests" / "data"
VERSIONS = ("1.0", "1.1")
MOST_RECORDED = 3000
"""Bytes of a recording that are taken."""
WORD = re.compile(rb'"[^"\\]{1,40}"(?:\s*:)?')


def found(name: str) -> list[bytes]:
    """What is kept of a target's inputs in the repository."""
    path = FOLDER / f"{name}.jsonl"
    lines = path.read_text("ascii").splitlines() if path.is_file() else []
    return [json.loads(line).encode("latin-1") for line in lines]


def keep(name: str, inputs: Iterable[bytes]) -> None:
    """Writes them there."""
    lines = [json.dumps(data.decode("latin-1")) for data in inputs]
    (FOLDER / f"{name}.jsonl").write_text("".join(line + "\n" for line in lines), "ascii")


def words(inputs: Iterable[bytes]) -> list[bytes]:
    """The strings that stand in the inputs, and the names with their colons."""
    return sorted({word for data in inputs for word in WORD.findall(data)})


def seeds(name: str) -> list[bytes]:
    """Where a target begins, whatever was found."""
    made = {
        "framing": _streams,
        "streamed": _streams,
        "server": _steps_of_clients,
        "client-of-images": _steps_of_servers,
        "client-of-messages": _steps_of_servers,
        "recorded": _recordings,
        "scripted": _scripts,
        "reported": _nothing,
    }.get(name, payloads)
    return [*made()]


@cache
def payloads() -> tuple[bytes, ...]:
    """Every example of the specification, valid or not, and every packet of `spec/vectors`."""
    listed = [
        json.dumps(example.message, ensure_ascii=False, separators=(",", ":")).encode()
        for version in VERSIONS
        for name in names(version)
        for group in examples(name, version)
        for example in group
    ]
    vectors = json.loads((ROOT / "spec" / "vectors" / "packets.json").read_text("utf-8"))
    listed += [case["payload"].encode() for case in vectors["cases"]]
    return tuple(dict.fromkeys(listed))


def _streams() -> Iterator[bytes]:
    yield b""
    yield from map(encode_packet, payloads())
    yield b"".join(map(encode_packet, payloads()[:5]))


def _steps_of_clients() -> Iterator[bytes]:
    """What clients say, each after a hello, and a whole conversation."""
    hello = encode(HELLO)[4:]
    for number, payload in enumerate(payloads()):
        yield MARK.join([b"abcd"[number % 4 : number % 4 + 1] + each for each in (hello, payload)])
        yield b"d" + payload
    opened, release = encode(Opened(1))[4:], encode(Release(1, 1))[4:]
    size = b'{"type":"set_viewport","width":8,"height":6,"id":1}'
    figures = b'{"type":"subscribe_telemetry","names":null}'
    told = [b"a" + hello, b"c" + hello, b"a" + opened, b"p", b"a" + release, b"c" + figures]
    told += [b"p", b"c" + size, b"a" + encode(Opened(2))[4:], b"r", b"t" + b"0" * 12, b"1"]
    yield MARK.join(told)
    yield b"A" + encode(HELLO) + encode(Opened(1))


def _steps_of_servers() -> Iterator[bytes]:
    """What servers say, each after a welcome, and a whole conversation."""
    agreed = encode(Welcome("1.1", PROGRAM, HELLO.capabilities))[4:]
    init = [data for data in payloads() if b'"generation":1' in data and b'"meta"' in data]
    frames = [data for data in payloads() if data.startswith(b'{"type":"frame"')]
    for payload in payloads():
        yield MARK.join([b"s" + agreed, b"q", b"s" + payload])
        yield b"s" + payload
    for packet in init[:3]:
        told = [b"s" + agreed, b"s" + packet, b"s" + frames[0], b"r", b"u0", b"c", b"t000"]
        yield MARK.join(told)
        yield b"S" + b"".join(encode_packet(data) for data in (agreed, packet, frames[0]))


def _recordings() -> Iterator[bytes]:
    for path in sorted([*(DATA / "recordings").glob("*.jsonl"), DATA / "captures" / "pair.jsonl"]):
        lines = path.read_bytes().splitlines(keepends=True)
        for first in range(0, len(lines), 6):
            yield b"".join(lines[first : first + 6])[:MOST_RECORDED]
        yield b"".join(line for line in lines if len(line) < 300)[:MOST_RECORDED]


def _scripts() -> Iterator[bytes]:
    drawn = {"bytes": b"\0", "tuple": (1, [2.5, None, True]), "text": "x"}
    cases = ((scripts.Case(True, drawn), scripts.Case(False, 3)), ())
    script = scripts.Script("client", "FRM-3", "check_x", True, cases, transcript=("a", "b"))
    yield scripts.as_text(script).encode()


def _nothing() -> Iterator[bytes]:
    yield b"{}"
