"""Each edition has what binds its reader, and leads nowhere else."""

import os
import re
from pathlib import Path

import pytest
from splatbus_schemas import requirements
from splatbus_schemas.chapters import ANNEX_B, mentioned
from splatbus_schemas.editions import CHECKLIST, FILES, PLACES
from splatbus_schemas.outline import CUDA_TITLE
from splatbus_schemas.prose import CHECKOUT, documents

from tests.size import SENTENCES
from tests.spec.test_prose import anchor, headings

SPEC = CHECKOUT / "spec"
DOCUMENTS = documents()
TEXTS = {reader: DOCUMENTS[place] for reader, place in PLACES.items()}
ALL = requirements("1.1")
every_edition = pytest.mark.parametrize("reader", PLACES, ids=lambda each: each or "complete")
MOST_WORDS, WORDS_PER_SENTENCE = 12_930, 30
"""And as many more for each sentence that is new since `tests/size.py` was written."""


def own(reader: str) -> list[str]:
    return [each.id for each in ALL.values() if not reader or reader in each.binds]


def unfenced(reader: str) -> str:
    return re.sub(r"^```.*?^```$", "", TEXTS[reader], flags=re.M | re.S)


@every_edition
def test_it_has_every_sentence_that_binds_its_reader_once_and_whole(reader: str) -> None:
    found = re.findall(r"^\*\*\[([A-Z]{3}-\d+)\]\*\*", TEXTS[reader], re.MULTILINE)
    assert sorted(found) == sorted(own(reader))
    text = re.sub(r"\[((?:chapter|section) [^\]]*)\]\([^)]*\)", r"\1", TEXTS[reader])
    for name in found:
        number = r"(?:chapter|section) [\d.]+"
        sentence = re.escape(re.sub(number, "@", ALL[name].sentence)).replace("@", number)
        assert re.search(rf"^\*\*\[{name}\]\*\* {sentence}$", text, re.MULTILINE), name


@every_edition
def test_what_it_quotes_binds_the_other_peer(reader: str) -> None:
    quoted = re.findall(r"^> \*\*\[([A-Z]{3}-\d+)\]\*\* (.+)", unfenced(reader), re.MULTILINE)
    quoted = [name for name, sentence in quoted if not sentence.endswith("…")]
    assert len(set(quoted)) == len(quoted)
    assert not set(quoted) & set(own(reader))


@every_edition
def test_every_id_that_it_mentions_stands_in_it(reader: str) -> None:
    text = unfenced(reader).partition(f"## {CHECKLIST}")[0]
    assert set(mentioned(text)) & ALL.keys() <= set(re.findall(r"\*\*\[([A-Z]{3}-\d+)\]\*\*", text))


@every_edition
def test_no_two_headings_have_the_same_anchor_and_all_links_resolve(reader: str) -> None:
    page = SPEC / PLACES[reader]
    anchors = [anchor(each) for each in headings(unfenced(reader))]
    assert len(set(anchors)) == len(anchors)
    text, _, files = unfenced(reader).partition(f"\n## {FILES}\n")
    links = re.findall(r"(!?)\[[^\]]*\]\(([^)]+)\)", text)
    assert {target[1:] for _, target in links if target.startswith("#")} <= set(anchors)
    elsewhere = [(mark, link) for mark, link in links if link[0] != "#" and "://" not in link]
    assert all(mark and link.endswith("pictures/axes.svg") for mark, link in elsewhere)
    listed = re.findall(r"^- \[(.+)\]\((.+)\)$", files, re.MULTILINE)
    assert listed
    for path, link in listed:
        assert path.startswith(
            ("spec/vectors/", "spec/vendors.md", "schemas/", "conformance/SCENE.md")
        )
        assert Path(os.path.normpath(page.parent / link)) == CHECKOUT / path
        assert (CHECKOUT / path).exists()


@every_edition
def test_no_number_of_a_chapter_stands_there_without_a_link(reader: str) -> None:
    text = re.sub(r"\[[^\]]*\]\(#[^)]*\)", "", unfenced(reader))
    assert re.findall(r"\b[Cc]hapters? \d|\b[Ss]ections? \d+\.\d", text) == []


@every_edition
def test_chapters_and_sections_are_numbered(reader: str) -> None:
    for each in headings(unfenced(reader))[1:]:
        assert each in (CHECKLIST, FILES) or re.match(
            r"\d+\. |\d+\.\d+ |Annex [A-Z]\. |[A-Z]\.\d+ ", each
        )


@pytest.mark.parametrize("reader", [each for each in PLACES if each])
def test_the_checklist_names_every_sentence(reader: str) -> None:
    _, _, rest = TEXTS[reader].partition(f"## {CHECKLIST}")
    checked = re.findall(r"^- \[ \] ([A-Z]{3}-\d+) .*\b(?:must|should|may)\b", rest, re.MULTILINE)
    assert sorted(checked) == sorted(own(reader))


def test_each_difference_is_noted_where_it_matters() -> None:
    table = (SPEC / ANNEX_B).read_text("utf-8").partition("## B.3")[2]
    rows = re.findall(r"^\| ([A-Z]{3}[^:]*): ", table, re.MULTILINE)
    names = [name for row in rows for name in row.split(", ")]
    assert TEXTS[""].count("\n> In 1.1 (") == len(names) > 0
    for reader in PLACES:
        for name in {name for name in names if "-" in name} & set(own(reader)):
            (facts,) = re.findall(rf"^\*\*\[{name}\]\*\*.+\n\n((?:> .+\n)+)", TEXTS[reader], re.M)
            assert "> In 1.1 (" in facts or (reader == "client" and name[:3] == "JSN"), name


def test_the_client_s_edition_is_short() -> None:
    """Without its annex about GPUs and its checklist; marks such as `|` are no words."""
    (part,) = re.findall(
        rf"^([\s\S]*)^## Annex .\. {re.escape(CUDA_TITLE)}$", TEXTS["client"], re.M
    )
    words = len([word for word in part.split() if re.search(r"\w", word)])
    assert words <= MOST_WORDS + WORDS_PER_SENTENCE * (len(ALL) - SENTENCES)


def test_a_gpu_is_for_an_annex() -> None:
    (annex,) = re.findall(
        rf"^## Annex .\. {re.escape(CUDA_TITLE)}$([\s\S]*?)^## ", TEXTS["client"], re.M
    )
    found = re.findall(r"^\*\*\[([A-Z]{3}-\d+)\]", annex, re.M)
    assert {"BUF-11", "CUD-2", "CUD-5", "CUD-6", "MEM-17", "IMG-8"} <= set(found)
