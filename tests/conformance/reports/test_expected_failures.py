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
from splatbus_conformance.verdicts import Level, Result, Verdict, exit_code

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


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "known.toml"
    path.write_text(text, "utf-8")
    return path


def test_a_failure_as_listed_is_marked_and_fails_nothing() -> None:
    (marked,), stale = applied([result(Verdict.FAIL)], [KNOWN])
    assert marked.verdict is Verdict.EXPECTED
    assert "issue 17" in marked.text
    assert not stale
    assert exit_code({"FRM-3": marked.verdict}) == 0


def test_a_listed_check_that_passes_is_stale() -> None:
    results, (sentence,) = applied([result(Verdict.PASS)], [KNOWN])
    assert results == [result(Verdict.PASS)]
    assert sentence == (
        "FRM-3 check_a passes, though it is expected to fail (issue 17): remove its entry"
    )


def test_a_listed_check_that_fails_otherwise_still_fails() -> None:
    other = result(Verdict.FAIL, "dies")
    results, (sentence,) = applied([other], [KNOWN])
    assert results == [other]
    assert "its code is dies, not hangs" in sentence


@pytest.mark.parametrize("verdict", [Verdict.SKIP, Verdict.ERROR])
def test_what_was_not_seen_is_no_evidence(verdict: Verdict) -> None:
    assert applied([result(verdict)], [KNOWN]) == ([result(verdict)], [])
    assert applied([], [KNOWN]) == ([], [])


def test_another_check_of_the_requirement_is_not_forgiven() -> None:
    other = result(Verdict.FAIL, check="check_b")
    assert applied([other], [KNOWN]) == ([other], [])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[[expected]\n", "no TOML: "),
        ("expected = 1\n", "[[expected]] tables and nothing else"),
        ("else = 1\n", "[[expected]] tables and nothing else"),
        (LIST.replace('reason = "issue 17"\n', ""), "number 1: it has to have id, check, reason"),
        (LIST.replace("issue 17", " "), "reason has to be a text, and may not be empty"),
        (LIST.replace("FRM-3", "FRM-33"), "no check is called FRM-33 check_a; no such id"),
        (LIST.replace("check_a", "check_c"), "FRM-3 is judged by check_a, check_b"),
        (LIST + LIST, "FRM-3 check_a is listed more than once"),
    ],
)
def test_a_list_that_is_none_says_what_is_wrong(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(ExpectationsError) as caught:
        load(written(tmp_path, text), ITEMS)
    assert complaint in str(caught.value)
    assert "known.toml" in str(caught.value)


def test_a_list_is_read(tmp_path: Path) -> None:
    assert load(written(tmp_path, LIST), ITEMS) == (KNOWN,)


@given(st.text(min_size=1).filter(str.strip))
def test_a_list_that_is_written_fits_the_run_that_it_came_of(text: str) -> None:
    results = [result(Verdict.FAIL, text=text), result(Verdict.WARN, check="check_b")]
    entries = tomllib.loads(listed(results, (), strict=False))["expected"]
    assert [it["check"] for it in entries] == ["check_a"], "a warning fails nothing"
    assert entries[0]["code"] == "hangs"


def test_writing_it_anew_keeps_reasons_and_drops_what_passes() -> None:
    former = (KNOWN, Expectation("FRM-3", "check_b", "issue 18", "falls"))
    text = listed([result(Verdict.FAIL), result(Verdict.PASS, "", "check_b")], former, strict=False)
    (entry,) = tomllib.loads(text)["expected"]
    assert Expectation(**entry) == KNOWN
    assert "it hung" in text, "what was seen is for people"


def test_a_run_with_its_list_from_beginning_to_end(tmp_path: Path) -> None:
    command = broken(tmp_path, ("if not 1 <= length <= LIMIT:", "if False:"))
    judged = ("client", "--select", "check_bad_length_closes", "--shrink", "0", "--launch")
    known = written(
        tmp_path,
        '[[expected]]\nid = "FRM-3"\ncheck = "check_bad_length_closes"\n'
        'reason = "issue 17"\ncode = "hangs"\n',
    )
    expecting = ("--expect-failures", str(known), "--scripts", str(tmp_path))
    code, output = run(*judged, command, *expecting)
    assert code == 0, output
    assert "not conforming, as expected" in output
    assert "expected to be broken: FRM-3" in output
    code, output = run(*judged, GOOD, *expecting)
    assert code == 1, output
    assert "FRM-3 check_bad_length_closes passes" in output


@pytest.mark.parametrize("option", ["--select", "--deselect"])
def test_a_list_is_not_written_from_part_of_a_run(tmp_path: Path, option: str) -> None:
    path = tmp_path / "known.toml"
    code, output = said("client", "--launch", GOOD, option, "FRM", "--write-expected", str(path))
    assert code == 2
    assert "a whole run" in output
    assert not path.exists()
