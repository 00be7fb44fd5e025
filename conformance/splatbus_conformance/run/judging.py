"""A whole run on a live testee: meet it, judge it, say what came of it."""

import math
import os
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from splatbus_conformance.plan import NoVerdict, Plan
from splatbus_conformance.reports import expected_failures
from splatbus_conformance.reports.files.as_json import json_report
from splatbus_conformance.reports.findings import Findings, Traffic
from splatbus_conformance.reports.run_report import RunReport, summary
from splatbus_conformance.reports.terminal import LiveProgress, print_run
from splatbus_conformance.reports.thresholds import missing, observed, shortfalls, was_busy
from splatbus_conformance.reports.unseen import unseen
from splatbus_conformance.run.failures import work_out
from splatbus_conformance.run.options import RunOptions, selectable_on
from splatbus_conformance.run.running import run_checks
from splatbus_conformance.trials.testee import diagnostics
from splatbus_conformance.verdicts import (
    EXIT_INTERRUPTED,
    EXIT_NO_VERDICT,
    EXIT_NOT_CONFORMING,
    INTERRUPTED,
    Level,
    Result,
    Verdict,
    exit_code,
    reached,
)

LATE_SECONDS = 1.0
"""A harness that was so late may have taken for a failure what was none."""
REPORT_SECONDS, REPORT_SHARE = 5.0, 0.1
"""What a run that has a time to keep to leaves of it for what follows the checks."""


def judge(plan: Plan, wishes: RunOptions, out: Console) -> int:
    """Judge a testee by a plan, and write the reports that are wished for.

    Raises Usage, NoVerdict.
    """
    live = LiveProgress(out)
    began = time.monotonic()
    within = plan.within or math.inf
    until = began + within - min(REPORT_SECONDS, REPORT_SHARE * within)
    wishes.files.remove_former()

    def write_why_not(why: str, status: int) -> None:
        wishes.files.write(_without_verdict(plan, why, status, time.monotonic() - began))

    try:
        if plan.profile == "soak":
            findings = soak(plan, 60 * wishes.minutes, live)
        else:
            findings = run_checks(plan, live, until)
    except NoVerdict as error:
        write_why_not(str(error), EXIT_NO_VERDICT)
        raise
    except KeyboardInterrupt:
        write_why_not(INTERRUPTED, EXIT_INTERRUPTED)
        raise
    finally:
        live.end()
    if findings.cut == INTERRUPTED:
        wishes = replace(wishes, shrink_seconds=0.0)
    elif plan.within:
        left = max(0.0, began + within - time.monotonic())
        wishes = replace(wishes, shrink_seconds=min(left, wishes.shrink_seconds))
    return _report(plan, findings, time.monotonic() - began, wishes, out)


def soak(plan: Plan, seconds: float, live: LiveProgress) -> Findings:
    """Run the full profile with one seed after the other until so many seconds have passed."""
    until = time.monotonic() + seconds
    findings = Findings()
    seed = plan.seed
    while seed == plan.seed or (time.monotonic() < until and not findings.cut):
        live.say(f"seed {seed}: {findings.traffic.delivered:,} cases delivered so far")
        record = str(Path(plan.record, f"seed-{seed}")) if plan.record else None
        try:
            findings.add(run_checks(replace(plan, seed=seed, record=record), live), seed)
        except NoVerdict as error:
            if seed == plan.seed:
                raise
            text = f"with seed {seed} the testee could not be met: {error}"
            findings.put(0, Result("", "introduction", Level.WIRE, Verdict.ERROR, text))
        seed += 1
    return findings


def _without_verdict(plan: Plan, why: str, status: int, seconds: float) -> dict[str, Any]:
    """The report of a run that came to no verdict, so that a CI job has one to show."""
    return json_report(
        RunReport(
            plan.launch or plan.adapter or f"{plan.host}:{plan.ports[0]},{plan.ports[1]}",
            plan.side,
            f"no verdict: {why.splitlines()[0]}",
            [Result("", "run", Level.WIRE, Verdict.ERROR, why)],
            Traffic().judged(plan.side),
            status,
            Traffic(),
            seconds,
            profile=plan.profile,
            seeds=[plan.seed],
        )
    )


def _report(
    plan: Plan, findings: Findings, seconds: float, wishes: RunOptions, out: Console
) -> int:
    traffic = findings.traffic
    judged = traffic.judged(plan.side)
    found = findings.results(plan)
    results, stale = expected_failures.applied(found, wishes.expectations)
    busy = was_busy(traffic.late_seconds, _load()) if traffic.late_seconds > LATE_SECONDS else ""
    results = work_out(plan, results, wishes.scripts, wishes.shrink_seconds, out.print, busy)
    level = wishes.demands.level
    ended = "" if observed(results, judged) else traffic.ended
    if ended:
        traffic.advice.append(diagnostics.ended_by_itself(ended, traffic.printed))
    fewer = missing(results, judged, traffic.late_seconds, _load())
    if fewer:
        traffic.advice.append(fewer)
    complaints = [*stale, *shortfalls(results, judged, wishes.demands, traffic.version)]
    interrupted = findings.cut == INTERRUPTED
    why_none = INTERRUPTED if interrupted else ended
    sentence, verdicts = summary(results, judged, reached(results), level, why_none)
    if findings.left:
        why = "" if findings.cut in sentence else f", for {findings.cut}"
        sentence += f"; {findings.left} checks did not run{why}"
    if complaints and not any(it is Verdict.FAIL for it in verdicts.values()):
        sentence += "; the run fails by what was demanded of it"
    if fewer:
        sentence += "; fewer than usual were observed: busy machine"
    deselected = left_out(plan)
    if deselected:
        sentence += f"; {sum(map(len, deselected.values()))} checks and rules were deselected"
    status = EXIT_NOT_CONFORMING if complaints else exit_code(verdicts, strict=wishes.strict)
    report = RunReport(
        traffic.testee,
        plan.side,
        sentence,
        results,
        judged,
        EXIT_INTERRUPTED if interrupted else status,
        traffic,
        seconds,
        level,
        complaints,
        deselected,
        unseen={} if plan.selection.partial else unseen(found, judged, plan.side),
        profile=plan.profile,
        seeds=findings.seeds or [plan.seed],
        recorded=bool(plan.record),
        cut=findings.cut,
    )
    print_run(out, report)
    wishes.files.write(json_report(report))
    if wishes.write_expected and findings.cut:
        out.print(f"{wishes.write_expected} is not written: {findings.cut}, so it is not whole")
    elif wishes.write_expected:
        return write_expected(wishes.write_expected, found, wishes, out)
    return report.status


def _load() -> str:
    """How many wanted the processors lately, where systems count that."""
    if not hasattr(os, "getloadavg"):
        return ""
    return f", with a load of {os.getloadavg()[1]:.0f} on {os.cpu_count()} processors"


def left_out(plan: Plan) -> dict[str, list[str]]:
    """For each requirement, the checks and rules that the selection leaves out."""
    found: dict[str, list[str]] = {}
    for item in selectable_on(plan.side) if plan.selection.partial else ():
        if not plan.selection.takes(item, "full"):
            found.setdefault(item.requirement, []).append(item.name)
    return found


def write_expected(path: Path, found: Iterable[Result], wishes: RunOptions, out: Console) -> int:
    """Write the list of expected failures anew; not from a run in which the harness failed."""
    found = list(found)
    errors = [f"{it.requirement} {it.check}" for it in found if it.verdict is Verdict.ERROR]
    if errors:
        out.print(
            f"{path} is not written: the harness failed in {', '.join(errors)}, so the run is not "
            "whole",
        )
        return EXIT_NO_VERDICT
    listed = expected_failures.listed(found, wishes.expectations, strict=wishes.strict)
    path.write_text(listed, "utf-8")
    out.print(f"{path} is written; give each new entry a reason")
    return 0
