"""Cases of `numbers.json`: with how many digits a number is sent."""

import math
from decimal import Decimal
from fractions import Fraction

from splatbus_conformance.oracle.rounding import SINGLE_MAX, to_double, to_single
from splatbus_conformance.oracle.vectors.layout import Json, both, single

SINGLES = {
    "a tenth": single(0.1),
    "a third": single(1 / 3),
    "one that needs nine digits": single(1018.19147),
    "the one that its shortest spelling, read as a double, does not give back": single(
        7.0385307e-26
    ),
    "a position at 10,000 units": single(12_345.678),
    "a large whole number": single(123_456_789.0),
    "the least": 2.0**-149,
    "a subnormal": single(1e-40),
    "the largest": float(SINGLE_MAX),
    "a small negative number": -single(1e-7),
    "the next after one": 1.0 + 2.0**-23,
}
DOUBLES = {
    "a tenth": 0.1,
    "a sum of 0.1 and 0.2": 0.30000000000000004,
    "a third": 1 / 3,
    "w of the worked example": 0.9273618495495703,
    "a position a million units away": 1_234_567.0123456789,
    "2^53 + 2": 9007199254740994.0,
    "the least": 5e-324,
    "the largest": 1.7976931348623157e308,
    "a subnormal": 1.2345678901234567e-310,
    "the next after one": 1.0 + 2.0**-52,
}
SIGNIFICANT = {"single": (9, 17), "double": (17, 21)}
SHORT = {"single": (6, 7), "double": (9, 15)}


def cases() -> list[Json]:
    """Return the cases of `printed`."""
    return [
        *[_case(name, "single", value) for name, value in SINGLES.items()],
        *[_case(name, "double", value) for name, value in DOUBLES.items()],
    ]


def reads_back(spelling: str, value: float, precision: str) -> bool:
    """Tell whether a receiver, who reads doubles, makes the held value of a spelling again."""
    double = to_double(Fraction(spelling))
    return value == (to_single(Fraction(double)) if precision == "single" else double)


def _case(name: str, precision: str, value: float) -> Json:
    lengths = range(1, SIGNIFICANT[precision][0] + 1)
    spellings = [_digits(value, length) for length in lengths]
    shortest = next(text for text in spellings if reads_back(text, value, precision))
    longer = [_digits(value, length) for length in SIGNIFICANT[precision]]
    shorter = [_digits(value, length) for length in SHORT[precision]]
    readable = [text for text in shorter if math.isfinite(to_double(Fraction(text)))]
    return {
        "name": f"printed, {precision}: {name}",
        "requirement": "ACC-1",
        "verdict": "printed",
        "precision": precision,
        "value": both(value),
        "enough": list(dict.fromkeys([shortest, *longer])),
        "too_few": [text for text in readable if not reads_back(text, value, precision)],
    }


def _digits(value: float, length: int) -> str:
    """Correctly rounded, by the decimal arithmetic of the standard library."""
    return f"{Decimal(value):.{length}g}"
