"""What is said of recordings that were judged, and written of them."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text
from splatbus_schemas.requirements import requirements

from splatbus_conformance.observe.audit import Audit, results
from splatbus_conformance.plan import Side
from splatbus_conformance.reports import latencies
from splatbus_conformance.reports.files import Files
from splatbus_conformance.reports.files.as_json import json_report
from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.reports.run_report import RunReport, summary
from splatbus_conformance.reports.terminal import print_failures
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_NO_VERDICT,
    EXIT_NOT_CONFORMING,
    exit_code,
    reached,
)


def opinion(
    audits: Iterable[tuple[str, Audit]],
    peers: Sequence[Side],
    files: Files,
    out: Console,
    *,
    strict: bool,
) -> int:
    """Say what the audits of these recordings found, and write the reports, one for each peer of
    each; the exit status. Raises Usage where one cannot be written.
    """
    reports = []
    for name, judged in audits:
        _print_connections(out, name, judged)
        for peer in peers:
            found = results(judged, peer)
            known = requirements(judged.version(peer))
            bound = {id: each for id, each in known.items() if peer in each.binds}
            print_failures(out, found, known)
            sentence, verdicts = summary(found, bound, reached(found))
            out.print(f"{peer}: {sentence}")
            took = latencies.of(judged.conversations, peer)
            reports.append(
                RunReport(
                    f"the {peer} in {Path(name).name}",
                    peer,
                    sentence,
                    found,
                    bound,
                    exit_code(verdicts, strict=strict),
                    Traffic(version=judged.version(peer), latencies=took),
                    judged.seconds,
                    not_judged=judged.left_over,
                )
            )
        out.print()
    files.write([json_report(report) for report in reports])
    codes = [report.status for report in reports]
    if EXIT_NOT_CONFORMING in codes:
        return EXIT_NOT_CONFORMING
    return EXIT_CONFORMING if EXIT_CONFORMING in codes else EXIT_NO_VERDICT


def _print_connections(out: Console, name: str, judged: Audit) -> None:
    """What a recording holds, before what is said of it."""
    seen = ", ".join(f"{count} on {channel}" for channel, count in judged.connections.items())
    out.print(Text.assemble((name, "bold"), f"  connections: {seen}"))
    for line in judged.left_over:
        out.print(Text(f"  not judged: {line}", "dim"))
