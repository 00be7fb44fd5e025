"""Texts of a page: cut in the middle, and every character to be seen."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markupsafe import Markup
from splatbus_conformance.reports.files.html.text import (
    ALL_OF_IT,
    TranscriptLine,
    cut,
    ids,
    seen,
    spans,
    transcript,
)

EVENT = "   1.0000 s  msg #1  client → server"
MORE = "             28 bytes: {}"
BYTES = "             1c 00 00 00 7b … 40 5d (432 bytes)"


def test_lines_of_a_transcript_are_told_apart() -> None:
    lines = transcript([EVENT, MORE, BYTES, "             7b", "Traceback:"], 1000)
    assert [line.kind for line in lines] == ["event", "more", "hex", "hex", "event"]
    assert lines[1].text == "28 bytes: {}"


def test_what_a_failure_is_about_is_told_apart() -> None:
    lines = transcript([f">{line[1:]}" for line in (EVENT, MORE, BYTES)], 1000)
    assert [line.kind for line in lines] == ["event guilty", "more guilty", "hex guilty"]
    assert lines[0].text.startswith(">")
    assert [line.text for line in lines[1:]] == [MORE.strip(), BYTES.strip()]


@given(st.lists(st.text(max_size=30), max_size=200), st.integers(16, 400))
def test_what_is_shown_of_a_transcript_is_its_ends_and_what_is_not_is_counted(
    evidence: list[str], most: int
) -> None:
    lines = transcript(evidence, most)
    notes = [line for line in lines if line.kind == "note"]
    shown = [line for line in lines if line.kind != "note"]
    assert len(notes) == (len(shown) < len(evidence))
    if notes:
        assert notes[0].text.startswith(f"… {len(evidence) - len(shown):,} lines left out")
        assert ALL_OF_IT in notes[0].text
        assert sum(len(line.text) for line in shown) <= most
    else:
        assert len(shown) == len(evidence)


@given(st.text(max_size=300), st.integers(4, 100))
def test_a_cut_text_keeps_its_ends_and_counts_the_rest(text: str, most: int) -> None:
    found = cut(text, most)
    if len(text) <= most:
        assert found == text
    else:
        head, _, rest = found.partition(" … [")
        assert text.startswith(head)
        assert text.endswith(rest.partition("] … ")[2])
        assert len(found) <= most + len(" … [1,000,000 characters left out] … ")


@given(st.text())
def test_every_character_of_a_text_can_be_seen(text: str) -> None:
    found = seen(text)
    assert all(c.isprintable() or c in "\n\t" for c in found)
    found.encode("utf-8")


@pytest.mark.parametrize("value", [Markup("<b>\u202e"), 3, None, 0.5])
def test_what_is_no_text_of_a_testee_stays_as_it_is(value: object) -> None:
    assert seen(value) is value


def test_code_and_ids_are_apart() -> None:
    assert [tuple(it) for it in spans("a `b` c")] == [("a ", False), ("b", True), (" c", False)]
    assert [tuple(it) for it in ids("FRM-3, ok")] == [("FRM-3", True), (", ok", False)]
    assert transcript([], 10) == ()
    assert TranscriptLine("a", "event").text == "a"
