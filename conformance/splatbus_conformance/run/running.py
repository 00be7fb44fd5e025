"""Run the checks against a testee, or against several at a time, and gather the results."""

import contextlib
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter
from pathlib import Path

from splatbus_schemas.requirements import requirements
from splatbus_schemas.visible import worded

from splatbus_conformance.checks import Check
from splatbus_conformance.plan import NoVerdict, Plan, Usage
from splatbus_conformance.reports.findings import Findings
from splatbus_conformance.reports.terminal import LiveProgress
from splatbus_conformance.run import room
from splatbus_conformance.run import workers as parallel
from splatbus_conformance.run.checker import Checker, selected
from splatbus_conformance.run.collector import Collector
from splatbus_conformance.run.testbed import set_up
from splatbus_conformance.verdicts import INTERRUPTED
from splatbus_conformance.wire.secrets import hidden
from splatbus_conformance.wire.sockets import Peer

TIME_UP = "the time of --within was up"
ENOUGH = "a MUST is broken"
FEWEST_CHECKS = 24
"""Fewer than these are done before further testees have started."""


def run_checks(plan: Plan, progress: LiveProgress, until: float = math.inf) -> Findings:
    """Run every check that the plan selects; the rules judge all that crosses the wire.

    If somebody presses Ctrl-C once the testee was met, or it is `until` by the monotonic clock, the
    findings are those of the checks that have run.

    Raises:
        Usage: the plan cannot be carried out.
        NoVerdict: the testee could not be met.
        KeyboardInterrupt: somebody pressed Ctrl-C before the testee was met.
    """
    findings = Findings()
    checks = {it.name: it for it in selected(plan)}
    alone = not plan.starts_it or plan.ports != (0, 0) or len(checks) < FEWEST_CHECKS
    if plan.parallel > 1 or not (plan.parallel or alone):
        parallel.prepare()
    gathering = Collector(findings, progress, checks, parallel.durations(plan))
    if plan.record:
        try:
            Path(plan.record).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Usage(f"--record: {worded(error)}") from None
    with contextlib.closing(set_up(plan, progress.say)) as testbed:
        progress.say(_what_happens(testbed.peer, plan))
        testbed.introduce()
        progress.say(f"Met the {plan.side}: {testbed.facts}.")
        for advice in testbed.facts.advice:
            progress.say(advice)
        if (late := time.monotonic() - until) >= 0:
            raise Usage(
                f"--within {plan.within:g}s is too short: to meet the testee alone took"
                f" {plan.within + late:.0f} s"
            )
        names = parallel.dealt(checks, plan)
        workers = plan.parallel or (1 if alone else room.at_a_time(testbed))
        checker = Checker(plan, testbed)  # judges the introduction, for workers have none
        if workers == 1:
            order = in_order([*checks.values()])
            if plan.within:
                order = sorted(map(checks.__getitem__, names), key=attrgetter("may_crash"))
            cut = one_by_one(checker, order, gathering, until)
        findings.traffic.add(checker.traffic)
    if workers > 1:
        progress.say(
            f"Judging {workers} of them at a time, each on ports of its own (--parallel 1: one)."
        )
        gathering.begin(names)
        try:
            whole = parallel.Workers(plan, testbed.facts, names, gathering).run(workers, until)
            cut = "" if whole else TIME_UP
        except KeyboardInterrupt:
            cut = INTERRUPTED
        except NoVerdict as error:
            if plan.parallel:
                raise
            why = str(error).splitlines()[0]
            progress.say(f"Another beside it could not be met ({why}): going on with one.")
            return run_checks(replace(plan, parallel=1), progress, until)
    if cut in (TIME_UP, INTERRUPTED):
        gathering.cut(cut)
    elif not cut:
        gathering.close("it was selected and did not run")
    return findings


def one_by_one(checker: Checker, order: Sequence[Check], gathering: Collector, until: float) -> str:
    """Run these checks; why it ended before all had run, if it did."""
    gathering.begin([it.name for it in order])
    try:
        for check in order:
            if time.monotonic() >= until:
                return TIME_UP
            gathering.start(check.name)
            told = checker.run(check)
            gathering.take(told)
            if checker.plan.exitfirst and told.breaks_a_must:
                return ENOUGH
        checker.look_after()
    except KeyboardInterrupt:
        return INTERRUPTED
    return ""


def in_order(checks: Sequence[Check]) -> list[Check]:
    """Checks of what must be before those of what should be, since a person in front of the testee
    may not start it for all of them; those that may crash it last.
    """
    known = requirements("1.1")

    def rank(check: Check) -> tuple[bool, bool]:
        return check.may_crash, not known[check.requirement].level.startswith("MUST")

    return sorted(checks, key=rank)


def _what_happens(peer: Peer, plan: Plan) -> str:
    where = f"IPC {peer.host}:{peer.ports['ipc']}, message {peer.host}:{peer.ports['msg']}"
    limit = f"for at most {plan.patience:g} s"
    if plan.starts_it:
        command = hidden(str(plan.adapter or plan.launch))
        return f"Starting {command}; meeting it on {where}, {limit}."
    if plan.side == "server":
        return f"Looking for a server at {where}, {limit}."
    return f"Waiting for a client on {where}, {limit}: start yours now (in an engine: press Play)."
