"""The list of expected failures: what it forgives, and when it fails a run itself."""

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.reports.expected_failures import (
    Expectation,
    ExpectationsError,
    applied,
    listed,
    load,
)
from splatbus_conformance.selection import RULE, Item
from splatbus_conformance.verdicts import Level, Result, Verdict

from tests.conformance.harness import GOOD, broken, run, said

ITEMS = (Item("FRM-3", "check_a", "L1"), Item("FRM-3", "check_b", "L1"), Item("FRM-4", RULE, "L0"))
KNOWN = Expectation("FRM-3", "check_a", "issue 17", "hangs")
LIST = """\
# written by hand
[[expected]]
id = "FRM-3"
check = "check_a"
reason = "issue 17"
code = "hangs"
"""


def result(
    verdict: Verdict, code: str = "hangs", check: str = "check_a", text: str = "it hung"
) -> Result:
    return Result("FRM-3", check, Level.WIRE, verdict, text, code=code)


@pytest.mark.parametrize(
    ("found", "marked", "stale"),
    [
        (result(Verdict.FAIL), Verdict.EXPECTED, ""),
        (result(Verdict.WARN), Verdict.EXPECTED, ""),
        (result(Verdict.PASS), Verdict.PASS, "FRM-3 check_a passes, though it is expected to fail"),
        (result(Verdict.FAIL, "dies"), Verdict.FAIL, "its code is dies, not hangs"),
        (result(Verdict.SKIP), Verdict.SKIP, ""),
        (result(Verdict.ERROR), Verdict.ERROR, ""),
        (result(Verdict.FAIL, check="check_b"), Verdict.FAIL, ""),
    ],
)
def test_a_failure_as_listed_is_forgiven_and_what_is_another_makes_its_entry_stale(
    found: Result, marked: Verdict, stale: str
) -> None:
    (given,), sentences = applied([found], [KNOWN])
    assert given.verdict is marked
    assert ("issue 17" in given.text) == (marked is Verdict.EXPECTED)
    assert len(sentences) == bool(stale)
    assert stale in "".join(sentences)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[[expected]\n", "is not TOML: "),
        ("expected = 1\n", "[[expected]] tables and nothing else"),
        ("else = 1\n", "[[expected]] tables and nothing else"),
        (LIST.replace('reason = "issue 17"\n', ""), "number 1: it needs id, check, reason"),
        (LIST.replace("issue 17", " "), "reason has to be a text that is not empty"),
        (LIST.replace("FRM-3", "FRM-33"), "no check is called FRM-33 check_a; no such id"),
        (LIST.replace("check_a", "check_c"), "FRM-3 is judged by check_a, check_b"),
        (LIST + LIST, "FRM-3 check_a is listed more than once"),
    ],
)
def test_a_list_is_read_or_says_what_is_wrong(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "known.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(ExpectationsError) as caught:
        load(path, ITEMS)
    assert complaint in str(caught.value)
    assert "known.toml" in str(caught.value)
    path.write_text(LIST, "utf-8")
    assert load(path, ITEMS) == (KNOWN,)


@given(st.text(min_size=1).filter(str.strip))
def test_a_list_that_is_written_is_one_and_keeps_reasons(text: str) -> None:
    results = [result(Verdict.FAIL, text=text), result(Verdict.WARN, check="check_b")]
    (entry,) = tomllib.loads(listed(results, (), strict=False))["expected"]
    assert (entry["check"], entry["code"]) == ("check_a", "hangs"), "a warning fails nothing"
    former = [KNOWN, Expectation("FRM-4", RULE, "issue 18", "falls")]
    both = tomllib.loads(listed(results, former, strict=True))["expected"]
    assert [it["reason"] for it in both] == ["issue 17", "not looked into yet"]


def test_a_run_with_its_list_from_beginning_to_end(tmp_path: Path) -> None:
    command = broken(tmp_path, ("if not 1 <= length <= LIMIT:", "if False:"))
    judged = ("client", "--select", "check_bad_length_closes", "--shrink", "0", "--launch")
    known = tmp_path / "known.toml"
    known.write_text(LIST.replace("check_a", "check_bad_length_closes"), "utf-8")
    expecting = ("--expect-failures", str(known), "--scripts", str(tmp_path))
    code, output = run(*judged, command, *expecting)
    assert code == 0, output
    assert "not conforming, as expected" in output
    assert "expected to be broken: FRM-3" in output
    code, output = run(*judged, GOOD, *expecting)
    assert code == 1, output
    assert "FRM-3 check_bad_length_closes passes" in output


def test_a_list_is_not_written_from_part_of_a_run(tmp_path: Path) -> None:
    path = tmp_path / "known.toml"
    code, output = said(
        "client", "--launch", "x", "--deselect", "FRM", "--write-expected", str(path)
    )
    assert (code, path.exists()) == (2, False)
    assert "a whole run" in output
