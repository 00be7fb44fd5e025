"""The pytest plugin that runs the checks: gives each its trial and takes its verdict."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import pytest
from splatbus_schemas.requirements import Requirement, requirements

from splatbus_conformance.checks import Check
from splatbus_conformance.excerpt import excerpt
from splatbus_conformance.peer import Peer
from splatbus_conformance.recording import Entry
from splatbus_conformance.role import Role
from splatbus_conformance.testee import Testee
from splatbus_conformance.trial import SETTLE_SECONDS, Facts, Trial, Violation
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

    peer: Peer
    role: Role
    testee: Testee
    facts: Facts
    patience: float
    progress: Progress
    profile: str = "quick"
    allow_crash: bool = False
    seed: int = 0
    select: tuple[str, ...] = ()
    results: list[Result] = field(default_factory=list)
    recordings: list[list[Entry]] = field(default_factory=list)
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
        self.run.progress.start(request.node.name, check.requirement)
        if reason := self._missing(check):
            pytest.skip(reason)
        role = Role(run.role.memory, run.role.width, run.role.height, run.role.slots)
        trial = Trial(
            self.known[check.requirement], run.peer, role, run.testee, run.facts, run.patience
        )
        trial.seed, trial.profile = run.seed, run.profile
        for channel in ("ipc", "msg"):
            run.peer.listen(channel)
        yield trial
        run.peer.pump(SETTLE_SECONDS)
        run.delivered += trial.delivered
        if run.testee.ended() is not None:
            run.testee.stop()
        run.recordings.append(list(run.peer.entries))

    def _selected(self, check: Check) -> bool:
        if self.run.select:
            return check.requirement in self.run.select
        return check.profile == "quick" or self.run.profile == "full"

    def _missing(self, check: Check) -> str | None:
        facts = self.run.facts
        for need in check.needs:
            kind, _, channel = need.partition(":")
            if kind == "hello" and not facts.hello.get(channel):  # type: ignore[call-overload]
                return f"the testee says no hello on the {channel} channel: 1.1 is not claimed"
            if kind == "returns" and channel not in facts.returns:
                return f"the testee does not connect to the {channel} channel again"
            if kind in ("ipc", "msg") and kind not in facts.connects:
                return f"the testee makes no connection on the {kind} channel"
            if kind == "asks" and not facts.asks:
                return "the testee makes no request when it connects"
            if kind == "poses" and not facts.poses:
                return "the testee sends no poses unasked"
            if kind == "opens" and not facts.opens:
                return "the testee did not open good memory when it was first met"
            if kind == "capability" and channel not in facts.capabilities():
                return f"the testee does not declare the capability {channel}"
        if check.may_crash and not (self.run.testee.expendable or self.run.allow_crash):
            return "it may crash a testee that was not launched by the harness: --allow-crash"
        return None

    def _result(self, item: pytest.Item, call: pytest.CallInfo[None]) -> Result:
        check, error = declared(item), call.excinfo
        verdict, text = Verdict.PASS, ""
        evidence: tuple[str, ...] = ()
        if error is not None:
            text = str(error.value)
            evidence = tuple(excerpt(self.run.peer.entries, EVIDENCE_LINES))
            if isinstance(error.value, Violation):
                verdict = failing(self.known[check.requirement].level)
            elif isinstance(error.value, pytest.skip.Exception):
                verdict, evidence = Verdict.SKIP, ()
            else:
                verdict, text = Verdict.ERROR, f"{error.typename}: {text}"
        return Result(
            check.requirement, item.name, Level.WIRE, verdict, text, evidence, call.duration
        )


def declared(item: pytest.Item) -> Check:
    """What a collected check declares of itself."""
    function: Any = item.function  # type: ignore[attr-defined]
    check: Check = function.check
    return check


def of_run(run: Run) -> dict[str, Requirement]:
    """The requirements a run could judge: those on clients, of 1.1 only where it is claimed."""
    version = "1.1" if any(run.facts.hello.values()) else "1.0"
    return {id: r for id, r in requirements(version).items() if "client" in r.binds}
