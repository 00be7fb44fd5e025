"""The document that holds all of 1.1 lacks nothing, and each place in it has a name of its own."""

import re

from splatbus_schemas import requirements
from splatbus_schemas.complete import ANNEX_B, PLACE
from splatbus_schemas.prose import CHECKOUT

from tests.spec.test_prose import anchor, headings

SPEC = CHECKOUT / "spec"
PAGE = SPEC / PLACE
TEXT = PAGE.read_text("utf-8")


def test_it_has_every_requirement_once_and_in_order() -> None:
    found = re.findall(r"^\*\*\[([A-Z]{3}-\d+)\]\*\*", TEXT, re.MULTILINE)
    assert found == list(requirements("1.1"))


def test_no_two_headings_have_the_same_anchor() -> None:
    anchors = [anchor(each) for each in headings(PAGE)]
    assert len(set(anchors)) == len(anchors)


def test_every_chapter_and_section_is_numbered_and_in_the_contents() -> None:
    _title, _contents, *others = headings(PAGE)
    for each in others:
        assert re.match(r"Part I+\. |I+\.\d+\. |I+\.\d+\.\d+ |Annex [A-Z]\. |[A-Z]\.\d+ ", each)
    listed = re.findall(r"^ *- \[(.+)\]\(#(.+)\)$", TEXT, re.MULTILINE)
    assert listed == [(each, anchor(each)) for each in others]


def test_each_difference_is_noted_where_it_matters() -> None:
    table = (SPEC / ANNEX_B).read_text("utf-8").partition("## B.3")[2]
    rows = re.findall(r"^\| ([A-Z]{3}[^:]*): ", table, re.MULTILINE)
    assert rows
    names = [name for row in rows for name in row.split(", ")]
    assert TEXT.count("\n> In 1.1 (") == len(names)
    for name in names:
        if "-" in name:
            (requirement,) = re.findall(rf"^\*\*\[{name}\]\*\*.+\n\n((?:> .+\n)+)", TEXT, re.M)
            assert "> In 1.1 (" in requirement, name


def test_it_sends_the_reader_to_no_chapter_of_its_own_elsewhere() -> None:
    leaving = set(re.findall(r"\]\((\.\.[^)#]*)\)", TEXT.partition("## Contents")[2]))
    assert not [link for link in leaving if re.search(r"1\.[01]/", link)]
