"""What the page shows of a report beside what stands in it: grouped, in order, and reckoned."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.files.html import plots
from splatbus_conformance.reports.files.results import broken, results, unseen
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_INTERRUPTED,
    EXIT_NO_VERDICT,
    Verdict,
)

ORDER = (
    *(Verdict.FAIL, Verdict.ERROR, Verdict.WARN, Verdict.EXPECTED, Verdict.PASS, Verdict.SKIP),
)
ENVIRONMENT = {"harness": "splatbus-protocol", "python": "Python", "device": "device memory"}
"""What of it has another name for people."""


class Limits(NamedTuple):
    """How much of a report is shown, so that the page opens at once however long the run was."""

    items: int = 400
    """Of a long list: requirements, failures, measured quantities."""
    few: int = 40
    """Of a list that is short as a rule: the results of one requirement, complaints, reasons."""
    characters: int = 8_000
    """Of a transcript."""
    pictures: int = 12
    """Failures that are shown with theirs."""

    @property
    def sentence(self) -> int:
        """Characters of what is meant to be a sentence or a command."""
        return max(self.characters // 4, 4)

    def half(self) -> "Limits":
        """For a page that was too large."""
        texts = max(self.items // 2, 1), max(self.few // 2, 1), max(self.characters // 2, 16)
        return Limits(*texts, self.pictures // 2)


def view_of(report: Report, number: int, limits: Limits) -> dict[str, Any]:
    """A report for the page, and which of those on it that is: 1 for the first.

    Long texts and lists stay whole here, but for requirements and their results; the template cuts
    what it prints.
    """
    listed: Sequence[Report] = report["requirements"][: limits.items]
    briefly = [{**entry, "results": entry["results"][: limits.few]} for entry in listed]
    told = list(results({"requirements": briefly, "others": report["others"][: limits.items]}))
    ordered = broken(told)
    verdicts = [entry["verdict"] for entry in report["requirements"]]
    verdict, opinion = _opinion(report["exitCode"], {it["verdict"] for it in told})
    return {
        "report": report,
        "number": number,
        "prefix": f"{number}-" if number > 1 else "",  # of ids, so that those of two reports differ
        "verdict": verdict,
        "opinion": opinion,
        "counts": [(it, verdicts.count(it)) for it in ORDER if it in verdicts],
        "broken": [it for it in ordered if it["verdict"] != Verdict.WARN],
        "advice": [it for it in ordered if it["verdict"] == Verdict.WARN],
        "expected": [it for it in told if it["verdict"] == Verdict.EXPECTED],
        "clauses": [
            (letters, list(rows))
            for letters, rows in groupby(listed, lambda entry: entry["id"].partition("-")[0])
        ],
        "unseen": unseen(briefly, report["side"]),
        "axis": plots.decades_around(
            edge
            for it in report["latencies"][: limits.few]
            for each in it["bins"]
            for edge in each[:2]
        ),
        "measured": _measured(briefly, limits),
        "facts": list(_facts(report, limits).items())[: limits.items],
    }


def _opinion(exit_code: int, verdicts: set[str]) -> tuple[str, str]:
    """The verdict on the whole, as a shape and in words."""
    if exit_code in (EXIT_NO_VERDICT, EXIT_INTERRUPTED):
        return Verdict.ERROR, "No verdict"
    if exit_code != EXIT_CONFORMING:
        return Verdict.FAIL, "Not conforming"
    if Verdict.EXPECTED in verdicts:
        return Verdict.EXPECTED, "Not conforming, as expected"
    return Verdict.PASS, "Conforming"


def _measured(listed: Sequence[Report], limits: Limits) -> list[Mapping[str, Any]]:
    """What has a budget, the worst first; then what has none."""

    def found() -> Iterator[Mapping[str, Any]]:
        for entry in listed:
            for result in entry["results"]:
                for it in result["measurements"][: limits.few]:
                    worst, budget = it["worst"], it["budget"]
                    x = 0.0 if budget is None else plots.of_budget(worst, budget)
                    yield {**it, "id": entry["id"], "x": x}

    return sorted(found(), key=lambda it: (it["budget"] is None, not it["beyond"], -it["x"]))


def _facts(report: Report, limits: Limits) -> Mapping[str, Any]:
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
    found |= {ENVIRONMENT.get(name, name): it for name, it in report["environment"].items()}
    return {name: str(it) for name, it in found.items() if it not in ("", None)}
