"""Spell a JSON value in the ways that RFC 8259 allows, without changing it (JSN-6).

Each choice is taken from a `Random`: a text takes hundreds, and drawn one by one by Hypothesis they
would take longer than the testee that reads it.
"""

import itertools
import json
from collections.abc import Container
from decimal import Decimal
from random import Random
from typing import Any

SHORT_ESCAPES = {
    '"': '\\"',
    "\\": "\\\\",
    "/": "\\/",
    "\b": "\\b",
    "\f": "\\f",
    "\n": "\\n",
    "\r": "\\r",
    "\t": "\\t",
}
ODD_TEXT = 'a/b\\c"d\b\f\n\r\t\x00\x1f\x7fé\u2028東京🙂\U0010ffff'
"""A string with all that may be escaped, and characters of one, two and more units."""
LIBERTIES = ("order of members", "white space", "escapes", "digits and exponents")
"""What a spelling is free in; each can be left as `json.dumps` has it."""
ORDER, SPACE, ESCAPES, DIGITS = LIBERTIES
SPACES = " \t\n\r"
GAPS: tuple[str, ...] = (
    *("",) * 128,
    *SPACES * 16,
    *("".join(each) for each in itertools.product(SPACES, repeat=3)),
)
"""Half of them nothing, a quarter one, a quarter three: a table, since a text has hundreds."""
LONGEST_PLAIN = 40
"""Digits on either side of the point beyond which a number is written with an exponent."""


class Plain(int):
    """An integer that is always written in plain decimal digits, as REQ-3 asks."""


def spell(value: Any, random: Random, liberties: Container[str] = LIBERTIES) -> str:
    """One text that means `value`, spelled freely in so far as `liberties` say."""
    gap = _gap if SPACE in liberties else lambda random: ""
    return f"{gap(random)}{_token(value, random, liberties)}{gap(random)}"


def spell_in_utf_8(value: Any) -> bytes:
    """A text without escapes, whose characters take as many bytes as they do in UTF-8."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def _token(value: Any, random: Random, liberties: Container[str]) -> str:
    gap = _gap if SPACE in liberties else lambda random: ""
    if isinstance(value, dict):
        members = list(value.items())
        if ORDER in liberties:
            random.shuffle(members)
        pairs = (
            f"{gap(random)}{_text(name, random, liberties)}{gap(random)}:"
            f"{spell(each, random, liberties)}"
            for name, each in members
        )
        return "{" + (",".join(pairs) or gap(random)) + "}"
    if isinstance(value, list | tuple):
        inside = ",".join(spell(each, random, liberties) for each in value)
        return "[" + (inside or gap(random)) + "]"
    if isinstance(value, str):
        return _text(value, random, liberties)
    if isinstance(value, bool) or value is None or DIGITS not in liberties:
        return json.dumps(value)
    return _number(value, random)


def _gap(random: Random) -> str:
    return random.choice(GAPS)


def _text(value: str, random: Random, liberties: Container[str]) -> str:
    return _string(value, random) if ESCAPES in liberties else json.dumps(value)


def _string(value: str, random: Random) -> str:
    dice = random.getrandbits(2 * len(value) + 1)
    written = (
        each if dice >> 2 * place & 3 and _may_be_bare(each) else _escaped(each, random)
        for place, each in enumerate(value)
    )
    return '"' + "".join(written) + '"'


def _may_be_bare(character: str) -> bool:
    return character >= " " and character not in '"\\' and not "\ud800" <= character <= "\udfff"


def _escaped(character: str, random: Random) -> str:
    if character in SHORT_ESCAPES and random.random() < 0.5:
        return SHORT_ESCAPES[character]
    units = character.encode("utf-16-be", "surrogatepass")
    digits = random.choice(("04x", "04X"))
    pairs = (int.from_bytes(units[i : i + 2]) for i in range(0, len(units), 2))
    return "".join(f"\\u{unit:{digits}}" for unit in pairs)


def _number(value: int | float, random: Random) -> str:
    if isinstance(value, Plain):
        return str(int(value))
    sign, figures, power = _decimal(value, random).as_tuple()
    assert isinstance(power, int)
    zeros = "0" * random.choice((0, 0, 0, 1, 12))
    digits, power = "".join(map(str, figures)) + zeros, power - len(zeros)
    if any(figures):
        point = len(digits) + power  # where it is without an exponent
        if abs(point) > LONGEST_PLAIN or random.random() < 0.5:
            point = random.choice((0, 1, len(digits), len(digits) + 2))
        exponent = len(digits) + power - point
    else:
        digits = "0" + (zeros or "0" * sign)  # some read -0 as an integer, which has no sign
        point, exponent = 1, random.choice((0, 0, 5, -5))
    digits = "0" * (1 - point) + digits + "0" * (point - len(digits))
    whole, fraction = digits[: max(point, 1)], digits[max(point, 1) :]
    number = "-" * sign + whole + ("." + fraction if fraction else "")
    return number + _exponent(exponent, random)


def _decimal(value: int | float, random: Random) -> Decimal:
    """A decimal that reads as `value`: the shortest, one of 17 digits, or the exact one."""
    if isinstance(value, int):
        return Decimal(value)
    return random.choice((Decimal(repr(value)), Decimal(f"{value:.17g}"), Decimal(value)))


def _exponent(exponent: int, random: Random) -> str:
    if exponent == 0 and random.random() < 0.7:
        return ""
    signs = ("-",) if exponent < 0 else ("", "+", "-") if exponent == 0 else ("", "+")
    zeros = random.choice(("", "", "00"))
    return f"{random.choice('eE')}{random.choice(signs)}{zeros}{abs(exponent)}"
