"""The document that holds all of 1.1, made of a specification of a few lines."""

import pytest
from splatbus_schemas import complete

FRAMES = """\
# 2. Framing

As section 2.1 of this says, and RFC 4648, section 4.

## 2.1 Packets

**[FRM-1]** A packet MUST be `one`.

> Binds: client. Acceptable: conforms.

**[FRM-10]** A packet MUST end.

> Binds: client. Acceptable: conforms.
> Why: what begins must end (chapter 2).

```
# 2. no heading, and no chapter 9
```
"""
MORE = """\
# 2. More

Chapters of [1.0](../1.0/README.md), [its second](../1.0/02-framing.md), [data](../../data.json).
In section 2.1 there; chapter 2 of 1.0 and chapter 2, section 2.1.

## 2.1 Packets

Longer.
"""
ANNEX = """\
# Annex B. Differences

| 1.0 | on a connection that speaks 1.1 |
|---|---|
| FRM-10: an end | two (section 2.1) |
| FRM: bytes | all of them |
"""
CONTENTS = "| chapter | ids |\n|---|---|\n| 1. Introduction | |\n\n"
SPEC = {
    "1.0/02-framing.md": FRAMES,
    "1.0/README.md": f"# Version 1.0\n\n## Contents\n\n{CONTENTS}Hi.\n",
    "1.1/02-more.md": MORE,
    "1.1/annex-b-compatibility.md": ANNEX,
    "1.1/README.md": f"# Version 1.1\n\n{CONTENTS}## 1.1 Words\n\nBye.\n",
}
DOCUMENT = complete.document(SPEC)


def lines_from(start: str, count: int) -> list[str]:
    lines = DOCUMENT.splitlines()
    assert lines.count(start) == 1
    return lines[lines.index(start) :][:count]


def test_the_contents_list_all_headings_in_reading_order() -> None:
    assert lines_from("- [Part I. What 1.0 says](#part-i-what-10-says)", 10) == [
        "- [Part I. What 1.0 says](#part-i-what-10-says)",
        "  - [I.1. Introduction](#i1-introduction)",
        "  - [I.2. Framing](#i2-framing)",
        "    - [I.2.1 Packets](#i21-packets)",
        "- [Part II. What 1.1 adds](#part-ii-what-11-adds)",
        "  - [II.1. Introduction](#ii1-introduction)",
        "    - [II.1.1 Words](#ii11-words)",
        "  - [II.2. More](#ii2-more)",
        "    - [II.2.1 Packets](#ii21-packets)",
        "  - [Annex B. Differences](#annex-b-differences)",
    ]


def test_the_contents_of_the_parts_are_left_out() -> None:
    assert lines_from("### I.1. Introduction", 4) == ["### I.1. Introduction", "", "Hi.", ""]
    assert "| chapter | ids |" not in DOCUMENT


def test_a_reference_leads_to_its_part() -> None:
    assert "As [section I.2.1](#i21-packets) of this says, and RFC 4648, section 4." in DOCUMENT
    assert "must end ([chapter I.2](#i2-framing))." in DOCUMENT
    assert "[chapter I.2](#i2-framing) of 1.0 and [chapter II.2](#ii2-more), " in DOCUMENT
    assert "[section II.2.1](#ii21-packets)." in DOCUMENT


def test_a_link_leads_to_the_chapter_here_or_to_the_file_from_there() -> None:
    assert (
        "[1.0](#part-i-what-10-says), [its second](#i2-framing), [data](../../../data.json)."
        in DOCUMENT
    )


def test_what_is_fenced_stays_as_it_is() -> None:
    assert "```\n# 2. no heading, and no chapter 9\n```" in DOCUMENT


def test_a_difference_is_noted_at_its_requirement_and_at_its_chapter() -> None:
    whole = lines_from("**[FRM-10]** A packet MUST end.", 6)
    assert whole[4] == "> In 1.1 (an end): two ([section II.2.1](#ii21-packets))."
    assert whole[5] == ""
    assert lines_from("### I.2. Framing", 4)[2:] == ["> In 1.1 (bytes): all of them.", ""]
    assert DOCUMENT.count("> In 1.1") == 2


@pytest.mark.parametrize(
    ("path", "before", "after", "complaint"),
    [
        ("1.0/02-framing.md", "section 2.1", "section 2.2", r"section I\.2\.2"),
        ("1.0/02-framing.md", "chapter 2", "chapter 3", r"chapter I\.3"),
        ("1.1/02-more.md", "chapter 2 of 1.0", "chapter 4 of 1.0", r"chapter I\.4"),
        ("1.1/annex-b-compatibility.md", "FRM-10", "FRM-11", "FRM-11"),
        ("1.1/annex-b-compatibility.md", "FRM:", "CHN:", "CHN"),
        ("1.1/annex-b-compatibility.md", "| 1.0 |", "| before |", "not enough values"),
    ],
)
def test_what_leads_nowhere_is_an_error(path: str, before: str, after: str, complaint: str) -> None:
    assert before in SPEC[path]
    with pytest.raises(ValueError, match=complaint):
        complete.document({**SPEC, path: SPEC[path].replace(before, after)})
