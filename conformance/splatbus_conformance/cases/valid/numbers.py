"""Decimals that only a careful parser takes for the double nearest to them (ACC-14)."""

import math
from collections.abc import Callable, Mapping
from decimal import Context, Decimal
from fractions import Fraction

from hypothesis import strategies as st

from splatbus_conformance.cases.valid.poses import SteeredDraw, steering
from splatbus_conformance.oracle import to_double
from splatbus_conformance.wire.messages import Json, encode

_EXACT = Context(prec=400)


def hard_numbers() -> st.SearchStrategy[str]:
    """Numbers up to 10⁶ as text: exact, of 17 digits, halfway between two doubles, or beside."""

    def text(way: Callable[[float], str], steered: SteeredDraw) -> str:
        rng = steered.rng("numbers")
        (number,) = steered.moved([rng.uniform(-10, 10) * 10.0 ** rng.randint(-7, 5)])
        return way(number)

    return st.builds(text, st.sampled_from(_WAYS), steering())


def nearest(text: str) -> float:
    """The double nearest to a decimal, ties to even."""
    return to_double(Fraction(text))


def spelled_as(pose: Json, texts: Mapping[str, str]) -> bytes:
    """A pose message, but with these texts for the numbers of its position."""
    held = {name: f"<{text}>" for name, text in texts.items()}
    return unquoted(encode(pose | {"position": held}))


def unquoted(payload: bytes) -> bytes:
    """Texts in angle brackets, taken out of their quotes."""
    return payload.replace(b'"<', b"").replace(b'>"', b"")


def _halfway(value: float) -> Decimal:
    middle = (Fraction(value) + Fraction(math.nextafter(value, math.inf))) / 2
    return _EXACT.divide(Decimal(middle.numerator), Decimal(middle.denominator))


def _beside(number: Decimal, sign: int) -> Decimal:
    """Off by one in the third digit past the last."""
    exponent = number.as_tuple().exponent
    assert isinstance(exponent, int)
    return _EXACT.add(number, Decimal((0 if sign > 0 else 1, (1,), exponent - 3)))


_WAYS: tuple[Callable[[float], str], ...] = (
    repr,
    lambda value: f"{Decimal(value):f}",
    lambda value: f"{value:.16e}",
    lambda value: f"{_halfway(value):f}",
    lambda value: f"{_beside(_halfway(value), 1):f}",
    lambda value: f"{_beside(_halfway(value), -1):f}",
)
