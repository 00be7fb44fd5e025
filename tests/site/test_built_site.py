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
from splatbus_schemas import VERSIONS, examples, names, requirements, schema

from conformance.site.splatbus_site import judged, layout, links, specification
from tests.browser import chromium
from tests.site.test_plain_markdown import TEXTS

ROOT = Path(__file__).resolve().parents[2]
ALL = requirements(VERSIONS[-1])
MENTION = re.compile(rf"(?<![\w-])(?:{'|'.join({name[:3] for name in ALL})})-\d+(?![\w-])")
FETCHED = ("//script/@src", "//img/@src", "//link[@rel!='canonical']/@href", "//iframe/@src")
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


@pytest.fixture(scope="module")
def ids(pages: Pages) -> dict[str, list[str]]:
    return {name: page.xpath("//@id") for name, page in pages.items()}


def page_of(source: str) -> str:
    return f"{layout.docname(source)}.html"


def hrefs(page: Any) -> Iterator[str]:
    return iter(page.xpath("//a/@href"))


def resolved(page: str, href: str) -> tuple[str, str]:
    """The path in the site and the fragment to which a link on a page leads."""
    path, _, fragment = href.partition("#")
    return (
        links.resolved(page, urllib.parse.unquote(path)),
        urllib.parse.unquote(fragment),
    )


def test_every_markdown_file_is_a_page(pages: Pages) -> None:
    for source in TEXTS:
        if not source.startswith(("tests/", *layout.PARTS)):
            assert page_of(source) in pages


def test_every_link_leads_to_a_file_and_an_anchor(
    built: Path, pages: Pages, ids: Mapping[str, list[str]]
) -> None:
    dangling = []
    for name, page in pages.items():
        for href in set(hrefs(page)):
            if links.is_elsewhere(href):
                continue
            path, fragment = resolved(name, href)
            if not (built / path).is_file() or (fragment and fragment not in ids.get(path, ())):
                dangling.append(f"{name}: {href}")
    assert dangling == []


def test_no_id_stands_twice_on_a_page(ids: Mapping[str, list[str]]) -> None:
    for name, found in ids.items():
        assert len(found) == len(set(found)), name


@pytest.mark.parametrize("name", ALL)
def test_a_requirement_has_an_anchor_in_its_chapter(name: str, pages: Pages) -> None:
    (box,) = pages[page_of(ALL[name].chapter)].xpath(f"//*[@id='{name}']")
    text = " ".join(box.text_content().split())
    plain = " ".join(re.sub(r"[`*\\]", "", ALL[name].sentence).split())
    assert text.startswith(name)
    assert letters(plain) in letters(text)
    assert f"Binds: {', '.join(ALL[name].binds)}." in text
    assert box.xpath(".//a[@class='requirement-id reference internal']/@href") == [f"#{name}"]


@pytest.mark.parametrize("version", VERSIONS)
def test_each_version_is_there_in_one_piece(version: str, ids: Mapping[str, list[str]]) -> None:
    found = ids[page_of(specification.WHOLE[version])]
    assert sorted(each for each in found if each in ALL) == sorted(requirements(version))


def test_the_index_links_to_every_sentence(pages: Pages) -> None:
    index = page_of(specification.INDEX)
    found = {resolved(index, href) for href in hrefs(pages[index])}
    assert {(page_of(each.chapter), name) for name, each in ALL.items()} <= found


def test_every_requirement_that_is_mentioned_is_a_link(pages: Pages) -> None:
    elsewhere = ("a", "pre", "code", "h1", "h2", "h3", "h4")
    plain = " and ".join(f"not(ancestor::{each})" for each in elsewhere)
    mentioned = 0
    for name, page in pages.items():
        for article in page.xpath("//article"):
            for text in article.xpath(f".//text()[{plain}]"):
                assert not set(MENTION.findall(text)) & set(ALL), f"{name}: {text}"
            mentioned += len(article.xpath(".//a[contains(@class, 'mention')]"))
    assert mentioned > 1000


def test_a_mention_in_one_piece_stays_on_the_page(pages: Pages) -> None:
    page = pages[page_of(specification.WHOLE["1.1"])]
    for href in page.xpath("//a[contains(@class, 'mention')]/@href"):
        assert href.startswith("#")


def test_each_requirement_leads_to_what_judges_it(pages: Pages) -> None:
    coverage = page_of(judged.COVERAGE)
    for name, each in ALL.items():
        chapter = page_of(each.chapter)
        (href,) = pages[chapter].xpath(f"//*[@id='{name}']//a[contains(@class,'judged-by')]/@href")
        assert resolved(chapter, href) == (coverage, f"coverage-{name}")


def test_coverage_leads_to_checks_and_kills(pages: Pages) -> None:
    coverage = page_of(judged.COVERAGE)
    found = {resolved(coverage, href) for href in hrefs(pages[coverage])}
    assert {(page_of(judged.CHECKS), name) for name in judged.check_names()} <= found
    kills = judged.killed(TEXTS[judged.KILL_MATRIX])
    killed = {
        (page_of(judged.KILL_MATRIX), f"kills-{name}") for name in kills.keys() & ALL if kills[name]
    }
    assert killed <= found


def test_the_kill_matrix_has_a_row_for_every_program(pages: Pages) -> None:
    rows = pages[page_of(judged.KILL_MATRIX)].xpath("//tbody/tr")
    lines = re.findall(r"^\| (?!breaks|program|---)", TEXTS[judged.KILL_MATRIX], re.MULTILINE)
    assert len(rows) == len(lines) > 500


@pytest.mark.parametrize("version", VERSIONS)
def test_each_schema_has_a_page_and_can_be_downloaded(
    version: str, built: Path, pages: Pages
) -> None:
    for name in names(version):
        page = page_of(f"schemas/{version}/{name}.md")
        found = {resolved(page, href)[0] for href in hrefs(pages[page])}
        for place in (f"{name}.schema.json", f"examples/{name}.json"):
            path = f"schemas/splatbus_schemas/{version}/{place}"
            assert path in found
            assert (built / path).read_bytes() == (ROOT / path).read_bytes()
        shown = [json.loads(block.text_content()) for block in pages[page].xpath("//pre")]
        valid, invalid = examples(name, version)
        assert shown == [*(each.message for each in (*valid, *invalid)), schema(name, version)]


def test_the_vectors_can_be_downloaded(built: Path, pages: Pages) -> None:
    page = "spec/vectors/index.html"
    found = {resolved(page, href)[0] for href in hrefs(pages[page])}
    for path in (ROOT / "spec" / "vectors").glob("*.json"):
        name = path.relative_to(ROOT).as_posix()
        assert name in found
        assert (built / name).read_bytes() == path.read_bytes()


def test_pictures_of_results_are_shown(pages: Pages) -> None:
    shown = {Path(each).name for page in pages.values() for each in page.xpath("//img/@src")}
    assert {path.name for path in (ROOT / "benchmarks" / "results").rglob("*.png")} <= shown


def test_nothing_is_fetched_from_elsewhere(built: Path, pages: Pages) -> None:
    for name, page in pages.items():
        for query in FETCHED:
            for address in page.xpath(query):
                assert not links.is_elsewhere(address), f"{name}: {address}"
                assert not address.startswith("//"), f"{name}: {address}"
    for sheet in built.rglob("*.css"):
        fetched = re.findall(r"(?:url\(|@import)\s*[\"']?([^)\"']+)", sheet.read_text("utf-8"))
        assert not [each for each in fetched if re.match(r"(https?:)?//", each)], sheet


def test_a_requirement_is_found_by_its_id(built: Path) -> None:
    text = (built / "searchindex.js").read_text("utf-8")
    index = json.loads(text.removeprefix("Search.setIndex(").removesuffix(")"))
    for name, each in ALL.items():
        ((page, anchor, _is_main),) = index["indexentries"][name.lower()]
        assert index["docnames"][page] == layout.docname(each.chapter)
        assert anchor == name


@pytest.fixture(scope="module")
def offline() -> Iterator[BrowserContext]:
    with chromium() as browser:
        yield browser.new_context(offline=True, viewport={"width": 400, "height": 800})


def test_search_works_without_a_network(built: Path, offline: BrowserContext) -> None:
    page = offline.new_page()
    page.goto(f"{(built / 'search.html').as_uri()}?q=FRM-3")
    found = page.locator("#search-results li a[href$='#FRM-3']")
    found.first.wait_for(timeout=20_000)
    found.first.click()
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


@pytest.mark.parametrize(
    "source",
    ["conformance/site/index.md", "spec/1.0/02-framing.md", judged.COVERAGE, judged.KILL_MATRIX,
     specification.INDEX, judged.CHECKS, "schemas/1.1/init_packet.md"],
)  # fmt: skip
def test_a_page_fits_a_phone(source: str, built: Path, offline: BrowserContext) -> None:
    page = offline.new_page()
    page.goto((built / page_of(source)).as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= 400


def letters(text: str) -> str:
    """The text without what typography changes: quotation marks and spaces."""
    return re.sub(r"[^\w]", "", text)
