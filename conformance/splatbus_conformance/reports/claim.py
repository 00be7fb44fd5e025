"""What may be claimed of a program after a run (spec 1.1 section 10.4)."""

from splatbus_schemas.version import installed_version

from splatbus_conformance.reports.run_report import RunReport
from splatbus_conformance.verdicts import Verdict, reached

REFUTED = {Verdict.FAIL, Verdict.EXPECTED, Verdict.ERROR}


def claim(report: RunReport) -> str | None:
    """The claim that a run bears out; None where it was not a whole one, or broke something."""
    if report.status or report.deselected or report.cut or report.profile is None:
        return None
    if REFUTED & {result.verdict for result in report.results}:
        return None
    version, seeds = report.traffic.version, ", ".join(map(str, report.seeds))
    return (
        f"conforms to SplatBus {version} as a {report.side}, "
        f"judged by splatbus-conformance {installed_version()}, profile {report.profile}, "
        f"seed {seeds}, at {reached(report.results)}"
    )
