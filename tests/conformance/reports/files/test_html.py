"""The report page: says what the report says, holds what testees send, and stays small."""

import base64
import hashlib
import json
import re
from collections import Counter
from html.parser import HTMLParser
from itertools import count, pairwise
from typing import Any

import jsonschema
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from splatbus_conformance.data import read_json
from splatbus_conformance.measurements import Measurement
from splatbus_conformance.reports import latencies
from splatbus_conformance.reports.files.html import html_report
from splatbus_conformance.reports.files.html.clauses import CLAUSES
from splatbus_conformance.reports.files.html.text import seen
from splatbus_conformance.reports.latencies import Histogram
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.requirements import requirements

from tests.conformance.reports.stored_reports import EVERY_VERDICT, HOSTILE, failure, report_of

MOST_BYTES = 2_000_000
ALIKE = {
    *("format", "made", "side", "version", "level", "assurance", "verdict", "profile"),
    *("id", "requirement", "check", "deselected"),
}
"""Members that take no text of a testee."""
VOID = {"meta", "use", "path", "circle", "rect", "line", "input"}
DANGEROUS = "<>&\"'"
HARMLESS = str.maketrans(dict.fromkeys(DANGEROUS, "x"))
PIECES = st.sampled_from(
    [
        *("<script>alert(1)</script>", "</style><script>", "</title>", "<img src=x onerror=y>"),
        *(
            '" onload="x',
            "' style='x",
            "-->",
            "<!--",
            "]]>",
            "&lt;",
            "&#60;",
            "`<b>`",
            "{{ 7 * 7 }}",
        ),
        *(
            "{% raw %}",
            "\u202e\u2066",
            "\x00",
            "\ud800",
            "\x1b[31m",
            "\u2028",
            "FRM-3",
            "javascript:",
        ),
    ]
)
TEXTS = st.lists(PIECES | st.characters(), max_size=6).map("".join)


class Read(HTMLParser):
    """A page as a list of elements, and its text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.open: list[str] = []
        self.text: list[str] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def handle_comment(self, data: str) -> None:
        raise AssertionError(data)

    @property
    def structure(self) -> list[tuple[str, tuple[str, ...], str]]:
        return [(tag, tuple(it), it.get("class", "")) for tag, it in self.elements]

    def all(self, *tags: str) -> list[tuple[str, dict[str, str]]]:
        return [it for it in self.elements if it[0] in tags]


def timed(*seconds: float) -> list[dict[str, Any]]:
    histogram = Histogram()
    for each in seconds:
        histogram.take(each)
    return latencies.as_json({"ping → pong": histogram, "frame → release": histogram})


def full_report() -> dict[str, Any]:
    """A report in which everything occurs that can."""
    return report_of(
        *EVERY_VERDICT,
        complaints=["too little was observed"],
        latencies=timed(0.0004, 0.0005, 0.02),
        notJudged=["msg #1: 3 bytes"],
        advice=["Start with FRM-3: it is the root."],
    )


def with_texts(value: Any, text: Any, name: str = "") -> Any:
    """A report with each text in it replaced."""
    if name in ALIKE:
        return value
    if isinstance(value, dict):
        return {key: with_texts(each, text, key) for key, each in value.items()}
    if isinstance(value, list):
        return [with_texts(each, text) for each in value]
    return text(value) if isinstance(value, str) else value


def test_the_page_says_what_the_report_says() -> None:
    report = full_report()
    page = html_report(report)
    read = Read(page)
    text = " ".join("".join(read.text).split())
    assert "Not conforming: FRM-3 broken" in text
    known = requirements("1.1")["FRM-3"]
    for said in (
        *(known.sentence, known.why, known.chapter, "closes", "seen", "line <&>", "one case"),
        *("splatbus-conformance replay a.json --launch cmd", "no hello", "too little was observed"),
        *("left out by --select or --deselect", "msg #1: 3 bytes", "Start with FRM-3"),
        *("no such file", "KeyError: 1", "seen (expected: issue 17)"),
    ):
        assert (said or "").replace("`", "") in text
    ids = [it["id"] for _, it in read.elements if "id" in it]
    assert set(requirements("1.1")) <= set(ids)
    assert page.index('id="broken"') < page.index('id="advice"') < page.index('id="requirements"')


def test_verdicts_are_told_in_words_and_failures_come_in_the_order_to_mend_them() -> None:
    later = Result("POS-1", "check_b", Level.WIRE, Verdict.FAIL, "later")
    read = Read(html_report(report_of(later, *EVERY_VERDICT)))
    cards = [it["id"] for tag, it in read.elements if it.get("class", "").startswith("card")]
    assert cards == ["broken-1", "broken-2", "broken-3", "broken-4", "advice-1", "expected-1"]
    text = "".join(read.text)
    assert text.index("seen") < text.index("later")
    rows = {it["id"]: it["class"] for tag, it in read.elements if tag == "tr" and "id" in it}
    assert (rows["FRM-3"], rows["FRM-1"], rows["JSN-1"]) == ("fail", "pass", "skip")
    badges = Counter(
        re.findall(r'href="#shape-[a-z-]+"/></svg>([a-z-]+)</span>', html_report(report_of()))
    )
    assert badges == {"skip": len(requirements("1.1"))}


def test_what_was_not_observed_says_why() -> None:
    text = "".join(Read(html_report(report_of(*EVERY_VERDICT))).text)
    reasons = " ".join(text[text.index("Not observed, and why") :].split())
    for reason, id in (
        ("no hello", "JSN-1"),
        ("left out by --select or --deselect", "POS-1"),
        ("no check judges it: a socket option of the other side cannot be read", "FRM-8"),
        ("its checks did not run", "FRM-4"),
        ("what it is about did not happen", "FRM-2"),
    ):
        after = reasons[reasons.index(reason) :]
        assert id in after[:200]


def test_ids_are_unique_links_lead_somewhere_and_headings_skip_no_level() -> None:
    read = Read(html_report(full_report(), full_report()))
    ids = [it["id"] for _, it in read.elements if "id" in it]
    assert [name for name, count in Counter(ids).items() if count > 1] == []
    targets = [it["href"] for _, it in read.elements if "href" in it]
    targets += [
        f"#{name}" for _, it in read.elements for name in it.get("aria-labelledby", "").split()
    ]
    assert {target for target in targets if target.removeprefix("#") not in ids} == set()
    levels = [int(tag[1]) for tag, _ in read.all("h1", "h2", "h3", "h4")]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    assert all("scope" in it for _, it in read.all("th"))
    assert not read.open


def test_the_page_loads_and_runs_nothing() -> None:
    page = html_report(full_report())
    read = Read(page)
    policy = next(it["content"] for _, it in read.all("meta") if "http-equiv" in it)
    style = page[page.index("<style>") + len("<style>") : page.index("</style>")]
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    assert policy.split("; ")[:2] == ["default-src 'none'", f"style-src 'sha256-{digest}'"]
    assert "url(" not in style
    assert "@import" not in style
    assert not read.all("script", "link", "img", "iframe", "object", "form", "base")
    attributes = {name for _, it in read.elements for name in it}
    assert not {name for name in attributes if name.startswith("on") or name in ("style", "src")}
    assert all(it["href"].startswith("#") for _, it in read.elements if "href" in it)


def harmless(text: str) -> str:
    """With letters for what could be markup; the ">" before a line says that it is pointed out."""
    pointed_out = ">" * text.startswith(">")
    return pointed_out + text[len(pointed_out) :].translate(HARMLESS)


@settings(deadline=None, max_examples=60)
@given(st.lists(TEXTS, min_size=1, max_size=8))
@example([">"])
def test_nothing_that_a_testee_sends_changes_the_page(texts: list[str]) -> None:
    """The elements are those of a page whose texts hold letters for what could be markup."""
    report = full_report()
    report["requirements"] = [it for it in report["requirements"] if it["results"]]
    drawn = count()
    hostile = with_texts(report, lambda _: texts[next(drawn) % len(texts)] + "!")
    tame = with_texts(hostile, harmless)
    read = Read(html_report(hostile))
    assert read.structure == Read(html_report(tame)).structure
    assert not read.open
    said = "".join(read.text)
    assert seen(hostile["testee"]) in said
    assert seen(hostile["complaints"][0]) in said


@pytest.mark.parametrize("text", HOSTILE)
def test_a_known_attack_stays_text(text: str) -> None:
    page = html_report(
        report_of(failure(text), complaints=[text], testee=text, summary=text or "-")
    )
    assert (
        Read(page).structure
        == Read(
            html_report(
                report_of(
                    failure(text.translate(HARMLESS)),
                    complaints=[text.translate(HARMLESS)],
                    testee=text,
                    summary=text or "-",
                )
            )
        ).structure
    )
    page.encode("utf-8")


def test_characters_that_steer_a_reader_are_told_by_number() -> None:
    page = html_report(report_of(failure("a\u202eb\x00c\x1bd\ud800e\u2028f")))
    assert r"a\u202eb\x00c\x1bd\ud800e\u2028f" in page
    assert all(c.isprintable() or c in "\n\t" for c in page)


@pytest.mark.parametrize("character", ["<", "\ud800", "\n"])
def test_however_long_the_report_the_page_stays_small_and_says_what_is_left_out(
    character: str,
) -> None:
    megabytes = character * 100_000
    broken = [
        Result(
            *("FRM-3", f"check_{number}", Level.WIRE, Verdict.FAIL, megabytes),
            evidence=(megabytes, *(character * 80 for _ in range(3000)), megabytes),
            measurements=(Measurement(megabytes, 2.0, 1.0, megabytes, megabytes, 3, 1),),
            smallest=megabytes,
            replay=megabytes,
        )
        for number in range(3)
    ] * 200
    report = report_of(
        *broken,
        complaints=[megabytes] * 5000,
        testee=megabytes,
        summary=megabytes,
        notJudged=[megabytes] * 5000,
        latencies=[it | {"what": megabytes} for it in timed(0.1, 0.2)] * 3000,
        seeds=list(range(100_000)),
    )
    page = html_report(report, report)
    assert len(page.encode("utf-8")) < MOST_BYTES
    text = "".join(Read(page).text)
    assert "characters left out" in text
    assert "all of it is in the JSON report" in text
    assert "more failures are not shown here" in text or "more results are not shown here" in text
    assert "more demands are not shown here" in text


def test_any_number_of_reports_stays_small() -> None:
    page = html_report(*[full_report()] * 50)
    assert len(page.encode("utf-8")) < MOST_BYTES
    assert "more reports are not shown here" in page


def test_a_usual_report_is_shown_whole() -> None:
    evidence = tuple(f"{t:9.4f} s  msg #1  client → server" for t in range(50))
    broken = [
        Result(name, "check_a", Level.WIRE, Verdict.FAIL, "broken", evidence)
        for name in list(requirements("1.1"))[:60]
    ]
    page = html_report(report_of(*broken))
    assert page.count('<div class="event">') == 60 * 50
    assert "left out" not in page.replace("left out by --select", "")


def test_latencies_are_drawn_and_told() -> None:
    read = Read(html_report(full_report()))
    text = "".join(read.text)
    assert "3 answers: half within 473 µs, 99% within 20 ms, the slowest 20 ms." in text
    [bars, _] = [it["d"] for tag, it in read.elements if it.get("class") == "bars"]
    assert bars.count("M") == 3
    assert "Latencies" not in "".join(Read(html_report(report_of(latencies=[]))).text)


def test_errors_stand_against_their_budgets_the_worst_first() -> None:
    measured = [
        Measurement("angle", 1e-9, None, "rad", "a", 4, 0),
        Measurement("colour", 0.5, 3.0, "ULP", "b", 5, 0),
        Measurement("position", 2.0, 0.0, "ULP", "c", 6, 2),
        Measurement("depth", float("inf"), 1.0, "ULP", "d", 7, 1),
        Measurement("quaternion", 0.0, 8.0, "u", "e", 8, 0),
    ]
    result = Result(
        "ACC-1", "check_a", Level.ADAPTER, Verdict.FAIL, "x", measurements=tuple(measured)
    )
    text = " ".join("".join(Read(html_report(report_of(result))).text).split())
    table = text[text.index("Worst errors") :]
    places = [
        table.index(said)
        for said in (
            "beyond: it had to be exact",
            "not finite",
            "16.7% of the budget",
            "exact 8",
            "no clause limits it",
        )
    ]
    assert places == sorted(places)
    assert "6, 2 beyond" in table


def test_every_clause_has_a_name() -> None:
    assert set(CLAUSES) == {name.partition("-")[0] for name in requirements("1.1")}


def test_the_page_is_the_same_after_the_report_was_stored() -> None:
    report = full_report()
    jsonschema.Draft202012Validator(read_json("report.schema.json")).validate(report)
    assert html_report(json.loads(json.dumps(report))) == html_report(report)
