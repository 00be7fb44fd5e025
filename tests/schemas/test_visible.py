"""Whatever is shown of what others said, nothing of it acts on a terminal or in a CI job."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_schemas.visible import visible

WORDS = st.lists(
    st.sampled_from(["::", ":", "##", "[", "#", "\n", "\r", " ", "\x1b", "error", "é"])
)


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ("a word, and 漢字", "a word, and 漢字"),
        ("\x1b[2Jgone", "\\x1b[2Jgone"),
        ("one\r\ntwo\x9b", "one\\x0d\\x0atwo\\x9b"),
        ("abc\u202ecba", "abc\\u202ecba"),
        ("\ud800", "\\ud800"),
        ("\U000e0041", "\\U000e0041"),
        ("::error file=a::b", ":\\:error file=a::b"),
        ("  ::error::", "  :\\:error::"),
        ("a ##[error]b", "a #\\#[error]b"),
        ("##vso[task]", "#\\#vso[task]"),
        ("## a heading", "## a heading"),
    ],
)
def test_what_cannot_be_seen_is_escaped(given: str, shown: str) -> None:
    assert visible(given) == shown


def test_what_is_kept_stays_and_each_line_is_looked_at() -> None:
    assert visible("one\n\t::error::\n", kept="\n\t") == "one\n\t:\\:error::\n"


@given(st.one_of(st.text(st.characters()), WORDS.map("".join)), st.sampled_from(["", "\n", "\n\t"]))
def test_nothing_is_left_that_acts(text: str, kept: str) -> None:
    shown = visible(text, kept=kept)
    assert all(character.isprintable() or character in kept for character in shown)
    assert not re.search(r"^\s*::|##\w*\[", shown, re.MULTILINE)
    shown.encode()


def test_many_empty_lines_take_no_longer_than_other_text() -> None:
    """Each line is looked at once, not again from every line before it: that took hours."""
    assert visible("\n" * 300_000 + " ::error::", kept="\n").endswith("\n :\\:error::")
