"""Run the checks against a testee, or against several at a time, and gather the results."""

import contextlib
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from splatbus_schemas.requirements import requirements

from splatbus_conformance.checks import Check
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.plan import NoVerdict, Plan, Usage
from splatbus_conformance.reports.findings import Findings
from splatbus_conformance.run import room
from splatbus_conformance.run import workers as parallel
from splatbus_conformance.run.collector import Collector, Progress
from splatbus_conformance.run.plugin import CheckPlugin, Order, declared, selectable
from splatbus_conformance.run.pytest_run import run_pytest
from splatbus_conformance.run.testbed import set_up
from splatbus_conformance.verdicts import INTERRUPTED, Level, Result, Verdict
from splatbus_conformance.wire.secrets import hidden
from splatbus_conformance.wire.sockets import Peer

TIME_UP = "the time of --within was up"
FEWEST_CHECKS = 24
"""Fewer than these are done before further testees have started."""


def run_checks(plan: Plan, progress: Progress, until: float = math.inf) -> Findings:
    """Run every check that the plan selects; the rules judge all that crosses the wire.

    The user's own pytest configuration, options and plugins have no part in it. If somebody presses
    Ctrl-C once the testee was met, or it is `until` by the monotonic clock, the findings are those
    of the checks that have run.

    Raises:
        Usage: the plan cannot be carried out.
        NoVerdict: the testee could not be met.
        KeyboardInterrupt: somebody pressed Ctrl-C before the testee was met.
    """
    findings = Findings()
    checks: dict[str, Check] = {it.name: it for it in checks_of(plan.side)}
    selected = {
        name: it
        for name, it in checks.items()
        if plan.selection.takes(selectable(it), plan.profile)
    }
    alone = not plan.starts_it or plan.ports != (0, 0) or len(selected) < FEWEST_CHECKS
    if plan.parallel > 1 or not (plan.parallel or alone):
        parallel.prepare()
    gathering = Collector(findings, progress, checks, parallel.durations(plan))
    if plan.record:
        Path(plan.record).mkdir(parents=True, exist_ok=True)
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
        names = parallel.dealt(selected, plan)
        plugin = CheckPlugin(plan, testbed, in_order if not plan.within else in_order_of(names))
        workers = plan.parallel or (1 if alone else room.at_a_time(testbed))
        if workers == 1:
            status = run_pytest([plugin, gathering, Deadline(until)])
            if status != pytest.ExitCode.INTERRUPTED:
                plugin.look_after()
        findings.traffic.add(plugin.traffic)
        if workers == 1:
            _note_what_did_not_run(gathering, status, plan, until)
            return findings
        # What the rules see of the introduction; the workers have none of their own.
        findings.traffic.add(CheckPlugin(plan, testbed, in_order).traffic)
    progress.say(
        f"Judging {workers} of them at a time, each on ports of its own (--parallel 1: one)."
    )
    gathering.begin(names)
    status = pytest.ExitCode.INTERRUPTED
    try:
        if parallel.Workers(plan, testbed.facts, names, gathering).run(workers, until):
            status = pytest.ExitCode.OK
    except KeyboardInterrupt:
        until = math.inf
    except NoVerdict as error:
        if plan.parallel:
            raise
        why = str(error).splitlines()[0]
        progress.say(f"Another beside it could not be met ({why}): going on with one.")
        return run_checks(replace(plan, parallel=1), progress, until)
    _note_what_did_not_run(gathering, status, plan, until)
    return findings


class Deadline:
    """The pytest plugin that runs no check from this moment of the monotonic clock on."""

    def __init__(self, until: float) -> None:
        self._until = until

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> bool | None:
        """In place of all that pytest does for a check."""
        if time.monotonic() < self._until:
            return None
        item.session.shouldstop = TIME_UP
        return True


def in_order_of(names: Sequence[str]) -> Order:
    """Checks by their names; those that may crash the testee last."""
    place = {name: number for number, name in enumerate(names)}
    return lambda items: sorted(items, key=lambda it: (declared(it).may_crash, place[it.name]))


def in_order(items: list[pytest.Item]) -> list[pytest.Item]:
    """Checks of what must be before those of what should be, since a person in front of the testee
    may not start it for all of them; those that may crash it last.
    """
    known = requirements("1.1")

    def rank(item: pytest.Item) -> tuple[bool, bool]:
        check = declared(item)
        return check.may_crash, not known[check.requirement].level.startswith("MUST")

    return sorted(items, key=rank)


def _what_happens(peer: Peer, plan: Plan) -> str:
    where = f"IPC {peer.host}:{peer.ports['ipc']}, message {peer.host}:{peer.ports['msg']}"
    limit = f"for at most {plan.patience:g} s"
    if plan.starts_it:
        command = hidden(str(plan.adapter or plan.launch))
        return f"Starting {command}; meeting it on {where}, {limit}."
    if plan.side == "server":
        return f"Looking for a server at {where}, {limit}."
    return f"Waiting for a client on {where}, {limit}: start yours now (in an engine: press Play)."


def _note_what_did_not_run(gathering: Collector, status: int, plan: Plan, until: float) -> None:
    if status == pytest.ExitCode.INTERRUPTED and not gathering.uncollected:
        gathering.cut(TIME_UP if time.monotonic() >= until else INTERRUPTED)
        return
    if gathering.uncollected or status in (
        pytest.ExitCode.INTERNAL_ERROR,
        pytest.ExitCode.USAGE_ERROR,
    ):
        why = gathering.uncollected or f"pytest ended with {pytest.ExitCode(status)!r}"
        gathering.findings.put(0, Result("", "collection", Level.WIRE, Verdict.ERROR, why))
    if not (plan.exitfirst and status == pytest.ExitCode.TESTS_FAILED):
        gathering.close("it was selected and did not run")
