"""The chapters keep their form: no stray key words, no dangling links, ids or sections."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from splatbus_schemas import VERSIONS, requirements
from splatbus_schemas.prose import ANY_ID, CHECKOUT, KEYWORD, chapters, requirements_in

SPEC = CHECKOUT / "spec"
PAGES = sorted(SPEC.rglob("*.md"))
CHAPTERS = [path for version in VERSIONS for path in chapters(version)]
ALL_IDS = requirements(VERSIONS[-1])
SUBJECTS = "|".join(sorted({each.split("-")[0] for each in ALL_IDS}))


def page(path: Path) -> str:
    return path.relative_to(SPEC).as_posix()


def text_of(path: Path) -> str:
    """The page without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", path.read_text("utf-8"), flags=re.M | re.S)


def headings(text: str) -> list[str]:
    return re.findall(r"^#+ (.+)$", text, re.M)


def anchor(heading: str) -> str:
    """The fragment by which GitHub links to a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def section_numbers(version: str) -> set[str]:
    found = (
        re.match(r"\d+(\.\d+)?", h) for path in chapters(version) for h in headings(text_of(path))
    )
    return {match[0] for match in found if match}


def links(path: Path) -> Iterator[str]:
    found = re.findall(r"\]\(([^)\s]+)\)", text_of(path))
    return (target for target in found if not target.startswith(("http://", "https://")))


@pytest.mark.parametrize("path", PAGES, ids=page)
def test_no_key_word_stands_outside_of_a_requirement(path: Path) -> None:
    about = ("The key words", "> **[", "A peer conforms", "A SHOULD may")
    lines = path.read_text("utf-8").splitlines()
    normative = [it for it in lines if KEYWORD.search(it) and not it.startswith(about)]
    assert [it for it in normative if not ANY_ID.match(it)] == []


@pytest.mark.parametrize("path", PAGES, ids=page)
def test_ids_that_are_mentioned_exist(path: Path) -> None:
    mentioned = re.findall(rf"\b(?:{SUBJECTS})-\d+\b", path.read_text("utf-8"))
    assert set(mentioned) <= set(ALL_IDS)


@pytest.mark.parametrize("path", CHAPTERS, ids=page)
def test_sections_that_are_mentioned_exist(path: Path) -> None:
    own = section_numbers(path.parent.name)
    former = section_numbers("1.0")
    for number, elsewhere in re.findall(r"\bsection (\d+\.\d+)( there)?", text_of(path)):
        assert number in (former if elsewhere else own | former), f"{page(path)}: section {number}"


@pytest.mark.parametrize("version", VERSIONS)
def test_every_chapter_is_in_the_table_of_contents(version: str) -> None:
    introduction, *others = sorted(chapters(version), key=lambda path: path.name != "README.md")
    assert introduction.name == "README.md"
    assert {path.name for path in others} <= set(links(introduction))


@pytest.mark.parametrize("version", VERSIONS)
def test_the_table_of_contents_lists_the_subjects_of_a_chapter(version: str) -> None:
    introduction = (SPEC / version / "README.md").read_text("utf-8")
    listed = dict(re.findall(r"^\| \[.+\]\((.+\.md)\)[^|]*\| ([A-Z, ]*)\|", introduction, re.M))
    for path in chapters(version):
        found = requirements_in(path.read_text("utf-8"), path.name)
        subjects = {each["id"].split("-")[0] for each in found}
        assert set(re.findall(r"[A-Z]{3}", listed.get(path.name, ""))) == subjects, page(path)


@pytest.mark.parametrize("version", VERSIONS)
def test_chapters_are_numbered_as_their_files(version: str) -> None:
    for path in chapters(version):
        if path.name != "README.md":
            first, second, *_ = path.stem.split("-")
            number = f"Annex {second.upper()}" if first == "annex" else int(first)
            assert headings(text_of(path))[0].startswith(f"{number}. "), page(path)
