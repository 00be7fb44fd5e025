"""A whole run on a live testee: meet it, judge it, say what came of it."""

import argparse
import json
import time
from pathlib import Path

from rich.console import Console
from splatbus_schemas.requirements import requirements

from splatbus_conformance.findings import Findings
from splatbus_conformance.plan import NoVerdict, Plan, Usage
from splatbus_conformance.reports import json_report, junit_report
from splatbus_conformance.running import Interrupted, run_checks
from splatbus_conformance.terminal import Live, print_failures, print_what_next, summary
from splatbus_conformance.verdicts import (
    EXIT_INTERRUPTED,
    EXIT_NO_VERDICT,
    EXIT_USAGE,
    exit_code,
)


def judge(plan: Plan, arguments: argparse.Namespace, out: Console) -> int:
    """Judge a testee by a plan, and write the reports that the arguments ask for."""
    live = Live(out)
    began = time.monotonic()
    try:
        findings = run_checks(plan, live)
    except Usage as error:
        out.print(f"splatbus-conformance: {error}", markup=False)
        return EXIT_USAGE
    except NoVerdict as error:
        out.print(f"no verdict: {error}", markup=False)
        return EXIT_NO_VERDICT
    except Interrupted:
        return EXIT_INTERRUPTED
    finally:
        live.end()
    return _report(plan, findings, time.monotonic() - began, arguments, out)


def _report(
    plan: Plan,
    findings: Findings,
    seconds: float,
    arguments: argparse.Namespace,
    out: Console,
) -> int:
    traffic = findings.traffic
    judged, name, results = traffic.judged(plan.side), traffic.testee, findings.results(plan)
    print_failures(out, results, requirements("1.1"))
    print_what_next(out, results, recorded=bool(plan.record))
    sentence, verdicts = summary(results, judged, plan.level)
    status = exit_code(verdicts, strict=arguments.strict)
    out.print(f"{sentence}\n{traffic.sentence(seconds)}", markup=False)
    if arguments.json:
        report = json_report(
            name,
            sentence,
            results,
            judged,
            exit_code=status,
            traffic=traffic,
            seconds=seconds,
        )
        Path(arguments.json).write_text(json.dumps(report, indent=1) + "\n", "utf-8")
    if arguments.junit:
        Path(arguments.junit).write_bytes(junit_report(name, results, seconds))
    return status
