"""`splatbus-conformance replay`: deliver one script, and say whether it fails again."""

import time
from dataclasses import replace

from rich.console import Console
from rich.text import Text
from splatbus_schemas.requirements import requirements

from splatbus_conformance.cases.script import Script
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.plan import Plan
from splatbus_conformance.reports.files import Files
from splatbus_conformance.reports.files.as_json import json_report
from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.reports.run_report import RunReport
from splatbus_conformance.reports.terminal import print_evidence, words
from splatbus_conformance.run.replay import Replay, replay
from splatbus_conformance.run.testbed import set_up
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_NO_VERDICT,
    EXIT_NOT_CONFORMING,
    Level,
    Result,
    Verdict,
    failing,
)


def replay_script(script: Script, plan: Plan, files: Files, out: Console) -> int:
    """Deliver a script to the testee of a plan: 1 if it fails again, 0 if it does not, 3 if nothing
    can be said. Raises Usage, NoVerdict.
    """
    began = time.monotonic()
    files.remove_former()
    testbed = set_up(replace(plan, side=script.side, viewport=script.viewport))
    try:
        testbed.introduce()
        given = replay(testbed, script)
        traffic = Traffic(testbed.testee.name, testbed.facts.version(), testbed.facts.device)
    finally:
        testbed.close()
    _print(script, given, out)
    report = replay_report(script, given, traffic, time.monotonic() - began)
    files.write(json_report(report))
    return report.status


def replay_report(script: Script, given: Replay, traffic: Traffic, seconds: float) -> RunReport:
    """The report of a replay, on the one requirement that the script is about."""
    requirement = requirements("1.1")[script.requirement]
    text, verdict = given.skipped, Verdict.SKIP
    again = f"no verdict: {given.skipped}"
    if not given.skipped:
        text, again = "nothing that breaks it", f"{requirement.id} is not broken again"
        verdict = Verdict.PASS
    if given.broken is not None:
        text, again = given.broken.words, f"{requirement.id} is broken again"
        verdict = failing(requirement.level)
    result = Result(
        requirement.id,
        script.check,
        _level(script),
        verdict,
        text,
        given.transcript,
        seconds,
        tuple(given.trial.measurements),
        code=given.broken.code if given.broken else "",
    )
    judged = {requirement.id: requirement}
    return RunReport(
        traffic.testee, script.side, again, [result], judged, _status(given), traffic, seconds
    )


def _level(script: Script) -> Level:
    if script.by_rule:
        return Level.PASSIVE
    known = {it.name: it.level for it in checks_of(script.side)}
    return Level(known[script.check])


def _status(given: Replay) -> int:
    if given.skipped:
        return EXIT_NO_VERDICT
    return EXIT_CONFORMING if given.broken is None else EXIT_NOT_CONFORMING


def _print(script: Script, given: Replay, out: Console) -> None:
    requirement = requirements("1.1")[script.requirement]
    style, verdict = ("green", "NOT AGAIN") if given.broken is None else ("bold red", "AGAIN")
    title = (verdict, style), " ", (requirement.id, "bold"), " ", (words(script.check), "dim")
    out.print(Text.assemble(*title))
    out.print(f"  the standard   {requirement.sentence}")
    out.print(f"  it accepts     {', '.join(requirement.acceptable)}")
    out.print(f"  seen before    {script.seen}")
    out.print(f"  seen now       {given.broken or 'nothing that breaks it'}")
    if given.skipped:
        out.print(f"  not judged     {given.skipped}")
    print_evidence(out, given.transcript)
