"""The pytest plugin that runs the checks: gives each its trial and takes its verdict."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import pytest
from splatbus_schemas.requirements import Requirement, requirements

from splatbus_conformance.checks import Check
from splatbus_conformance.excerpt import excerpt
from splatbus_conformance.plan import Plan
from splatbus_conformance.recording import Entry
from splatbus_conformance.stand import Stand
from splatbus_conformance.trial import SETTLE_SECONDS, Trial, Violation
from splatbus_conformance.verdicts import Level, Result, Verdict, failing

EVIDENCE_LINES = 12


class Progress(Protocol):
    """Told of the run as it goes."""

    def begin(self, total: int) -> None:
        """So many checks will run."""

    def start(self, check: str, requirement: str) -> None:
        """This one runs now."""

    def done(self, result: Result) -> None:
        """One has its verdict."""


@dataclass
class Run:
    """What a run needs, and what it has found out."""

    plan: Plan
    stand: Stand
    progress: Progress
    results: list[Result] = field(default_factory=list)
    recordings: list[list[Entry]] = field(default_factory=list)
    trial: Trial | None = None
    """Of the check that runs now."""
    delivered: int = 0
    """Cases delivered and followed by something that proves it."""


class CheckPlugin:
    """Handed to `pytest.main`; holds one run."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.known = requirements("1.1")

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leave out what was not selected, and put what may crash the testee last."""
        items[:] = [item for item in items if self._selected(declared(item))]
        items.sort(key=lambda item: declared(item).may_crash)
        self.run.progress.begin(len(items))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Iterator[Any]:
        """Turn what happened into a result."""
        report = yield
        if call.when == "call" or (call.when == "setup" and call.excinfo is not None):
            result = self._result(item, call)
            self.run.results.append(result)
            self.run.progress.done(result)
        return report

    @pytest.fixture
    def trial(self, request: pytest.FixtureRequest) -> Iterator[Trial]:
        """A trial with fresh connections; whatever crossed the wire is kept for the rules."""
        run, check = self.run, declared(request.node)
        peer, testee = run.stand.peer, run.stand.testee
        run.trial = None
        run.progress.start(request.node.name, check.requirement)
        if reason := self._missing(check):
            pytest.skip(reason)
        trial = run.trial = run.stand.trial(self.known[check.requirement])
        trial.seed, trial.profile = run.plan.seed, run.plan.profile
        yield trial
        peer.pump(SETTLE_SECONDS)
        run.delivered += trial.delivered
        if testee.ended() is not None:
            testee.stop()
        run.recordings.append(list(peer.entries))

    def _selected(self, check: Check) -> bool:
        if self.run.plan.select:
            return check.requirement in self.run.plan.select
        return check.profile == "quick" or self.run.plan.profile == "full"

    def _missing(self, check: Check) -> str | None:
        for need in check.needs:
            if reason := self.run.stand.facts.lacks(need):
                return str(reason)
        if check.may_crash and not (self.run.stand.testee.expendable or self.run.plan.allow_crash):
            return "it may crash a testee that was not launched by the harness: --allow-crash"
        return None

    def _result(self, item: pytest.Item, call: pytest.CallInfo[None]) -> Result:
        check, error = declared(item), call.excinfo
        measurements = tuple(self.run.trial.measurements) if self.run.trial else ()
        verdict, text = Verdict.PASS, "; ".join(map(str, measurements))
        evidence: tuple[str, ...] = ()
        if error is not None:
            text = str(error.value)
            evidence = tuple(excerpt(self.run.stand.peer.entries, EVIDENCE_LINES))
            if isinstance(error.value, Violation):
                verdict = failing(self.known[check.requirement].level)
            elif isinstance(error.value, pytest.skip.Exception):
                verdict, evidence = Verdict.SKIP, ()
            else:
                verdict, text = Verdict.ERROR, f"{error.typename}: {text}"
        return Result(
            check.requirement,
            item.name,
            Level(check.level),
            verdict,
            text,
            evidence,
            call.duration,
            measurements,
        )


def declared(item: pytest.Item) -> Check:
    """What a collected check declares of itself."""
    function: Any = item.function  # type: ignore[attr-defined]
    check: Check = function.check
    return check


def of_run(run: Run) -> dict[str, Requirement]:
    """The requirements a run could judge: those on its testee, of 1.1 only where it is claimed."""
    version = run.stand.facts.version()
    return {id: r for id, r in requirements(version).items() if run.plan.side in r.binds}
