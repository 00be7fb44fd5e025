"""The report page in a browser: it reads, by every means, and neither runs nor loads anything."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import pytest
from axe_playwright_python.sync_playwright import Axe  # type: ignore[import-untyped]
from playwright.sync_api import Browser
from splatbus_conformance.measurements import Measurement
from splatbus_conformance.reports.files.html import html_report
from splatbus_conformance.verdicts import Level, Result, Verdict

from tests.browser import chromium
from tests.conformance.reports.files.test_html import timed
from tests.conformance.reports.stored_reports import EVERY_VERDICT, HOSTILE, failure, report_of

Scheme = Literal["light", "dark"]
SCHEMES, WIDTHS = ("light", "dark"), (1280, 360)
LONG = tuple(
    line
    for t in range(30)
    for line in (f"{t:9.4f} s  msg #1  client → server", f"{'':13}{'ab ' * 36}… (432 bytes)")
)
BROKEN = Result(
    *("FRM-4", "check_any_segmentation", Level.WIRE, Verdict.FAIL, "not opened: " + "x" * 400),
    evidence=LONG,
    measurements=(
        Measurement("position", 2.0, 0.0, "ULP", "(0, 0, 0)", 6, 2),
        Measurement("quaternion of a camera that was turned", 0.5, 8.0, "u", "y" * 300, 5, 0),
        Measurement("angle", 1e-9, None, "rad", "", 4, 0),
    ),
    smallest="one case",
    replay="splatbus-conformance replay splatbus-failures/FRM-4.json --launch " + "/a" * 200,
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as found:
        yield found


class Opened:
    """A page that was opened from a file, and what it did meanwhile."""

    def __init__(
        self, browser: Browser, file: Path, scheme: Scheme = "light", width: int = 1280
    ) -> None:
        self.said: list[str] = []
        self.asked_for: list[str] = []
        context = browser.new_context(
            viewport={"width": width, "height": 800}, color_scheme=scheme, offline=True
        )
        self.page = context.new_page()
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("dialog", lambda dialog: self.said.append(dialog.message))
        self.page.on("request", lambda request: self.asked_for.append(request.url))
        self.page.goto(file.as_uri())

    def ask(self, script: str) -> Any:
        return self.page.evaluate(script)

    def close(self) -> None:
        self.page.context.close()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    report = report_of(
        BROKEN,
        *EVERY_VERDICT,
        complaints=["too little was observed"],
        latencies=timed(0.0004, 0.0005, 0.02),
        notJudged=["msg #1: 3 bytes"],
        testee="python -m " + "viewer." * 60,
    )
    known = report["requirements"]
    report["requirements"] = [it for it in known if it["results"] or it["id"] in ("FRM-5", "POS-1")]
    return written(tmp_path_factory.mktemp("page"), html_report(report, report))


def written(folder: Path, page: str) -> Path:
    file = folder / "report.html"
    file.write_text(page, "utf-8", newline="\n")
    return file


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_it_reads_everywhere_and_asks_for_nothing(
    browser: Browser, file: Path, scheme: Scheme, width: int
) -> None:
    opened = Opened(browser, file, scheme, width)
    opened.ask("document.querySelectorAll('details').forEach(each => each.open = true)")
    found = Axe().run(opened.page).response["violations"]
    assert [(it["id"], it["nodes"][0]["html"]) for it in found] == []
    assert opened.ask("document.documentElement.scrollWidth") <= width
    assert opened.said == []
    assert opened.asked_for == [file.as_uri()]
    opened.close()


def test_its_colours_follow_the_scheme(browser: Browser, file: Path) -> None:
    def colours(scheme: Scheme) -> str:
        opened = Opened(browser, file, scheme)
        found = opened.ask("getComputedStyle(document.body).backgroundColor")
        opened.close()
        return str(found)

    assert colours("light") != colours("dark")


def test_the_keyboard_reaches_what_is_folded_and_focus_is_seen(
    browser: Browser, file: Path
) -> None:
    opened = Opened(browser, file)
    opened.page.keyboard.press("Tab")
    assert opened.ask("document.activeElement.className") == "skip-link"
    assert opened.ask("document.activeElement.getBoundingClientRect().left") >= 0
    for _ in range(60):
        opened.page.keyboard.press("Tab")
        assert opened.ask("getComputedStyle(document.activeElement).outlineStyle") != "none" or (
            opened.ask("document.activeElement.matches('.filter input')")
        )
        if opened.ask("document.activeElement.matches('details:not([open]) > summary')"):
            break
    else:
        pytest.fail("no folded part was reached")
    opened.page.keyboard.press("Enter")
    assert opened.ask("document.activeElement.parentElement.open")
    opened.close()


def test_the_matrix_can_be_filtered_by_verdict(browser: Browser, file: Path) -> None:
    opened = Opened(browser, file)
    shown = "[...document.querySelectorAll('article:first-child .matrix tr[id]')]" + (
        ".filter(each => each.checkVisibility()).map(each => each.className)"
    )
    everything = opened.ask(shown)
    assert {"fail", "pass", "skip", "warn", "expected", "harness-error"} <= set(everything)
    for verdict in ("fail", "warn", "skip"):
        opened.page.check(f"article:first-child input[value={verdict}]", force=True)
        assert opened.ask(shown) == [it for it in everything if it == verdict]
    opened.page.keyboard.press("ArrowRight")
    assert set(opened.ask(shown)) != {"skip"}
    opened.close()


def test_it_prints_what_is_folded(browser: Browser, file: Path) -> None:
    opened = Opened(browser, file)
    opened.page.emulate_media(media="print")
    folded = "[...document.querySelectorAll('details:not([open]) > .transcript')].pop()"
    assert opened.ask(f"{folded}.getBoundingClientRect().height") > 0
    assert not opened.ask("document.querySelector('.filter').checkVisibility()")
    opened.close()


def test_what_a_testee_sends_runs_nothing_and_asks_for_nothing(
    browser: Browser, tmp_path: Path
) -> None:
    attack = "".join(HOSTILE) + (
        "</style></svg><script>console.log(1)</script><img src=x onerror=console.log(2)>"
        "<svg onload=console.log(3)><iframe src='https://localhost/'></iframe>"
        '" autofocus onfocus="console.log(4)" x="<link rel=stylesheet href=//localhost/x>'
    )
    report = report_of(failure(attack), complaints=[attack], testee=attack, summary=attack)
    report["latencies"] = [it | {"what": attack} for it in timed(0.1)]
    opened = Opened(browser, written(tmp_path, html_report(report)))
    opened.page.wait_for_load_state("networkidle")
    assert opened.said == []
    assert len(opened.asked_for) == 1
    assert opened.ask("document.querySelectorAll('script, img, iframe, link').length") == 0
    assert opened.ask("document.querySelector('.testee').textContent").startswith("]]><failure/>")
    opened.close()


def test_a_script_that_was_in_the_page_all_the_same_would_not_run(
    browser: Browser, tmp_path: Path
) -> None:
    page = html_report(report_of()).replace(
        "</main>", "<script>window.ran = 1</script><p style='color: red' id=styled></p></main>"
    )
    opened = Opened(browser, written(tmp_path, page))
    assert opened.ask("window.ran") is None
    assert opened.ask("getComputedStyle(styled).color") != "rgb(255, 0, 0)"
    assert len(opened.said) == 2
    opened.close()
