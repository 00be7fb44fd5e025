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

# Where each requirement says each of its limits: in its sentence, or in a table of its chapter.
QUOTATIONS = {
    ("min_payload_bytes", "FRM-2"): "less than {} or more",
    ("min_payload_bytes", "FRM-3"): "a payload of 0 bytes or",
    ("max_payload_bytes", "FRM-2"): "more than {}",
    ("max_payload_bytes", "FRM-3"): "more than {}",
    ("packet_completion_seconds", "FRM-5"): "not complete {} after",
    ("close_seconds", "CHN-13"): "within {}",
    ("max_json_depth", "JSN-5"): "more than {} deep",
    ("max_client_values", "JSN-12"): "more than {} values into a payload as a client",
    ("max_server_values", "JSN-12"): "more than {} as a server",
    ("max_safe_integer", "REQ-2"): "from −({}) to {}",
    ("max_safe_integer", "INI-5"): "from 0 to {}",
    ("max_safe_integer", "INI-6"): "from 0 to {}",
    ("max_safe_integer", "NEG-27"): "from 0 to {}",
    ("max_safe_integer", "OPN-13"): "from 1 to {}",
    ("max_safe_integer", "MEM-1"): "from 1 to {}",
    ("max_safe_integer", "MEM-2"): "| `bytes` | integer, 1…{} |",
    ("max_safe_integer", "MEM-8"): "integer, 0…{}, multiple of 16",
    ("max_safe_integer", "IMG-1"): "| `seq` | integer, 0…{} |",
    ("max_safe_integer", "SCN-2"): "| `cameras` | integer, 0…{} |",
    ("max_safe_integer", "TEL-2"): "| `seq` | integer, 0…{} |",
    ("reconnect_min_seconds", "CHN-21"): "at least {} between",
    ("reconnect_max_seconds", "CHN-22"): "at most {} between",
    ("reply_seconds", "CHN-15"): "at most {},",
    ("ask_again_min_seconds", "REQ-12"): "no sooner than {} later",
    ("ask_again_min_seconds", "VPT-9"): "sooner than {} later",
    ("error_pause_seconds", "NEG-24"): "within {} of",
    ("telemetry_seconds", "TEL-7"): "within {},",
    ("max_image_size", "INI-2"): "from 1 to {}",
    ("max_image_size", "REQ-3"): "from 0 to {}",
    ("max_image_size", "CAM-4"): "| `width`, `height` | integers, 1…{} |",
    ("max_image_size", "VPT-1"): "from 1 to {}",
    ("handle_bytes", "INI-7"): "each be {} in base64",
    ("max_position", "POS-2"): "at most {}",
    ("rotation_norm_tolerance", "POS-3"): "by at most {}",
    ("legacy_empty_depth", "BUF-7"): "exactly {}",
    ("covered_alpha_min", "ACC-9"): "A ≥ {},",
    ("min_normal_single", "ACC-15"): "less than {}",
    ("max_unsent_bytes", "LIM-2"): "more than {} of replies",
    ("stalled_reader_seconds", "LIM-2"): "no byte for {}",
    ("hello_seconds", "NEG-12"): "has arrived {} after",
    ("max_versions", "NEG-2"): "array of 1 to {} strings",
    ("max_name_chars", "NEG-2"): "strings of at most {} |",
    ("max_capabilities", "NEG-2"): "array of at most {} different",
    ("max_token_chars", "NEG-2"): "string of 1 to {}, optional",
    ("max_message_chars", "NEG-23"): "string of at most {} |",
    ("max_reason_chars", "OPN-3"): "1 to {}",
    ("max_shm_name_chars", "MEM-7"): "1 to {} from",
    ("max_slots", "MEM-8"): "| `slots` | integer, 1…{} |",
    ("frame_seconds", "IMG-11"): "within {}",
    ("frame_seconds", "IMG-25"): "within {}",
    ("last_words_seconds", "NEG-34"): "for at most {}",
    ("max_tag_chars", "CAM-1"): "1 to {}",
    ("min_lens", "CAM-4"): "| `fx`, `fy` | numbers from {} to",
    ("max_lens", "CAM-4"): "of a magnitude of at most {} |",
    ("min_scale", "OBJ-1"): "number from {} to",
    ("max_scale", "OBJ-1"): "to {}, optional",
    ("max_objects", "OBJ-7"): "array of at most {} objects",
    ("max_objects", "SCN-2"): "array of 1 to {} objects",
    ("reinit_seconds", "VPT-5"): "within {} on",
    ("free_seconds", "VPT-7"): "within {} once",
    ("free_seconds", "VPT-10"): "in use for {}",
    ("let_go_seconds", "VPT-8"): "that, {} after",
    ("max_series", "TEL-1"): "array of at most {} different",
    ("max_series", "TEL-2"): "array of 1 to {} objects",
    ("max_edges", "TEL-2"): "array of 2 to {} numbers",
    ("max_text_chars", "TEL-2"): "a string of at most {} for a text",
}
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


def test_every_limit_is_quoted_by_each_of_its_requirements() -> None:
    assert set(QUOTATIONS) == {
        (name, each) for name, limit in LIMITS.items() for each in limit["requirements"]
    }


@pytest.mark.parametrize(("name", "requirement"), QUOTATIONS, ids=str)
def test_a_quotation_has_the_value_of_the_limit(name: str, requirement: str) -> None:
    quotation = QUOTATIONS[name, requirement].replace("{}", spelled(name))
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
