"""The pages about judging say what the harness knows."""

import re

from splatbus_conformance.checks.registry import bound, exclusions, judges
from splatbus_schemas import requirements

from conformance.site.splatbus_site import judged
from tests.site.test_plain_markdown import TEXTS

MATRIX = TEXTS[judged.KILL_MATRIX]
ROWS = re.findall(r"^\| ([A-Z]{3}-\d+) \| `([\w.-]+)` \|", MATRIX, re.MULTILINE)


def test_the_coverage_table_has_each_requirement_with_its_judges_or_a_reason() -> None:
    page = judged.coverage(MATRIX)
    rows = dict(re.findall(r'^\| <span id="coverage-([A-Z]{3}-\d+)"></span>(.*)$', page, re.M))
    assert rows.keys() == requirements("1.1").keys()
    for peer in judged.PEERS:
        for name in bound(peer):
            if name in exclusions(peer):
                assert f"{peer} not judged: " in rows[name], name
            for judge in judges(peer).get(name, []):
                shown = f'{peer} <span class="assurance">{judge.level}</span> `{judge.name}`'
                assert shown in rows[name], name


def test_the_kill_matrix_keeps_every_row() -> None:
    page = judged.kill_matrix(MATRIX)
    assert len(ROWS) > 400
    for name, program in ROWS:
        anchor = rf'(<span id="kills-{name}"></span>)?'
        assert re.search(rf"^\| {anchor}{name} \| `{program}`", page, re.M)
    anchors = re.findall(r'id="kills-([^"]+)"', page)
    assert sorted(anchors) == sorted({name for name, _ in ROWS})
    assert page.partition("## Conforming")[2] == MATRIX.partition("## Conforming")[2]


def test_kills_are_counted() -> None:
    head = "| breaks | mutant | what it does | check | fate | with the code |\n| --- |\n"
    row = "| FRM-1 | `a` | A. | `c` | {} | `r` |\n"
    assert judged.killed(head + row.format("killed") + row.format("**survived**")) == {"FRM-1": 1}
    assert sum(judged.killed(MATRIX).values()) == int(re.findall(r"\*\*(\d+) of", MATRIX)[0])


def test_every_check_and_rule_has_one_anchor() -> None:
    anchors = re.findall(r'id="(\w+)"', judged.checks())
    assert len(anchors) == len(set(anchors))
    assert set(anchors) == judged.check_names()
    assert "check_bad_length_closes" in anchors
