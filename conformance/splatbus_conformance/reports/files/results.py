"""What formats for people and CI systems tell of a report, and in which order."""

from collections.abc import Iterable, Iterator
from typing import Any

from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.triage import in_order
from splatbus_conformance.reports.unseen import why
from splatbus_conformance.verdicts import Level, Result, Verdict

ReportedResult = dict[str, Any]
"""A result of a report, with the `requirement` that it is about, empty for the run itself, and of
that the `level`, `sentence` and `acceptable`, empty for one that the testee is not judged by.
"""


def results(report: Report) -> Iterator[ReportedResult]:
    """Every result, in the order of the specification, those of the run itself last."""
    for entry in report["requirements"]:
        about = {name: entry[name] for name in ("level", "sentence", "acceptable")}
        for result in entry["results"]:
            yield {**result, **about, "requirement": entry["id"]}
    for result in report["others"]:
        yield {**result, "level": "", "sentence": "", "acceptable": ()}


def broken(told: Iterable[ReportedResult]) -> list[ReportedResult]:
    """Failures, errors and warnings, in the order in which to look at them."""
    told = list(told)
    found = [
        Result(
            it["requirement"],
            it["check"],
            Level(it["assurance"]),
            Verdict(it["verdict"]),
            code=it["code"],
            text=str(place),
        )
        for place, it in enumerate(told)
    ]
    return [told[int(it.text)] for it in in_order(found)]


def why_unseen(entry: Report, side: str) -> list[str]:
    """Why nothing is said of an entry of `requirements`, where nothing is."""
    if entry["verdict"] != Verdict.SKIP:
        return []
    reasons = [it["text"] for it in entry["results"]]
    if entry["deselected"]:
        reasons.append("left out by --select or --deselect")
    return list(dict.fromkeys(reasons or [why(entry["id"], side)]))


def unseen(entries: Iterable[Report], side: str) -> list[tuple[str, list[str]]]:
    """Reasons, and the ids that each kept from being seen; what kept most from it first."""
    found: dict[str, list[str]] = {}
    for entry in entries:
        for reason in why_unseen(entry, side):
            found.setdefault(reason, []).append(entry["id"])
    return sorted(found.items(), key=lambda it: -len(it[1]))
