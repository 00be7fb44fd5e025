"""Editions, made of a specification of a few lines."""

import pytest
from splatbus_schemas import editions, outline

FRAMES = """\
# 2. Framing

**Status: old.** All of it.

As section 2.1 of this says, and RFC 4648, section 4.

## 2.1 Packets

**[FRM-1]** A sender MUST send `one`.

> Binds: client, server. Acceptable: conforms.
> Why: what begins must end (chapter 2).

**[FRM-10]** A server MUST end it.

> Binds: server.
> Why: FRM-11 does not.

A server that does not may be closed.

A client waits for FRM-10.

**[FRM-11]** A server MUST sleep.

> Binds: server.

```
# 2. no heading, and no chapter 9
```

## 2.2 Rest

**[FRM-12]** A server MUST rest.

> Binds: server.
"""
MORE = """\
# 2. More

Chapters of [its second](../1.0/02-framing.md), [data](../../data.json), ![axes](../axes.svg).
In section 2.1 there; chapter 2 of 1.0 and chapter 2, section 2.1.

## 2.1 Packets

**[MOR-1]** With `cuda_ipc` a client SHOULD end within 5 seconds of what a sender that knows its own end has sent it.

> Binds: client.
"""  # noqa: E501 - a sentence is one line
ANNEX = """\
# Annex B. Differences

## B.3 Sentences

| 1.0 | on a connection that speaks 1.1 |
|---|---|
| FRM-10: an end | two (section 2.1) |
| FRM: bytes | all of them |
"""
PART = "# A client\n\nBegin with [packets](../../1.0/02-framing.md).\n"
SPEC = {
    "1.0/02-framing.md": FRAMES,
    "1.1/02-more.md": MORE,
    "1.1/annex-b-compatibility.md": ANNEX,
    "editions/parts/client.md": PART,
}
DOCUMENTS = editions.documents(SPEC)
CLIENT, SERVER, COMPLETE = (DOCUMENTS[editions.PLACES[each]] for each in ("client", "server", ""))


def lines_from(text: str, start: str, count: int) -> list[str]:
    lines = text.splitlines()
    assert lines.count(start) == 1, start
    return lines[lines.index(start) :][:count]


def test_chapters_of_both_versions_are_numbered_in_the_order_of_the_outline() -> None:
    assert [line for line in COMPLETE.splitlines() if line.startswith("#")] == [
        outline.HEADS[""].partition("\n")[0],
        "## 1. Framing",
        "### 1.1 Packets",
        "# 2. no heading, and no chapter 9",
        "### 1.2 Rest",
        "## 2. More",
        "### 2.1 Packets",
        "## Files beside this document",
    ]
    assert lines_from(COMPLETE, "- [1. Framing](#1-framing)", 2)[1] == (
        "  - [1.1 Packets](#11-packets)"
    )


def test_the_state_of_another_document_is_left_out() -> None:
    assert "Status" not in COMPLETE


def test_a_reference_leads_to_its_place_here() -> None:
    assert "As [section 1.1](#11-packets) of this says, and RFC 4648, section 4." in COMPLETE
    assert "must end ([chapter 1](#1-framing))." in COMPLETE
    assert (
        "In [section 1.1](#11-packets); [chapter 1](#1-framing) and [chapter 2](#2-more), "
        "[section 2.1](#21-packets)." in COMPLETE
    )


def test_a_link_leads_to_the_chapter_here_and_a_file_is_listed_at_the_end() -> None:
    assert "[its second](#1-framing), data, ![axes](../../axes.svg)." in COMPLETE
    assert COMPLETE.endswith("\n\n- [data.json](../../../data.json)\n")


def test_what_is_fenced_stays_as_it_is() -> None:
    assert "```\n# 2. no heading, and no chapter 9\n```" in COMPLETE


def test_a_difference_is_noted_at_its_requirement_and_at_its_chapter() -> None:
    whole = lines_from(COMPLETE, "**[FRM-10]** A server MUST end it.", 6)
    assert whole[4] == "> In 1.1 (an end): two ([section 2.1](#21-packets))."
    assert whole[5] == ""
    assert "## 1. Framing\n\n> In 1.1 (bytes): all of them.\n\nAs " in COMPLETE
    assert COMPLETE.count("> In 1.1") == 2


def test_a_sentence_without_facts_has_its_note_in_a_paragraph_of_its_own() -> None:
    assert "A server MUST end it.\n\n> In 1.1 (an end)" in SERVER


def test_an_edition_has_the_sentences_of_its_reader_and_no_reasons() -> None:
    whole = lines_from(CLIENT, "**[FRM-1]** A sender MUST send `one`.", 4)
    assert whole[2:] == ["> Acceptable: conforms.", ""]
    assert "Why" not in CLIENT
    assert "FRM-11" not in CLIENT


def test_an_edition_quotes_what_it_mentions_of_the_other_peer() -> None:
    assert "\n> **[FRM-10]** A server MUST end it.\n> In 1.1 (an end): " in CLIENT
    assert "A client waits" in CLIENT
    assert "A server that does not" not in CLIENT


def test_a_section_that_is_referred_to_is_quoted_whole_and_another_left_out() -> None:
    assert "Rest" not in CLIENT
    referred = {**SPEC, "1.1/02-more.md": MORE + "\nSee section 2.2 there.\n"}
    found = editions.documents(referred)[editions.PLACES["client"]]
    assert "> **[FRM-12]** A server MUST rest." in found


def test_a_part_comes_first_in_its_own_edition_alone() -> None:
    assert "## 1. A client\n\nBegin with [packets](#2-framing).\n\n## 2. Framing\n" in CLIENT
    assert "Begin with" not in SERVER + COMPLETE


def test_what_is_about_a_gpu_is_in_an_annex_of_the_client() -> None:
    annex = CLIENT.partition(f"## Annex A. {outline.CUDA_TITLE}")[2]
    assert "### A.1 Packets\n\n**[MOR-1]** With" in annex


def test_the_checklist_has_a_line_for_each_sentence() -> None:
    assert "**2. Framing**\n\n- [ ] FRM-1 must send `one`.\n" in CLIENT
    assert "a client should end within 5 seconds of what a sender that knows its …\n" in CLIENT
    assert "Checklist" not in COMPLETE


def test_a_chapter_that_no_outline_names_is_there_all_the_same() -> None:
    new = {**SPEC, "1.1/99-new.md": "# 99. New\n\n**[NEW-1]** A peer MAY.\n\n> Binds: client.\n"}
    assert "## 4. New\n\n**[NEW-1]** A peer MAY." in editions.documents(new)["editions/client.md"]


@pytest.mark.parametrize(
    ("path", "before", "after", "complaint"),
    [
        ("1.0/02-framing.md", "section 2.1", "section 2.3", r"section 2\.3"),
        ("1.0/02-framing.md", "chapter 2", "chapter 3", r"chapter 3"),
        ("1.1/02-more.md", "chapter 2 of 1.0", "chapter 4 of 1.0", r"chapter 4"),
        ("1.1/annex-b-compatibility.md", "FRM-10", "FRM-13", "FRM-13"),
        ("1.1/annex-b-compatibility.md", "FRM:", "CHN:", "CHN"),
        ("1.1/annex-b-compatibility.md", "| 1.0 |", "| before |", "not enough values"),
    ],
)
def test_what_leads_nowhere_is_an_error(path: str, before: str, after: str, complaint: str) -> None:
    assert before in SPEC[path]
    with pytest.raises(ValueError, match=complaint):
        editions.documents({**SPEC, path: SPEC[path].replace(before, after)})
