"""`splatbus-conformance compare`: stored reports beside each other."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.conformance.harness import said
from tests.conformance.reports.stored_reports import changed, of_a_testee, report_of

MET, BROKEN, UNSEEN = "pass", "fail", "skip"


def report(name: str = "a viewer", harness: str = "1", **verdicts: str) -> dict[str, Any]:
    """Of a testee, with the verdict on each of some requirements."""
    made = report_of(testee=name)
    known = {id.replace("_", "-"): verdict for id, verdict in verdicts.items()}
    for each in made["requirements"]:
        each["verdict"] = known.get(each["id"], UNSEEN)
    return made | {"environment": made["environment"] | {"harness": harness}}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    before = report(FRM_1=MET, FRM_3=BROKEN, FRM_4=MET, JSN_1=MET, JSN_6="warn")
    after = report(FRM_1=MET, FRM_3=MET, FRM_4=BROKEN, JSN_6="warn")
    other = report("another viewer", FRM_1=MET, FRM_3=MET)
    newer = report(harness="2", FRM_1=BROKEN)
    for name, each in (("1", before), ("2", after), ("3", other), ("4", newer)):
        (tmp_path / f"{name}.json").write_text(json.dumps(each), "utf-8")
    return tmp_path


def test_what_was_mended_and_what_broke_is_told_of_one_testee(folder: Path) -> None:
    status, output = said("compare", str(folder))
    assert status == 0, output
    told = [line.strip() for line in output.splitlines()]
    assert "1 to 2: mended: FRM-3" in told
    assert "1 to 2: newly broken: FRM-4" in told
    assert "1 to 2: no longer observed: JSN-1" in told
    assert not any(line.startswith("2 to 3") for line in told)
    rows = {line.split()[0]: line.split("  ") for line in told if line[3:4] == "-"}
    assert [*rows] == ["FRM-3", "FRM-4", "JSN-1", "JSN-6", "FRM-1"]
    assert [it.strip() for it in rows["FRM-4"][1:] if it] == ["met", "broken", "not observed"]
    heads = [line for line in told if "judged by splatbus-conformance" in line]
    assert [line[-1] for line in heads] == ["1", "2"], "versions of the harness are not mixed"


def test_pages_say_the_same_and_nothing_of_a_testee_acts_there(folder: Path) -> None:
    evil = of_a_testee("<script>|`\x1b[2J")
    (folder / "evil.json").write_text(json.dumps(evil), "utf-8")
    pages = folder / "made.md", folder / "made.html"
    options = [
        word for it in pages for word in (f"--{it.suffix[1:]}".replace("md", "markdown"), it)
    ]
    assert said("compare", str(folder), *map(str, options))[0] == 0
    markdown, page = (it.read_text("utf-8") for it in pages)
    assert "| FRM-4 | met | broken | not observed |" in markdown
    assert "<script>" not in page
    assert "\x1b" not in page + markdown
    assert page.count("<article>") == markdown.count("## SplatBus") == 3


@pytest.mark.parametrize("holds", [None, "{", json.dumps(changed(report(), ("made",), "now"))])
def test_what_is_no_report_is_told(holds: str | None, tmp_path: Path) -> None:
    if holds:
        (tmp_path / "a.json").write_text(holds, "utf-8")
    status, output = said("compare", str(tmp_path))
    assert status == 2
    assert str(tmp_path) in output
