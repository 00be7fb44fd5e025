"""`numbers.json`: spellings of numbers, and the doubles that they mean."""

from fractions import Fraction

from splatbus_conformance.oracle.rounding import to_double
from splatbus_conformance.oracle.vectors import printing
from splatbus_conformance.oracle.vectors.layout import Json, both, exactly


def _times(text: str, times: int = 1) -> Json:
    return {"text": text} if times == 1 else {"text": text, "times": times}


ACCEPTED: dict[str, Json] = {
    "zero": "0",
    "minus zero": "-0",
    "minus zero with a fraction": "-0.0",
    "an integer": "1",
    "a fraction of zero": "1.0",
    "a negative integer": "-100",
    "an exponent": "1e3",
    "a capital E and a sign": "1E+3",
    "a negative exponent": "1e-7",
    "leading zeros in the exponent": "5e-0007",
    "an exponent that moves the point to the left": "1234.5e-4",
    "a tenth": "0.1",
    "seventeen digits of a widened single": "27.071748733520509",
    "a large number as deployed clients print it": "9.9999999778196309e21",
    "nine digits of a single": "0.333333343",
    "a sum of 0.1 and 0.2": "0.30000000000000004",
    "a tie goes to even": "1.00000000000000011102230246251565404236316680908203125",
    "just above the tie": "1.00000000000000011102230246251565404236316680908203126",
    "2^53 + 1 is a tie, and goes to even": "9007199254740993",
    "beyond 64 bits": "18446744073709551617",
    "below 64 bits": "-9223372036854775809",
    "thirty digits": "123456789012345678901234567890",
    "the smallest double": "5e-324",
    "more than half of the smallest double": "3e-324",
    "less than half of the smallest double is zero": "2e-324",
    "far below the smallest double is zero": "-1e-400",
    "zero with a large exponent is zero": "0e9999",
    "the smallest normal double": "2.2250738585072014e-308",
    "just below the smallest normal double": "2.2250738585072011e-308",
    "the largest double": "1.7976931348623157e308",
    "what still rounds to the largest double": "1.797693134862315807e308",
    "309 digits": [_times("1"), _times("0", 308)],
    "400 zeros after the point": [_times("0."), _times("0", 400), _times("1")],
    "a tie until its 800th digit": [
        _times("1.00000000000000011102230246251565404236316680908203125"),
        *(_times("0", 746), _times("1")),
    ],
}

REJECTED_BY_VALUE: dict[str, Json] = {
    "not a number": "NaN",
    "infinity": "Infinity",
    "minus infinity": "-Infinity",
    "400 powers of ten": "1e400",
    "minus 400 powers of ten": "-1e400",
    "the first number that rounds to infinity": "1.797693134862315808e308",
    "a string that is no number": '"nan"',
    "a string with white space": '" 1"',
    "a string with an underscore": '"1_0"',
    "an empty string": '""',
    "5,000 digits": [_times("9", 5000)],
}

REJECTED_BY_GRAMMAR = {
    "a leading zero": "01",
    "a minus and a leading zero": "-01",
    "a plus sign": "+1",
    "no digit before the point": ".5",
    "no digit after the point": "1.",
    "a point and an exponent": "1.e5",
    "an exponent without digits": "1e",
    "an exponent with a sign alone": "1e+",
    "a sign alone": "-",
    "two signs": "--1",
    "hexadecimal": "0x10",
    "an underscore": "1_000",
    "a suffix": "1f",
    "a space within": "1 000",
    "full-width digits": "１２",
    "lower-case nan": "nan",
    "inf": "-inf",
}

OPTIONAL = {
    "a string": '"1"',
    "a string with a fraction and an exponent": '"-12.5e-1"',
}


def document() -> Json:
    """Return the whole file."""
    return {
        "$schema": "vectors.schema.json",
        "name": "numbers",
        "version": "1.0",
        "description": "Spellings of one number. Put each, as it stands, where the value of"
        ' `timestamp` stands in {"type":"camera_pose","timestamp":…,"position":…,"rotation":…};'
        " the spellings that are strings, where that of `x` stands in `position`. A spelling in"
        " pieces is each `text` repeated `times` times. `accepted`: a receiver takes it for"
        " `value`. `rejected`: a receiver does not act on the payload. `optional`: a server either"
        " takes it for `value` or rejects it. `printed`: what a sender makes of `value`, which it"
        " holds in `precision`, reads back as `value` (read as a double and, where the precision is"
        " `single`, rounded to one): `enough` are spellings that do, `too_few` some that do not.",
        "requirements": ["ACC-1", "ACC-14", "JSN-1", "JSN-4", "JSN-6", "JSN-8", "JSN-11"],
        "tolerances": {
            "value": exactly("The double nearest to the decimal, ties to even.", "ACC-14")
        },
        "cases": [
            *[_case("accepted", "JSN-6", *given) for given in ACCEPTED.items()],
            *[_case("rejected", "JSN-4", *given) for given in REJECTED_BY_VALUE.items()],
            *[_case("rejected", "JSN-1", *given) for given in REJECTED_BY_GRAMMAR.items()],
            *[_case("optional", "JSN-11", *given) for given in OPTIONAL.items()],
            *printing.cases(),
        ],
    }


def _spelled(spelling: Json) -> str:
    if isinstance(spelling, str):
        return spelling.strip('"')
    return "".join(piece["text"] * piece.get("times", 1) for piece in spelling)


def _value(spelling: Json) -> Json:
    value = to_double(Fraction(_spelled(spelling)))
    # Rational numbers have one zero only.
    return both(-0.0 if value == 0 and _spelled(spelling).startswith("-") else value)


def _case(verdict: str, requirement: str, name: str, spelling: Json) -> Json:
    case = {"name": name, "requirement": requirement, "spelling": spelling, "verdict": verdict}
    return case if verdict == "rejected" else {**case, "value": _value(spelling)}
