"""Every number that the prose quotes is the one in limits.json."""

import math
import re
from decimal import Decimal
from fractions import Fraction
from typing import Any

import pytest
from splatbus_schemas import FRAMING, VERSIONS, read_json, requirements
from splatbus_schemas.prose import CHECKOUT

LIMITS: dict[str, dict[str, Any]] = read_json("limits.json")["limits"]
REQUIREMENTS = requirements(VERSIONS[-1])
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
TABLE = "spec/1.0/09-limits-security.md"
"""Of limits; that of 1.1 is made of `limits.json`."""

# Numbers with a unit that are no limits.
OTHER_NUMBERS = {"FRM-3": {"0 bytes"}, "INI-7": {"88 characters"}}


def spelled(name: str) -> str:
    """The value of a limit as a sentence writes it, with its unit where that is a measure."""
    value, unit = LIMITS[name]["value"], LIMITS[name].get("unit")
    if name == "max_safe_integer":
        bits = (value + 1).bit_length() - 1
        assert value == 2**bits - 1
        return f"2{str(bits).translate(SUPERSCRIPT)}−1"
    if name in ("min_lens", "max_lens"):
        exponent = round(math.log10(value))
        assert value == 10.0**exponent
        return f"10{str(exponent).translate(SUPERSCRIPT)}"
    if name == "covered_alpha_min":
        return str(Fraction(value).limit_denominator(1000))
    if unit == "seconds" and value < 1:
        return f"{value * 1000:g} milliseconds"
    if unit in ("seconds", "bytes", "characters") and value > 1:
        return f"{value:,} {unit}"
    if isinstance(value, float) and 1e-6 <= value < 1:
        return f"{Decimal(str(value)):f}"
    return str(value).replace("e+", "e") if isinstance(value, float) else f"{value:,}"


def chapter_tables(requirement: str) -> list[str]:
    text = (CHECKOUT / REQUIREMENTS[requirement].chapter).read_text("utf-8")
    return [line for line in text.splitlines() if line.startswith("|")]


def table() -> dict[str, tuple[str, str]]:
    text = (CHECKOUT / TABLE).read_text("utf-8")
    (rows,) = re.findall(
        r"^\| limit \| value \| requirement \|\n\|---\|---\|---\|\n((?:\|.*\n)+)", text, re.M
    )
    found = re.findall(r"^\| `(\w+)` \| (\S+) \| (.+) \|$", rows, re.M)
    assert len(found) == rows.count("\n")
    return {name: (value, quoted) for name, value, quoted in found}


def test_the_table_has_the_limits_of_its_version() -> None:
    assert set(table()) == {n for n, limit in LIMITS.items() if limit["since"] == "1.0"}


@pytest.mark.parametrize("name", table())
def test_the_table_quotes_value_and_requirements(name: str) -> None:
    value, quoted = table()[name]
    assert float(value) == LIMITS[name]["value"]
    in_force = requirements("1.0")
    expected = {each for each in LIMITS[name]["requirements"] if each in in_force}
    assert set(re.findall(r"[A-Z]{3}-\d+", quoted)) == expected


def test_limits_and_framing_name_requirements_that_exist() -> None:
    named = {each for limit in LIMITS.values() for each in limit["requirements"]}
    named |= set(re.findall(r"\b[A-Z]{3}-\d+\b", str(dict(FRAMING))))
    assert named <= set(REQUIREMENTS)


@pytest.mark.parametrize(
    ("name", "requirement", "quotation"),
    [(name, *each) for name, limit in LIMITS.items() for each in limit["requirements"].items()],
    ids=str,
)
def test_a_quotation_has_the_value_of_the_limit(
    name: str, requirement: str, quotation: str
) -> None:
    quotation = quotation.replace("{}", spelled(name))
    whole = re.compile(rf"(?<![\w.,]){re.escape(quotation)}(?![\w⁰¹²³⁴⁵⁶⁷⁸⁹])")
    sentence = REQUIREMENTS[requirement].sentence
    assert any(whole.search(line) for line in [sentence, *chapter_tables(requirement)]), quotation


@pytest.mark.parametrize("requirement", REQUIREMENTS)
def test_every_measure_in_a_sentence_is_a_limit(requirement: str) -> None:
    known = {spelled(n) for n, limit in LIMITS.items() if requirement in limit["requirements"]}
    known |= OTHER_NUMBERS.get(requirement, set())
    sentence = REQUIREMENTS[requirement].sentence
    measures = re.findall(r"[\d.,]*\d (?:milli)?(?:seconds|bytes|characters)", sentence)
    assert set(measures) <= known


def test_closing_takes_as_long_as_the_introduction_says() -> None:
    text = (CHECKOUT / "spec/1.0/README.md").read_text("utf-8")
    (meaning,) = re.findall(r"^\| `closes` \| (.+) \|$", text, re.M)
    assert f"within {spelled('close_seconds')}," in meaning
