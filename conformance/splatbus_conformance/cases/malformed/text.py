"""Payloads that break one of JSN-1 to JSN-5, each made from a message that would have an effect.

Whoever reads them leniently takes the message for a good one, and shows it.
"""

from collections.abc import Iterator
from typing import NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.cases.valid.unknown_members import nested
from splatbus_conformance.wire.messages import Json, encode

HOPELESSLY_DEEP = 100_000
MANY = 2000
"""Bytes of a payload that is extreme."""


class BrokenText(NamedTuple):
    """A payload, and what is wrong with it."""

    requirement: str
    what: str
    payload: bytes
    kind: str = ""
    """What parsers do alike with; they part company at extremes, which are kinds of their own."""


def broken_texts(good: Json) -> list[BrokenText]:
    """Every way to break the text of the message `good`."""
    families = (_not_utf8, _no_object, _no_json, _marked, _twice, _not_finite, _too_deep)
    texts = [(family.__name__, broken) for family in families for broken in family(good)]
    return [broken._replace(kind=f"{name} {broken.kind}") for name, broken in texts]


def _with(good: Json, name: str, value: bytes) -> bytes:
    """The message, with a member at its end whose value is written as given."""
    return encode(good)[:-1] + b"," + encode({"": name})[4:-1] + b":" + value + b"}"


def _not_utf8(good: Json) -> Iterator[BrokenText]:
    parts = {
        "a byte that UTF-8 never has": b"\xff",
        "Latin-1": b"\xe9t\xe9",
        "a character cut short": b"\xe2\x82",
        "an overlong encoding": b"\xc0\xaf",
        "an encoded surrogate": b"\xed\xa0\x80",
        "a character beyond U+10FFFF": b"\xf4\x90\x80\x80",
    }
    for what, part in parts.items():
        yield BrokenText("JSN-1", f"{what} in a string", _with(good, "x", b'"' + part + b'"'))
    text = encode(good).decode()
    for encoding in ("utf-16", "utf-16-le", "utf-16-be", "utf-32-le"):
        what = f"the message in {encoding.upper()}"
        yield BrokenText("JSN-1", what, text.encode(encoding), "another encoding")


def _no_object(good: Json) -> Iterator[BrokenText]:
    payload = encode(good)
    wholes = {
        "an array around the message": b"[" + payload + b"]",
        "the message as a string": encode({"": payload.decode()})[4:-1],
        "a number": b"64",
        "a string": b'"meta"',
        "true": b"true",
        "null": b"null",
        "an empty array": b"[]",
        "white space": b" \n",
        "two objects": payload + payload,
        "nothing but NUL": b"\x00",
    }
    for what, whole in wholes.items():
        yield BrokenText("JSN-1", what, whole)


def _no_json(good: Json) -> Iterator[BrokenText]:
    payload = encode(good)
    wholes = {
        "a comma before the last brace": payload[:-1] + b",}",
        "a comma after the first brace": b"{," + payload[1:],
        "two commas": payload.replace(b",", b",,", 1),
        "a comma before a bracket": _with(good, "x", b"[1,]"),
        "no comma": payload.replace(b",", b" ", 1),
        "no colon": payload.replace(b":", b" ", 1),
        "no last brace": payload[:-1],
        "the first half": payload[: len(payload) // 2],
        "a brace too many": payload + b"}",
        "text behind it": payload + b" good",
        "NUL behind it": payload + b"\x00",
        "NUL before it": b"\x00" + payload,
        "single quotes": payload.replace(b'"', b"'"),
        "a name without quotes": payload.replace(b'"', b"", 2),
        "a comment": payload[:-1] + b"/* good */}",
        "a comment to the end of a line": payload[:-1] + b"// good\n}",
        "a no-break space between tokens": payload.replace(b",", b",\xc2\xa0", 1),
        "a form feed between tokens": payload.replace(b",", b",\x0c", 1),
    }
    for what, whole in wholes.items():
        yield BrokenText("JSN-1", what, whole)
    half_a_name = _with(good, "\ud800", b"1")
    yield BrokenText("JSN-1", "half a pair of surrogates as a name", half_a_name, "half a name")
    values = "+1 .5 5. 01 0x40 1e 1_000 -01 True None nan -NaN inf undefined nul 'x'".split()
    strings = ("\n", "\t", "\x00", "\x1f", "\\x41", "\\'", "\\u12", "\\u12G4", "\\")
    halves = (
        "\\ud800",
        "\\udc00",
        "\\ud800x",
        "\\ud800\\u0041",
        "\\udc00\\ud800",
        "\\ud83d\\ud83d\\ude42",
    )
    capitals = [half.replace("\\ud", "\\uD") for half in halves]
    spelled = (("value", values), ("string", strings), ("surrogate", halves))
    for kind, texts in (*spelled, ("surrogate in capitals", capitals)):
        for text in texts:
            value = text if kind == "value" else f'"{text}"'
            what = f"the value {value!r}"
            yield BrokenText("JSN-1", what, _with(good, "x", value.encode()), kind)


def _marked(good: Json) -> Iterator[BrokenText]:
    yield BrokenText("JSN-2", "a byte-order mark", b"\xef\xbb\xbf" + encode(good))


def _twice(good: Json) -> Iterator[BrokenText]:
    payload = encode(good)
    for name, value in good.items():
        again = encode({name: value})[1:-1]
        spoilt = encode({name: None})[1:-1]
        escaped = b'"\\u%04x' % ord(name[0]) + encode({name: value})[3:-1]
        wholes = {
            f"{name!r} twice": payload[:-1] + b"," + again + b"}",
            f"{name!r} as null, then right": b"{" + spoilt + b"," + payload[1:],
            f"{name!r} right, then as null": payload[:-1] + b"," + spoilt + b"}",
            f"{name!r} twice, once escaped": payload[:-1] + b"," + escaped + b"}",
        }
        for what, whole in wholes.items():
            yield BrokenText("JSN-3", what, whole, what.removeprefix(repr(name)))
        if isinstance(value, dict):
            inner = next(iter(value))
            doubled = encode(value)[:-1] + b"," + encode({inner: value[inner]})[1:]
            yield BrokenText(
                "JSN-3",
                f"{inner!r} twice in {name!r}",
                payload.replace(encode(value), doubled, 1),
            )
    yield BrokenText("JSN-3", "an unknown member twice", _with(good, "x", b'1,"x":1'))
    yield BrokenText("JSN-3", "a name twice in an unknown member", _with(good, "x", b'{"":1,"":2}'))


def _not_finite(good: Json) -> Iterator[BrokenText]:
    payload = encode(good)
    for old, new in (
        (b"null", b"NaN"),
        (b"0.0", b"NaN"),
        (b"0.0", b"1e400"),
        (b'"inf"', b"Infinity"),
    ):
        if old in payload:
            what = f"{new.decode()} for {old.decode()}"
            yield BrokenText(
                "JSN-4", what, payload.replace(old, new, 1), "in a member that is known"
            )
    spellings = "NaN Infinity -Infinity 1e400 -1e400 1e999999999".split()
    for spelling in (*spellings, "9" * 400, "9" * 5000):
        what = spelling if len(spelling) < 20 else f"an integer of {len(spelling)} digits"
        for where, value in (("", spelling), (" in an array", f"[{spelling}]")):
            broken = _with(good, "x", value.encode())
            yield BrokenText("JSN-4", what + where, broken, what.strip("-"))


def _too_deep(good: Json) -> Iterator[BrokenText]:
    limit: int = LIMITS["max_json_depth"]
    deep = b"[" * HOPELESSLY_DEEP
    wholes = {
        f"{limit + 1} levels": _with(good, "x", encode({"": nested(limit)})[4:-1]),
        f"{limit + 1} levels of arrays": _with(good, "x", b"[" * limit + b"]" * limit),
        f"{limit + 1} levels of objects": _with(good, "x", b'{"":' * limit + b"1" + b"}" * limit),
        "1,100 levels": _with(good, "x", b"[" * 1100 + b"]" * 1100),
        f"{HOPELESSLY_DEEP:,} levels": _with(good, "x", deep + b"]" * HOPELESSLY_DEEP),
        f"{HOPELESSLY_DEEP:,} levels that are never closed": deep,
        "10,000 objects that are never closed": b'{"":' * 10_000,
    }
    for what, whole in wholes.items():
        yield BrokenText("JSN-5", what, whole, "levels" if len(whole) < MANY else what)
