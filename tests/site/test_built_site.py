"""The site, built as its users build it: what it has, and that every link in it leads somewhere."""

import json
import re
import subprocess
import sys
import urllib.parse
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from lxml import html
from playwright.sync_api import BrowserContext
from splatbus_conformance.checks.registry import bound, exclusions, judges
from splatbus_schemas import VERSIONS, examples, names, requirements, schema

from conformance.site.splatbus_site import judged, layout, links, specification
from tests.browser import chromium
from tests.site.test_plain_markdown import ROOT, TEXTS

ALL = requirements(VERSIONS[-1])
MENTION = re.compile(rf"(?<![\w-])(?:{'|'.join({name[:3] for name in ALL})})-\d+(?![\w-])")
FETCHED = ("//script/@src", "//img/@src", "//link[@rel!='canonical']/@href", "//iframe/@src")
MATRIX = TEXTS[judged.KILL_MATRIX]
Pages = Mapping[str, Any]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the site. A warning fails the build, and so does a link that Sphinx misses."""
    site = tmp_path_factory.mktemp("site") / "html"
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-n", "-q"]
    command += ["-d", str(site.with_name("doctrees")), "conformance/site", str(site)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    return site


@pytest.fixture(scope="module")
def pages(built: Path) -> Pages:
    """Each page, parsed, by its path in the site."""
    return {
        path.relative_to(built).as_posix(): html.parse(str(path)).getroot()
        for path in sorted(built.rglob("*.html"))
        if "_static" not in path.parts
    }


def page_of(source: str) -> str:
    return f"{layout.docname(source)}.html"


def targets(pages: Pages, page: str, path: str = "//a") -> set[tuple[str, str]]:
    """The paths in the site and the fragments to which links on a page lead."""
    found = set()
    for href in pages[page].xpath(f"{path}/@href"):
        if not links.is_elsewhere(href):
            there, _, fragment = urllib.parse.unquote(href).partition("#")
            found.add((links.resolved(page, there), fragment))
    return found


def plain(text: str) -> str:
    """The text without what Markdown and typography change: marks and spaces."""
    return re.sub(r"[\W_]", "", text)


def test_every_markdown_file_is_a_page_and_every_link_leads_to_an_anchor_that_stands_once(
    built: Path, pages: Pages
) -> None:
    ids = {name: page.xpath("//@id") for name, page in pages.items()}
    for name, found in ids.items():
        assert len(found) == len(set(found)), name
    dangling = [
        (name, path, fragment)
        for name in pages
        for path, fragment in targets(pages, name)
        if not (built / path).is_file() or (fragment and fragment not in ids.get(path, ()))
    ]
    assert dangling == []
    pages_of = {page_of(it) for it in TEXTS if not it.startswith(("tests/", *layout.PARTS))}
    assert pages_of <= set(pages)
    for version, whole in specification.WHOLE.items():
        assert sorted(set(ids[page_of(whole)]) & set(ALL)) == sorted(requirements(version))


def test_a_requirement_stands_in_its_chapter_and_leads_to_what_judges_it(pages: Pages) -> None:
    coverage, index = page_of(judged.COVERAGE), page_of(specification.INDEX)
    for name, it in ALL.items():
        (box,) = pages[page_of(it.chapter)].xpath(f"//*[@id='{name}']")
        text = " ".join(box.text_content().split())
        assert text.startswith(name)
        assert plain(it.sentence) in plain(text)
        assert f"Binds: {', '.join(it.binds)}." in text
        links_of = targets(pages, page_of(it.chapter), f"//*[@id='{name}']//a")
        assert {(page_of(it.chapter), name), (coverage, f"coverage-{name}")} <= links_of
    assert {(page_of(it.chapter), name) for name, it in ALL.items()} <= targets(pages, index)


def test_every_requirement_that_is_mentioned_is_a_link(pages: Pages) -> None:
    elsewhere = ("a", "pre", "code", "h1", "h2", "h3", "h4")
    loose = " and ".join(f"not(ancestor::{each})" for each in elsewhere)
    mentioned = 0
    for name, page in pages.items():
        for text in page.xpath(f"//article//text()[{loose}]"):
            assert not set(MENTION.findall(text)) & set(ALL), f"{name}: {text}"
        mentioned += len(page.find_class("mention"))
    assert mentioned > 1000
    whole = pages[page_of(specification.WHOLE["1.1"])]
    assert all(it.startswith("#") for it in whole.xpath("//a[contains(@class, 'mention')]/@href"))


def test_coverage_says_who_judges_each_requirement_or_why_nobody_does(pages: Pages) -> None:
    page = page_of(judged.COVERAGE)
    checks = {name for _, name in targets(pages, page) if name.startswith(("check_", "rule_"))}
    told = set()
    for name in ALL:
        (anchor,) = pages[page].xpath(f"//*[@id='coverage-{name}']")
        row = " ".join(next(anchor.iterancestors("tr")).text_content().split())
        for peer in judged.PEERS:
            if name not in bound(peer):
                continue
            assert (f"{peer} not judged: " in row) == (name in exclusions(peer)), row
            for judge in judges(peer).get(name, []):
                assert f"{peer} {judge.level} {judge.name}" in row
                told.add(judge.name)
    assert checks <= told == judged.check_names()
    assert {(page_of(judged.CHECKS), name) for name in told} <= targets(pages, page)


def test_the_kill_matrix_has_each_program_and_is_led_to_from_coverage(pages: Pages) -> None:
    page = page_of(judged.KILL_MATRIX)
    rows = [" ".join(it.text_content().split()) for it in pages[page].xpath("//tbody/tr")]
    written = re.findall(
        r"^\| (\S+) \| `([\w.-]+)` \|.*\| (\S+) \| [^|]* \|$", MATRIX, re.MULTILINE
    )
    assert len(written) > 400
    for name, program, _ in written:
        assert any(row.startswith(f"{name} {program}") for row in rows), program
    lines = re.findall(r"^\| (?!breaks|program|---)", MATRIX, re.MULTILINE)
    assert len(rows) == len(lines)
    killed = {
        (page, f"kills-{name}") for name, _, fate in written if fate == "killed" and name in ALL
    }
    assert killed <= targets(pages, page_of(judged.COVERAGE))
    counted = judged.killed(MATRIX)
    assert sum(counted.values()) == int(re.findall(r"\*\*(\d+) of", MATRIX)[0])


@pytest.mark.parametrize("version", VERSIONS)
def test_each_schema_has_a_page_and_data_can_be_downloaded(
    version: str, built: Path, pages: Pages
) -> None:
    wanted = {
        f"schemas/{version}/{name}.md": [
            f"schemas/splatbus_schemas/{version}/{name}.schema.json",
            f"schemas/splatbus_schemas/{version}/examples/{name}.json",
        ]
        for name in names(version)
    }
    vectors = (ROOT / "spec" / "vectors").glob("*.json")
    wanted["spec/vectors/README.md"] = [it.relative_to(ROOT).as_posix() for it in vectors]
    for page, paths in wanted.items():
        assert set(paths) <= {path for path, _ in targets(pages, page_of(page))}
        for path in paths:
            assert (built / path).read_bytes() == (ROOT / path).read_bytes()
    for name in names(version):
        blocks = pages[page_of(f"schemas/{version}/{name}.md")].xpath("//pre")
        valid, invalid = examples(name, version)
        shown = [json.loads(block.text_content()) for block in blocks]
        assert shown == [*(each.message for each in (*valid, *invalid)), schema(name, version)]


def test_pictures_are_shown_and_nothing_is_fetched_from_elsewhere(
    built: Path, pages: Pages
) -> None:
    shown = {Path(each).name for page in pages.values() for each in page.xpath("//img/@src")}
    assert {path.name for path in (ROOT / "benchmarks" / "results").rglob("*.png")} <= shown
    for name, page in pages.items():
        for address in (it for query in FETCHED for it in page.xpath(query)):
            assert not re.match(r"([a-z]+:)?//|[a-z]+:", address), f"{name}: {address}"
    for sheet in built.rglob("*.css"):
        fetched = re.findall(r"(?:url\(|@import)\s*[\"']?([^)\"']+)", sheet.read_text("utf-8"))
        assert not [each for each in fetched if re.match(r"(https?:)?//", each)], sheet


@pytest.fixture(scope="module")
def offline() -> Iterator[BrowserContext]:
    with chromium() as browser:
        yield browser.new_context(offline=True, viewport={"width": 400, "height": 800})


def test_every_requirement_is_found_by_its_id_without_a_network(
    built: Path, offline: BrowserContext
) -> None:
    text = (built / "searchindex.js").read_text("utf-8")
    index = json.loads(text.removeprefix("Search.setIndex(").removesuffix(")"))
    for name, each in ALL.items():
        ((number, anchor, _is_main),) = index["indexentries"][name.lower()]
        assert (index["docnames"][number], anchor) == (layout.docname(each.chapter), name)
    page = offline.new_page()
    page.goto(f"{(built / 'search.html').as_uri()}?q=FRM-3")
    page.locator("#search-results li a[href$='#FRM-3']").first.click(timeout=20_000)
    assert page.url == f"{(built / 'spec/1.0/02-framing.html').as_uri()}#FRM-3"
    assert page.locator("#FRM-3").evaluate("box => box.matches(':target')")


def test_long_tables_are_filtered(built: Path, offline: BrowserContext) -> None:
    page = offline.new_page()
    page.goto((built / page_of(judged.COVERAGE)).as_uri())
    rows = page.locator("tbody tr:visible")
    assert rows.count() == len(ALL)
    page.get_by_role("searchbox", name="rows with these words").fill("FRM-3 closes")
    assert rows.count() == 1
    assert page.get_by_role("heading", name="ACC").count() == 0
    assert page.get_by_role("status").inner_text() == f"1 of {len(ALL)} requirements"


def test_pages_fit_a_phone(built: Path, offline: BrowserContext) -> None:
    page = offline.new_page()
    for source in (
        *(layout.FRONT, "spec/1.0/02-framing.md", judged.COVERAGE, judged.KILL_MATRIX),
        *(specification.INDEX, judged.CHECKS, "schemas/1.1/init_packet.md"),
    ):
        page.goto((built / page_of(source)).as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 400, source
