"""The clients for engines read and print what the wire does: vectors, and what is in none."""

import math
import random
import struct
import subprocess
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from splatbus_schemas.prose import CHECKOUT
from splatbus_schemas.types.__main__ import main as write_types
from splatbus_wire.errors import ProtocolError
from splatbus_wire.json_text import parse_object

from tests.csharp.compiled import FOLDER
from tests.engines.built import CPP, Command, answers, built, compiled_cpp
from tests.wire.payloads import edited, payload_of

VECTORS = CHECKOUT / "spec" / "vectors"
TRIED = {"numbers": 85, "framing": 42, "packets": 33, "conventions": 8, "poses": 41, "images": 56}
"""Cases of these files at least; of all others, only the numbers."""
WHOLE = (
    b'{"type":"frame","seq":17,"camera":{"position":[0.25,-1e-3,4],"tag":"\\u00e9\\ud83d\\ude00"}}',
    '{"é":[true,false,null,{"a":{},"b":[]}],"😀":-0.0,"c":1.5E+2}'.encode(),
    b'{"names":{"a":1,"b":2,"c":3,"d":4,"e":5,"f":6,"g":7,"h":8,"i":9,"j":10,"k":11,"l":12,'
    b'"m":13,"n":14,"o":15,"p":16,"q":17,"r":18}}',
)


@pytest.mark.parametrize("name", ["viewer", "adapter"])
def test_each_cpp_program_has_what_it_needs(name: str) -> None:
    """By itself: what the tests run has them in one, after that for the vectors."""
    compiled_cpp(CPP / "programs" / f"{name}.cpp", options=["-fsyntax-only"])


@pytest.mark.parametrize("file", sorted(VECTORS.glob("[!v]*.json")), ids=lambda each: each.stem)
def test_vectors(file: Path, program: Command) -> None:
    done = subprocess.run([*program, str(file)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    numbers, cases = (int(part.split()[0]) for part in done.stdout.split(",")[:2])
    assert cases >= TRIED.get(file.stem, 0)
    assert numbers or cases


def test_a_thread_that_waits_hears_what_is_said_while_it_wakes(program: Command) -> None:
    done = subprocess.run(
        [*program, "--wakes", "20000"], capture_output=True, text=True, timeout=120
    )
    assert done.stdout == "heard\n", done.stdout + done.stderr


@pytest.mark.parametrize(
    ("language", "file"),
    [
        ("csharp", FOLDER / "SplatBus.Client" / "Wire.cs"),
        ("cpp", CPP / "include" / "splatbus" / "wire.hpp"),
    ],
)
def test_the_types_are_those_of_the_metamodel(language: str, file: Path, tmp_path: Path) -> None:
    made = tmp_path / "made"
    assert write_types([language, "--output", str(made)]) == 0
    assert file.read_text("utf-8") == made.read_text("utf-8")


def test_numbers_are_read_and_printed_to_the_last_bit(program: Command) -> None:
    """[ACC-1, ACC-14]: any double in its shortest form, in 17 digits, and in more than can be."""
    draw = random.Random(1)
    values = [struct.unpack("<d", draw.randbytes(8))[0] for _ in range(20_000)]
    values += [draw.uniform(-100, 100) for _ in range(20_000)]
    values += [math.ldexp(draw.randrange(1 << 52), -1074) for _ in range(2_000)]
    values += [
        float(draw.randrange(1 << 53)) * 10.0 ** draw.randrange(-30, 30) for _ in range(9_999)
    ]
    values += [6929495644600919.5, 5e-324, 1.7976931348623157e308, 2.0**63, 0.1, 9007199254740993.0]
    finite = [each for each in values if math.isfinite(each)]
    forms = [form(each) for each in finite for form in (repr, "{:.17g}".format, "{:.30e}".format)]
    forms += [halfway(each) for each in finite[:5_000]]
    payloads = [
        f'{{"a":[{",".join(forms[i : i + 100])}]}}'.encode() for i in range(0, len(forms), 100)
    ]
    lines = answers(program, payloads)
    rewritten = [each for line in lines for each in again(line)["a"]]
    told = [each for line in lines for each in line.split()[1:-1]]
    assert len(told) == len(rewritten) == len(forms)
    for form, bits, printed in zip(forms, told, rewritten, strict=True):
        (read,) = struct.unpack(">d", int(bits, 16).to_bytes(8, "big"))
        assert (read, math.copysign(1, read)) == (float(form), math.copysign(1, float(form))), form
        assert printed == read, form


def again(line: str) -> dict[str, Any]:
    """What our writer made of a payload that was taken."""
    return parse_object(payload_of(bytes.fromhex(line.split()[-1])), 65_536)


def halfway(value: float) -> str:
    """The decimal exactly between a double and the next, which ties to even."""
    with localcontext() as context:
        context.prec = 1200
        return str((Decimal(value) + Decimal(math.nextafter(value, 0.0))) / 2)


@settings(
    max_examples=8,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    deadline=None,
    phases=[Phase.generate],
)
@given(payloads=st.lists(edited(*WHOLE), min_size=100, max_size=200))
def test_texts_are_taken_and_refused_as_the_wire_does(
    payloads: list[bytes], program: Command
) -> None:
    for payload, told in zip(payloads, answers(program, payloads), strict=True):
        assert told.startswith("taken ") == is_taken(payload), (payload, told)
        if told.startswith("taken "):
            assert again(told) == parse_object(payload, 65_536)


EDGES = [
    b'{"a":1,"\\u0061":2}',
    b'{"a":{' + b",".join(b'"%d":1' % each for each in range(40)) + b"}}",
    b'{"a":{' + b",".join(b'"%d":1' % (each % 40) for each in range(41)) + b"}}",
    *(b'{"a":1e400}', b'{"a":1.7976931348623158e308}', b'{"a":NaN}'),
    *(b'{"a":' + n * b"[" + n * b"]" + b"}" for n in (63, 64)),
    *(b'{"a":[' + b",".join([b"1"] * n) + b"]}" for n in (65_534, 65_535)),
    *(b'{"a":"\\ud800"}', b'{"a":"\xed\xa0\x80"}', b'{"a":"\xc0\xaf"}', b'{"a":"\xe0\x80\xaf"}'),
    *(b'{"a":"\xf0\x80\x80\xaf"}', b'{"a":"\xf4\x90\x80\x80"}', b'{"a":"\xc3"}'),
    *(b'{"a":1,}', b'{"a":01}', b"[1]", b'{"a":1', b'{"a":1} {}'),
    b'{"a\\u0000\\u001f":"\\"\\\\\\/\\b\\n\x7f\xc2\x80\xdf\xbf\xe0\xa0\x80\xef\xbf\xbf\xf4\x8f\xbf\xbf"}',
]


def test_what_is_at_an_edge_is_taken_or_refused_for_the_requirement_that_the_wire_names(
    program: Command,
) -> None:
    for payload, told in zip(EDGES, answers(program, EDGES), strict=True):
        if is_taken(payload):
            assert again(told) == parse_object(payload, 65_536)
        else:
            with pytest.raises(ProtocolError) as refused:
                parse_object(payload, 65_536)
            assert told.startswith("refused: ")
            assert refused.value.requirement in told
            assert " at byte " in told


def test_the_cpp_client_knows_a_text_of_the_programs_own(tmp_path: Path) -> None:
    """[JSN-1]: what nobody could read is not sent."""
    draw = random.Random(2)
    pieces = ["a", "\x00", "é", "\u07ff", "\u0800", "\uffff", "\U00010000", "\U0010ffff"]
    whole = [each.encode() for each in pieces]
    whole += [
        b"\xed\xa0\x80",
        b"\xc0\x80",
        b"\xe0\x9f\xbf",
        b"\xf0\x8f\xbf\xbf",
        b"\xf4\x90\x80\x80",
    ]
    texts = [b"".join(draw.choices(whole, k=draw.randrange(1, 8))) for _ in range(3_000)]
    texts += [each[: draw.randrange(1, len(each) + 1)] for each in texts]
    program = [*built("cpp", "Tests", tmp_path), "--texts"]
    told = answers(program, texts)
    for text, answer in zip(texts, told, strict=True):
        try:
            good = 1 <= len(text.decode()) <= 5
        except UnicodeDecodeError:
            good = False
        assert (answer == "text") == good, text
    assert set(told) == {"text", "none"}


def is_taken(payload: bytes) -> bool:
    try:
        parse_object(payload, 65_536)
    except ProtocolError:
        return False
    return True
