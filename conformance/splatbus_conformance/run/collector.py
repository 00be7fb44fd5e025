"""The pytest plugin that listens to reports, wherever the checks run, and gathers what they say."""

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import pytest

from splatbus_conformance.checks import Check
from splatbus_conformance.reports.findings import Findings
from splatbus_conformance.run.plugin import RESULT, TRAFFIC
from splatbus_conformance.verdicts import Level, Result, Verdict


class Progress(Protocol):
    """Told of the run as it goes."""

    def say(self, text: str) -> None:
        """Something that the user has to do or know."""

    def begin(self, seconds: Mapping[str, float]) -> None:
        """These checks will run, each of which took so many seconds once."""

    def start(self, check: str, requirement: str) -> None:
        """This one runs now."""

    def done(self, result: Result) -> None:
        """One has its verdict."""


class Collector:
    """Handed to `pytest.main`; puts all results into findings."""

    def __init__(
        self,
        findings: Findings,
        progress: Progress,
        checks: Mapping[str, Check],
        seconds: Mapping[str, float],
    ) -> None:
        self.findings, self.progress, self.checks = findings, progress, checks
        self.seconds = seconds
        """How long checks took once."""
        self.names: list[str] = []
        """Of the checks that have to run."""
        self.uncollected = ""
        """Why checks could not even be found."""
        self._told: set[str] = set()
        """Names of those that have a result."""

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """The checks run in this process, and these are they."""
        self.begin([_name(item.nodeid) for item in session.items])

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """A module of checks was read."""
        if report.failed:
            self.uncollected = str(report.longrepr)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """A check begins."""
        name = _name(nodeid)
        self.progress.start(name, self.checks[name].requirement)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """A check has come to its end, or its process has."""
        name: str = _name(report.nodeid)
        properties: dict[str, Any] = dict(report.user_properties)
        if RESULT in properties:
            self._put(*properties[RESULT])
        elif report.failed:
            self.note(name, str(report.longrepr))
        if TRAFFIC in properties:
            self.findings.traffic.add(properties[TRAFFIC])

    def begin(self, names: Sequence[str]) -> None:
        """These checks have to run."""
        self.names = list(names)
        usual = statistics.median(self.seconds.values())
        self.progress.begin({name: self.seconds.get(name, usual) for name in names})

    def note(self, name: str, why: str) -> None:
        """A check has come to no result."""
        if name not in self._told:
            self._put(self._beyond(), self._error(name, why))

    def close(self, why: str) -> None:
        """Note each check that should have run and did not."""
        for name in self.names:
            self.note(name, why)

    def cut(self, why: str) -> None:
        """Leave out each check that has not run, for the run has to end."""
        left = [name for name in self.names if name not in self._told]
        self.findings.cut, self.findings.left = why, len(left)
        for name in left:
            skipped = replace(self._error(name, why), verdict=Verdict.SKIP)
            self._put(self._beyond(), skipped)

    def _put(self, place: int, result: Result) -> None:
        self._told.add(result.check)
        self.findings.put(place, result)
        self.progress.done(result)

    def _beyond(self) -> int:
        return len(self.names) + len(self.findings.placed) + 1

    def _error(self, name: str, text: str) -> Result:
        check = self.checks[name]
        return Result(check.requirement, name, Level(check.level), Verdict.ERROR, text)


def _name(nodeid: str) -> str:
    return nodeid.rpartition("::")[2]
