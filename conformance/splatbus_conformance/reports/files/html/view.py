"""What the page shows of a report: grouped, in order, and no more than people can read."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from splatbus_schemas.requirements import requirements

from splatbus_conformance.checks.registry import exclusions, judges
from splatbus_conformance.reports.files.html import plots
from splatbus_conformance.reports.files.html.clauses import CLAUSES
from splatbus_conformance.reports.files.html.limits import Limits, Truncated, first
from splatbus_conformance.reports.files.html.text import SentencePart, cut, ids, spans
from splatbus_conformance.reports.triage import in_order
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_INTERRUPTED,
    EXIT_NO_VERDICT,
    Level,
    Result,
    Verdict,
)

Json = Mapping[str, Any]
ORDER = (
    *(Verdict.FAIL, Verdict.ERROR, Verdict.WARN, Verdict.EXPECTED, Verdict.PASS, Verdict.SKIP),
)
ENVIRONMENT = {
    "harness": "splatbus-protocol",
    "python": "Python",
    "platform": "platform",
    "machine": "machine",
    "host": "host",
    "device": "device memory",
}


@dataclass(frozen=True)
class RequirementText:
    """A requirement, as the specification has it."""

    id: str
    level: str
    sentence: tuple[SentencePart, ...]
    acceptable: tuple[str, ...]
    why: tuple[SentencePart, ...]
    chapter: str


@dataclass(frozen=True)
class ShownResult:
    """One result."""

    about: RequirementText
    check: str
    assurance: str
    verdict: str
    text: str
    seconds: float
    evidence: Sequence[str]
    """Lines of transcript, all of them: few results show theirs."""
    smallest: str
    replay: str
    code: str


@dataclass(frozen=True)
class RequirementRow:
    """One requirement of the matrix."""

    about: RequirementText
    verdict: str
    results: Truncated[ShownResult]
    unseen: tuple[str, ...]
    """Why nothing is said of it."""

    @property
    def assurances(self) -> list[str]:
        """At which something was said."""
        return sorted({it.assurance for it in self.results.these if it.verdict != Verdict.SKIP})


@dataclass(frozen=True)
class Clause:
    """The requirements whose ids begin alike."""

    letters: str
    about: str
    rows: tuple[RequirementRow, ...]

    @property
    def observed(self) -> int:
        """How many have a verdict."""
        return sum(row.verdict not in (Verdict.SKIP, Verdict.ERROR) for row in self.rows)


@dataclass(frozen=True)
class Timed:
    """How long one kind of answer took, in seconds."""

    what: str
    count: int
    p50: float
    p99: float
    slowest: float
    bars: str
    """A path."""


@dataclass(frozen=True)
class Measured:
    """One quantity, and how far off it was."""

    about: RequirementText
    quantity: str
    unit: str
    worst: float | None
    budget: float | None
    input: str
    cases: int
    beyond: int
    x: float
    """Where its error stands in a row, by its budget."""


@dataclass(frozen=True)
class PageView:
    """Everything that the page shows of one report."""

    limits: Limits
    number: int
    prefix: str
    """Of the ids on the page, so that those of two reports differ."""
    report: Json
    testee: str
    summary: tuple[SentencePart, ...]
    verdict: str
    """Of the whole run, as one of those on requirements."""
    opinion: str
    counts: tuple[tuple[str, int], ...]
    """Of requirements, by verdict."""
    hints: Truncated[str]
    """What may be at the root of it."""
    broken: Truncated[ShownResult]
    advice: Truncated[ShownResult]
    expected: Truncated[ShownResult]
    complaints: Truncated[str]
    clauses: tuple[Clause, ...]
    rows_left_out: int
    unseen: Truncated[tuple[str, tuple[str, ...]]]
    """Reasons, and the requirements that each kept from being seen."""
    not_judged: Truncated[str]
    axis: plots.Decades
    latencies: Truncated[Timed]
    measured: Truncated[Measured]
    facts: tuple[tuple[str, str], ...]
    """Where, when and how it was judged: names and values."""


def view_of(report: Json, number: int, limits: Limits) -> PageView:
    """A report as the page shows it, and which of those on the page it is: 1 for the first."""
    listed: Sequence[Json] = report["requirements"]
    rows = [_row(each, report["side"], limits) for each in listed[: limits.items]]
    others = [
        _told(_about_other(it["requirement"], limits), it, limits)
        for it in report["others"][: limits.items]
    ]
    told = [*(it for row in rows for it in row.results.these), *others]
    ordered = _in_order(told)
    verdicts = [each["verdict"] for each in listed]
    verdict, opinion = _opinion(report["exitCode"], {it.verdict for it in told})
    timed = first(report["latencies"], limits.few)
    axis = plots.decades_around(
        edge for it in timed.these for bin in it["bins"] for edge in bin[:2]
    )
    return PageView(
        limits=limits,
        number=number,
        prefix=f"{number}-" if number > 1 else "",
        report=report,
        testee=cut(report["testee"], limits.sentence),
        summary=ids(_sentence(cut(report["summary"], limits.sentence))),
        verdict=verdict,
        opinion=opinion,
        counts=tuple((it, verdicts.count(it)) for it in ORDER if it in verdicts),
        hints=_texts(report["advice"], limits),
        broken=first([it for it in ordered if it.verdict != Verdict.WARN], limits.items),
        advice=first([it for it in ordered if it.verdict == Verdict.WARN], limits.items),
        expected=first([it for it in told if it.verdict == Verdict.EXPECTED], limits.items),
        complaints=_texts(report["complaints"], limits),
        clauses=tuple(
            Clause(letters, CLAUSES.get(letters, ""), tuple(group))
            for letters, group in groupby(rows, lambda row: row.about.id.partition("-")[0])
        ),
        rows_left_out=len(listed) - len(rows),
        unseen=_unseen(rows, limits),
        not_judged=_texts(report["notJudged"], limits),
        axis=axis,
        latencies=Truncated([_timed(it, axis, limits) for it in timed.these], timed.more),
        measured=first(_measured(listed, limits), limits.items),
        facts=tuple(_facts(report, limits)),
    )


def _in_order(told: Sequence[ShownResult]) -> list[ShownResult]:
    """What was broken, in the order in which to look at it."""
    results = [
        Result(it.about.id, it.check, Level(it.assurance), Verdict(it.verdict), code=it.code)
        for it in told
    ]
    by_result = {id(result): it for result, it in zip(results, told, strict=True)}
    return [by_result[id(result)] for result in in_order(results)]


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _opinion(exit_code: int, verdicts: set[str]) -> tuple[str, str]:
    """The verdict on the whole, as a shape and in words."""
    if exit_code in (EXIT_NO_VERDICT, EXIT_INTERRUPTED):
        return Verdict.ERROR, "No verdict"
    if exit_code != EXIT_CONFORMING:
        return Verdict.FAIL, "Not conforming"
    if Verdict.EXPECTED in verdicts:
        return Verdict.EXPECTED, "Not conforming, as expected"
    return Verdict.PASS, "Conforming"


def _row(entry: Json, side: str, limits: Limits) -> RequirementRow:
    about = _about(entry, limits)
    found = first(entry["results"], limits.few)
    results = Truncated([_told(about, it, limits) for it in found.these], found.more)
    return RequirementRow(
        about, Verdict(entry["verdict"]), results, tuple(_why_unseen(entry, side, limits))
    )


def _about(entry: Json, limits: Limits) -> RequirementText:
    id = cut(entry["id"], limits.sentence)
    known = requirements("1.1").get(id)
    return RequirementText(
        id,
        cut(entry["level"], limits.sentence),
        spans(cut(entry["sentence"], limits.sentence)),
        tuple(cut(it, limits.sentence) for it in entry["acceptable"][: limits.few]),
        spans(known.why or "") if known else (),
        known.chapter if known else "",
    )


def _about_other(id: str, limits: Limits) -> RequirementText:
    """A requirement by which the testee could not be judged, or none: the run itself."""
    return RequirementText(cut(id, limits.sentence), "", (), (), (), "")


def _told(about: RequirementText, result: Json, limits: Limits) -> ShownResult:
    return ShownResult(
        about,
        cut(result["check"], limits.sentence),
        result["assurance"],
        result["verdict"],
        cut(result["text"], limits.sentence),
        result["seconds"],
        result["evidence"],
        cut(result["smallest"], limits.sentence),
        cut(result["replay"], limits.sentence),
        cut(result["code"], limits.sentence),
    )


def _why_unseen(entry: Json, side: str, limits: Limits) -> Iterator[str]:
    """Why nothing is said of a requirement, where nothing is."""
    if entry["verdict"] != Verdict.SKIP:
        return
    reasons = [it["text"] for it in entry["results"][: limits.few]]
    if entry["deselected"]:
        reasons.append("left out by --select or --deselect")
    elif not reasons and (excluded := exclusions(side).get(entry["id"])):
        reasons.append(f"no check judges it: {excluded.reason}")
    elif not reasons and any(
        judge.level != Level.PASSIVE for judge in judges(side).get(entry["id"], ())
    ):
        reasons.append("its checks did not run")
    elif not reasons:
        reasons.append("what it is about did not happen")
    yield from dict.fromkeys(cut(reason, limits.sentence) for reason in reasons)


def _unseen(
    rows: Sequence[RequirementRow], limits: Limits
) -> Truncated[tuple[str, tuple[str, ...]]]:
    """Reasons of skips, those that kept most from being seen first."""
    found: dict[str, list[str]] = {}
    for row in rows:
        for reason in row.unseen:
            found.setdefault(reason, []).append(row.about.id)
    by_weight = sorted(found.items(), key=lambda it: -len(it[1]))
    return first([(reason, tuple(ids)) for reason, ids in by_weight], limits.few)


def _timed(entry: Json, axis: plots.Decades, limits: Limits) -> Timed:
    return Timed(
        cut(entry["what"], limits.sentence),
        entry["count"],
        entry["p50"],
        entry["p99"],
        entry["max"],
        plots.bars(entry["bins"][: limits.items], axis),
    )


def _measured(listed: Sequence[Json], limits: Limits) -> list[Measured]:
    """What has a budget, the worst first; then what has none."""
    found = [
        _measurement(about, it, limits)
        for entry in listed
        for about in [_about(entry, limits)]
        for result in entry["results"][: limits.few]
        for it in result["measurements"][: limits.few]
    ]
    return sorted(found, key=lambda it: (it.budget is None, not it.beyond, -it.x))


def _measurement(about: RequirementText, entry: Json, limits: Limits) -> Measured:
    worst, budget = entry["worst"], entry["budget"]
    return Measured(
        about,
        cut(entry["quantity"], limits.sentence),
        cut(entry["unit"], limits.sentence),
        worst,
        budget,
        cut(entry["input"], limits.sentence),
        entry["cases"],
        entry["beyond"],
        0.0 if budget is None else plots.of_budget(worst, budget),
    )


def _facts(report: Json, limits: Limits) -> Iterator[tuple[str, str]]:
    """Where, when and how it was judged."""
    waiting, busy = report["waitingSeconds"], report["harnessSeconds"]
    found = {
        "made": report["made"].replace("T", " ").replace("+00:00", " UTC"),
        "judged as": f"{report['side']} of SplatBus {report['version']}",
        "observed": f"{report['observed']} of {len(report['requirements'])} requirements",
        "profile": report["profile"],
        "seeds": ", ".join(map(str, report["seeds"][: limits.items])),
        "cases": f"{report['casesDelivered']:,} in {plots.duration(report['seconds'])}"
        f"; {plots.duration(busy)} of CPU time of the harness, "
        f"{plots.duration(waiting)} of waiting for the testee",
        "exit status": report["exitCode"],
    }
    named = {ENVIRONMENT.get(name, name): value for name, value in report["environment"].items()}
    for name, value in list((found | named).items())[: limits.items]:
        if value not in ("", None):
            yield cut(name, limits.sentence), cut(str(value), limits.sentence)


def _texts(texts: Sequence[str], limits: Limits) -> Truncated[str]:
    found = first(texts, limits.few)
    return Truncated([cut(text, limits.sentence) for text in found.these], found.more)
