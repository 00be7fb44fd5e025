"""The summary of a CI step: what it shows, how long it gets, and that nothing breaks out of it."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from markdown_it.token import Token
from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.files.markdown import MOST_BYTES, markdown_report
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.visible import visible

from tests.conformance.reports.stored_reports import EVERY_VERDICT, HOSTILE, failure, report_of

MARKS = "`~|<>\\\n\r\t #-+*_&;!:/@.1[](){}=\"'x"


def tokens(text: str) -> list[Token]:
    """As GitHub reads it: CommonMark with tables."""
    return MarkdownIt("commonmark").enable("table").parse(text)


def skeleton(text: str) -> list[tuple[str, str, list[str]]]:
    """What the text is made of, without what code holds; HTML with what it holds."""
    return [
        (
            token.type,
            token.content if token.type == "html_block" else token.markup[:3],
            [child.type for child in token.children or ()],
        )
        for token in tokens(text)
    ]


def of_a_testee(text: str) -> Report:
    """A report in which everything that can come from a testee is this text."""
    warning = Result("FRM-7", "rule", Level.PASSIVE, Verdict.WARN, text, (text,))
    skip = Result("JSN-1", "check_b", Level.WIRE, Verdict.SKIP, text)
    return report_of(
        *(failure(text), warning, skip),
        testee=text,
        notJudged=[text],
        complaints=[f"a {text} b"],
        advice=[f"a {text} b"],
    )


def seen(text: str) -> str:
    return visible(text, kept="\n\t")


@example("`")
@example("```\n# heading\n````")
@example("\\`")
@given(st.one_of(st.text(MARKS), st.text(min_size=1)))
def test_no_text_of_a_testee_changes_what_the_summary_is_made_of(text: str) -> None:
    expected = skeleton(markdown_report([of_a_testee("harmless")]))
    assert skeleton(markdown_report([of_a_testee(f"x{text}x")])) == expected


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_text_is_shown_in_code(text: str) -> None:
    made = markdown_report([of_a_testee(text)])
    made.encode()
    blocks = [token for token in tokens(made) if token.type == "fence"]
    assert [block.info for block in blocks] == ["text", "sh", "text"]
    assert blocks[0].content == f"{seen(text)}\n{seen(text)}\n"
    (span,) = (it for it in tokens(made)[1].children or () if it.type == "code_inline")
    assert span.content == (" ".join(seen(text).split()) or "…")


def test_it_says_the_verdict_counts_and_each_failure_with_its_sentence() -> None:
    made = markdown_report([report_of(*EVERY_VERDICT, complaints=["too little"])])
    for line in (
        "## SplatBus conformance: client `cmd`",
        "**not conforming: FRM\\-3 broken: 3 of 6 requirements observed**",
        "| broken | 1 |",
        "- too little",
        "### broken: FRM-3, a (L1)",
        "> A receiver MUST close a connection",
        "Acceptable: closes",
        "Seen: `seen`",
        "line <&>",
        "splatbus-conformance replay a.json --launch cmd",
        "### no verdict: JSN-2, c (L2)",
        "### no verdict: the run, collection (L1)",
        "<details><summary>advice not followed: FRM-7, rule (L0)</summary>",
        "<details><summary>broken, as expected: JSN-4, d (L1)</summary>",
        "- JSN-1: `no hello`",
        "- POS-1: deselected",
    ):
        assert line in made, line
    assert made.index("### broken") < made.index("<details>")


def test_counts_are_those_of_the_report() -> None:
    report = report_of(*EVERY_VERDICT)
    cells = [
        token.content
        for token in tokens(markdown_report([report]))
        if token.type == "inline" and token.content.isdecimal()
    ]
    assert sum(map(int, cells)) == len(report["requirements"])


def test_nothing_is_said_of_seeds_where_none_was_drawn() -> None:
    assert "seed" not in markdown_report([report_of(profile=None, seeds=[])])


@pytest.mark.parametrize("most", [MOST_BYTES, 100_000])
def test_however_long_the_run_it_stays_within_what_is_shown(most: int) -> None:
    long = Result("FRM-3", "check_a", Level.WIRE, Verdict.FAIL, "€" * 9999, ("`€" * 9999,) * 9)
    report = report_of(*[long] * 400)
    made = markdown_report([report], most)
    assert len(made.encode()) <= most
    shown = made.count("### broken")
    assert 0 < shown < 400
    assert f"Too long for a summary: {400 - shown + 1} parts more" in made
    assert [token.type for token in tokens(made)][-1] == "paragraph_close"


def test_short_reports_are_shown_to_the_end() -> None:
    assert "Too long" not in markdown_report([report_of(*EVERY_VERDICT)] * 20)
