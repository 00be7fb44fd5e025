"""The results of a report, whichever requirement they belong to."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from splatbus_conformance.reports.files.as_json import Report


class ReportedResult(NamedTuple):
    """One result, and what it is about."""

    requirement: str
    """Its id; empty for what befell the run itself."""
    sentence: str
    acceptable: tuple[str, ...]
    result: dict[str, Any]


def results(report: Report) -> Iterator[ReportedResult]:
    """Every result, in the order of the specification, those of the run itself last."""
    for entry in report["requirements"]:
        for result in entry["results"]:
            yield ReportedResult(entry["id"], entry["sentence"], tuple(entry["acceptable"]), result)
    for result in report["others"]:
        yield ReportedResult(result["requirement"], "", (), result)
