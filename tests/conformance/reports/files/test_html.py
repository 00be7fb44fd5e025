"""The report page: says what the report says, holds what testees send, and stays small."""

from collections import Counter
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from lxml import html
from splatbus_conformance.reports.files.html import plots
from splatbus_conformance.reports.files.html.clauses import CLAUSES
from splatbus_conformance.reports.files.html.page import MOST_BYTES, html_report
from splatbus_conformance.reports.files.html.text import CODE, ID, cut, parts, shown, transcript
from splatbus_conformance.verdicts import Level, Result, Verdict

from tests.conformance.reports.stored_reports import (
    HOSTILE,
    KNOWN,
    brief,
    full_report,
    of_a_testee,
    report_of,
)

HARMLESS = str.maketrans(dict.fromkeys("<>&\"'`", "x"))
PIECES = st.sampled_from(
    [*HOSTILE, "-->", "]]>", "&#60;", "{{ 7 * 7 }}", "\u202e\x00\ud800", "FRM-3", "`<b>`"]
)
EVENT = "   1.0000 s  msg #1  client → server"
MORE = "             28 bytes: {}"
BYTES = "             1c 00 00 00 7b … 40 5d (432 bytes)"


def read(*reports: dict[str, Any]) -> tuple[html.HtmlElement, str]:
    """A page, and what is to be read on it, with single spaces."""
    page = html.document_fromstring(html_report(*reports))
    return page, " ".join(" ".join(page.body.itertext()).split())


def test_it_says_what_the_report_says_in_the_order_in_which_to_mend_it() -> None:
    known = KNOWN["FRM-3"]
    page, text = read(full_report())
    told = (
        "Not conforming: FRM-3 broken",
        "Start with FRM-3",
        "fail FRM-3 rule MUST, at L0, code hangs , in 200 ms; spec/1.0/02-framing.md",
        known.sentence,
        f"Why: {known.why}",
        "Acceptable closes Seen seen Smallest case one case",
        "To see it again splatbus-conformance replay a.json --launch cmd",
        "Transcript, 2 lines",
        "line <&>",
        "later",
        "KeyError: 1",
        "no such file",
        "too little was observed",
        "apart",
        "seen (expected: issue 17)",
        "FRM Framing 3 of 8 observed",
        "Not observed, and why",
        "its checks did not run; a live run with --profile full runs them all FRM-4 , FRM-5",
        "no run can show it: a socket option of the other side",
        "no hello JSN-1",
        "left out by --select or --deselect POS-1",
        "3 answers: half within 473 µs, 99% within 20 ms, the slowest 20 ms.",
        "Worst errors",
        "over budget: it had to be exact 6, 2 over budget",
        "not finite",
        "16.7% of the budget",
        "exact 8",
        "no clause sets a budget",
        f"5 of {len(KNOWN)} requirements",
        "seeds 3, 4 cases 3 in 1.5 s",
        "msg #1: 3 bytes",
    )
    place = 0
    for each in told:
        place = text.find(each.replace("`", ""), place)
        assert place >= 0, each
    rows = {row.get("id"): row.get("class") for row in page.iterfind(".//tr[@id]")}
    assert set(rows) == set(KNOWN)
    assert rows.items() >= {"FRM-3": "fail", "FRM-1": "pass", "JSN-1": "skip"}.items()


def test_what_a_report_lacks_has_no_part_on_it() -> None:
    _, text = read(report_of(exitCode=0, latencies=[], seeds=[], profile=None))
    lacks = (
        "Latencies",
        "Worst errors",
        "seeds",
        "What is broken",
        "not shown here",
        "left out here",
    )
    assert [each for each in lacks if each in text] == []


def test_ids_are_unique_and_links_lead_somewhere() -> None:
    page, _ = read(full_report(), full_report())
    ids = Counter(page.xpath("//@id"))
    assert max(ids.values()) == 1
    links = {each.removeprefix("#") for each in page.xpath("//@href")}
    labels = {id for each in page.xpath("//@aria-labelledby") for id in each.split()}
    assert links | labels <= set(ids)


@settings(deadline=None, max_examples=40)
@example(">")
@given(st.lists(PIECES | st.characters(), min_size=1, max_size=6).map("".join))
def test_nothing_that_a_testee_sends_changes_the_page(text: str) -> None:
    """The elements are those of a page whose texts hold letters for what could be markup."""

    def elements(text: str) -> list[tuple[Any, list[str], str | None]]:
        page, _ = read(of_a_testee(f"{text}!"))
        return [(it.tag, sorted(it.keys()), it.get("class")) for it in page.iter()]

    pointed_out = ">" * text.startswith(">")
    assert elements(text) == elements(pointed_out + text[len(pointed_out) :].translate(HARMLESS))


def test_each_character_is_to_be_seen() -> None:
    page = html_report(of_a_testee("a\u202eb\x00c\x1bd\ud800e\u2028f"))
    assert r"a\u202eb\x00c\x1bd\ud800e\u2028f" in page
    assert all(c.isprintable() or c in "\n\t" for c in page)


@pytest.mark.parametrize("character", ["<", "\ud800"])
def test_however_much_there_is_it_stays_small_and_says_what_is_left_out(character: str) -> None:
    report = of_a_testee(character * 100_000)
    told = report["requirements"][0]
    result = told["results"][0]
    result["evidence"] = [character * 100_000, *[character * 80] * 3000, character * 100_000]
    result["pictures"] = [{"title": character * 1000, "png": "A" * 300_000}] * 3
    told["results"] = [result] * 600
    report["requirements"] *= 2
    report["latencies"] *= 3000
    report["complaints"] *= 5000
    report["seeds"] = [*range(100_000)]
    text = " ".join(html_report(report, report).split())
    assert len(text.encode()) < MOST_BYTES
    left_out = ("characters left out", "the JSON report has all of it", "more demands are not")
    assert [each for each in left_out if each not in text] == []
    page = html_report(*[brief(full_report())] * 50)
    assert len(page.encode()) < MOST_BYTES
    assert "more reports are not shown here" in page


def test_a_usual_report_is_shown_whole() -> None:
    broken = [
        Result(name, "check_a", Level.WIRE, Verdict.FAIL, "broken", (EVENT,) * 50)
        for name in list(KNOWN)[:60]
    ]
    page, text = read(report_of(*broken))
    assert len(page.find_class("event")) == 60 * 50
    assert "left out here" not in text


def test_each_clause_has_a_name() -> None:
    assert set(CLAUSES) == {name.partition("-")[0] for name in KNOWN}


def test_lines_of_a_transcript_are_told_apart() -> None:
    lines = [EVENT, MORE, BYTES, "             7b", "Traceback:", f">{BYTES[1:]}"]
    found = transcript(lines, 1000)
    assert [it.kind for it in found] == [
        *("event", "more", "hex", "hex", "event", "hex guilty"),
    ]
    assert [it.text for it in found[1:4]] == ["28 bytes: {}", BYTES.strip(), "7b"]


@given(st.lists(st.text(max_size=30), max_size=200), st.integers(16, 400))
def test_of_a_long_transcript_the_ends_are_shown_and_the_rest_is_counted(
    evidence: list[str], most: int
) -> None:
    lines = transcript(evidence, most)
    shown = [it for it in lines if it.kind != "note"]
    assert len(shown) == len(lines) - (len(shown) < len(evidence))
    if len(shown) < len(evidence):
        (note,) = {it.text for it in lines} - {it.text for it in shown}
        assert note.startswith(f"… {len(evidence) - len(shown):,} lines left out")
        assert sum(len(it.text) for it in shown) <= most


@given(st.text(), st.integers(4, 30))
def test_of_a_long_text_the_ends_are_shown_and_the_rest_is_counted(text: str, most: int) -> None:
    head, note, rest = cut(text, most).partition(" … [")
    number, _, tail = rest.partition(" characters left out] … ")
    assert (head + tail == text) if not note else len(head + tail) + int(number) == len(text)
    assert text.startswith(head)
    assert text.endswith(tail)
    assert len(head + tail) <= max(most, len(text) * (not note))
    seen = shown(text, most)
    assert all(c.isprintable() or c in "\n\t" for c in seen)


def test_sentences_are_told_in_parts() -> None:
    assert parts("a `b` c", CODE) == [("a ", False), ("b", True), (" c", False)]
    assert parts("FRM-3, ok", ID) == [("FRM-3", True), (", ok", False)]


def test_an_axis_holds_its_values_between_powers_of_ten() -> None:
    axis = plots.decades_around([0.0004, 0.02])
    assert [axis.x(10.0**power) for power in (-4, -2.5, -1)] == [0, plots.WIDTH / 2, plots.WIDTH]
    assert [it.label for it in axis.ticks()] == ["100 µs", "1 ms", "10 ms", "100 ms"]
    assert [round(it.x) for it in axis.ticks()] == [0, 107, 213, 320]
    for values in ([], [0.0], [1.0], [float("inf")], [1e-300, 1e300]):
        axis = plots.decades_around(values)
        assert 1 <= axis.high - axis.low <= plots.MOST_DECADES
        assert all(0 <= axis.x(it) <= plots.WIDTH for it in (*values, 0.0, 5e-324))
    assert [it.label for it in plots.Decades(-6, 6).ticks()].count("") == 8


def test_bars_are_as_high_as_they_count_and_one_answer_is_to_be_seen() -> None:
    axis = plots.decades_around([1.0, 10.0])
    path = plots.bars([(1.0, 10.0, 10_000), (2.0, 5.0, 5000), (9.99, 10.0, 1)], axis)
    assert path == "M0 72V0H320V72zM96.33 72V36H223.67V72zM319.86 72V70.5H320.66V72z"


@pytest.mark.parametrize(
    ("worst", "budget", "x", "words"),
    [
        (0.0, 0.0, 0.0, "exact"),
        (1.0, 0.0, plots.ROW_WIDTH, "over budget: it had to be exact"),
        (None, 3.0, plots.ROW_WIDTH, "not finite"),
        (3.0, 3.0, plots.AT_BUDGET, "100% of the budget"),
        (0.3, 3.0, plots.AT_BUDGET - plots.ROW_WIDTH / 5, "10% of the budget"),
        (3e-9, 3.0, 0.0, "far below the budget"),
        (60.0, 3.0, plots.ROW_WIDTH, "20 times the budget"),
        (1e308, 5e-324, plots.ROW_WIDTH, "inf times the budget"),
    ],
)
def test_an_error_stands_against_its_budget(
    worst: float | None, budget: float, x: float, words: str
) -> None:
    assert plots.of_budget(worst, budget) == pytest.approx(x)
    assert plots.against(worst, budget) == words


def test_durations_have_three_digits() -> None:
    seconds = (0.0, 4.2e-8, 0.000504, 0.0009996, 0.0234, 1.0, 1234.0, 12345678.0)
    told = "0 µs, 0.042 µs, 504 µs, 1 ms, 23.4 ms, 1 s, 1,234 s, 1.23e7 s"
    assert ", ".join(map(plots.duration, seconds)) == told
