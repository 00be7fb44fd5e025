"""The report page in a browser: it reads, by every means, and neither runs nor loads anything."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import pytest
from axe_playwright_python.sync_playwright import Axe  # type: ignore[import-untyped]
from playwright.sync_api import Browser, Page
from splatbus_conformance.reports.files.html.page import html_report
from splatbus_conformance.verdicts import Level, Result, Verdict

from tests.browser import chromium
from tests.conformance.reports.stored_reports import (
    HOSTILE,
    brief,
    full_report,
    of_a_testee,
    report_of,
)

LONG = Result(
    *("FRM-4", "check_any_segmentation", Level.WIRE, Verdict.FAIL, "not opened: " + "x" * 400),
    evidence=("   0.1000 s  msg #1  client → server", f"{'':13}{'ab ' * 36}… (432 bytes)") * 9,
    replay="splatbus-conformance replay splatbus-failures/FRM-4.json --launch " + "/a" * 200,
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as found:
        yield found


Open = Callable[..., tuple[Page, list[str]]]


@pytest.fixture
def opened(browser: Browser, tmp_path: Path) -> Iterator[Open]:
    """Opens a page from a file; what it said and asked for meanwhile, beside that file."""
    contexts = []

    def opens(page: str, scheme: Literal["light", "dark"] = "light", width: int = 1280) -> Any:
        file = tmp_path / "report.html"
        file.write_text(page, "utf-8", newline="\n")
        size = {"width": width, "height": 800}
        context = browser.new_context(viewport=size, color_scheme=scheme, offline=True)  # type: ignore[arg-type]
        contexts.append(context)
        shown, said = context.new_page(), list[str]()
        shown.on("console", lambda message: said.append(message.text))
        shown.on("pageerror", lambda error: said.append(str(error)))
        shown.on("dialog", lambda dialog: said.append(dialog.message))
        shown.on("request", lambda request: said.append(request.url))
        shown.goto(file.as_uri())
        assert said.pop(0) == file.as_uri()
        return shown, said

    yield opens
    for context in contexts:
        context.close()


@pytest.fixture(scope="module")
def page() -> str:
    report = full_report() | {"testee": "python -m " + "viewer." * 60}
    report["requirements"][3] = report_of(LONG)["requirements"][3]
    return html_report(brief(report), brief(report))


@pytest.mark.parametrize(("scheme", "width"), [("light", 360), ("dark", 1280)])
def test_it_reads_everywhere_and_asks_for_nothing(
    opened: Open, page: str, scheme: str, width: int
) -> None:
    shown, said = opened(page, scheme, width)
    shown.evaluate("document.querySelectorAll('details').forEach(each => each.open = true)")
    found = Axe().run(shown).response["violations"]
    assert [(it["id"], it["nodes"][0]["html"]) for it in found] == []
    assert shown.evaluate("document.documentElement.scrollWidth") <= width
    background = shown.evaluate("getComputedStyle(document.body).backgroundColor")
    dark = sum(map(int, background.removeprefix("rgb(").removesuffix(")").split(","))) < 384
    assert dark == (scheme == "dark")
    assert said == []


def test_the_keyboard_reaches_what_is_folded_and_focus_is_seen(opened: Open, page: str) -> None:
    shown, _ = opened(page)
    shown.keyboard.press("Tab")
    assert shown.evaluate("document.activeElement.className") == "skip-link"
    assert shown.evaluate("document.activeElement.getBoundingClientRect().left") >= 0
    for _ in range(60):
        shown.keyboard.press("Tab")
        assert shown.evaluate(
            "getComputedStyle(document.activeElement).outlineStyle != 'none'"
            " || document.activeElement.matches('.filter input')"
        )
        if shown.evaluate("document.activeElement.matches('details:not([open]) > summary')"):
            break
    shown.keyboard.press("Enter")
    assert shown.evaluate("document.activeElement.parentElement.open")


def test_the_matrix_can_be_filtered_by_verdict(opened: Open, page: str) -> None:
    shown, _ = opened(page)
    rows = (
        "[...document.querySelectorAll('article:first-child .matrix tr[id]')]"
        ".filter(each => each.checkVisibility()).map(each => each.className)"
    )
    everything = shown.evaluate(rows)
    assert {"fail", "pass", "skip", "warn", "expected", "harness-error"} <= set(everything)
    for verdict in ("fail", "warn", "skip"):
        shown.check(f"article:first-child input[value={verdict}]", force=True)
        assert shown.evaluate(rows) == [it for it in everything if it == verdict]


def test_it_prints_what_is_folded(opened: Open, page: str) -> None:
    shown, _ = opened(page)
    shown.emulate_media(media="print")
    folded = "[...document.querySelectorAll('details:not([open]) > .transcript')].pop()"
    assert shown.evaluate(f"{folded}.getBoundingClientRect().height") > 0
    assert not shown.evaluate("document.querySelector('.filter').checkVisibility()")


def test_what_a_testee_sends_runs_nothing_and_asks_for_nothing(opened: Open) -> None:
    attack = "".join(HOSTILE) + (
        "</style></svg><script>console.log(1)</script><img src=x onerror=console.log(2)>"
        "<svg onload=console.log(3)><iframe src='https://localhost/'></iframe>"
        '" autofocus onfocus="console.log(4)" x="<link rel=stylesheet href=//localhost/x>'
    )
    shown, said = opened(html_report(of_a_testee(attack)))
    shown.wait_for_load_state("networkidle")
    assert said == []
    others = "script, iframe, link, img:not([src^='data:image/png;base64,'])"
    assert shown.locator(others).count() == 0
    assert shown.locator(".testee").inner_text().startswith("]]><failure/>")


def test_a_script_that_was_in_the_page_all_the_same_would_not_run(opened: Open, page: str) -> None:
    planted = "<script>window.ran = 1</script><p style='color: red' id=styled></p></main>"
    shown, said = opened(page.replace("</main>", planted))
    assert shown.evaluate("window.ran") is None
    assert shown.evaluate("getComputedStyle(styled).color") != "rgb(255, 0, 0)"
    assert len(said) == 2
