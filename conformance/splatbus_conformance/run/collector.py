"""Gathers what checks come to, wherever they run."""

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import replace

from splatbus_conformance.checks import Check
from splatbus_conformance.reports.findings import Findings
from splatbus_conformance.reports.terminal import LiveProgress
from splatbus_conformance.run.checker import Told
from splatbus_conformance.verdicts import Level, Result, Verdict


class Collector:
    """Puts all results into findings, and tells of the progress."""

    def __init__(
        self,
        findings: Findings,
        progress: LiveProgress,
        checks: Mapping[str, Check],
        seconds: Mapping[str, float],
    ) -> None:
        self.findings, self.progress, self.checks = findings, progress, checks
        self.seconds = seconds
        """How long checks took once."""
        self.names: list[str] = []
        """Of the checks that have to run."""
        self._told: set[str] = set()
        """Names of those that have a result."""

    def begin(self, names: Sequence[str]) -> None:
        """These checks have to run."""
        self.names = list(names)
        usual = statistics.median(self.seconds.values())
        self.progress.begin({name: self.seconds.get(name, usual) for name in names})

    def start(self, name: str) -> None:
        """A check begins."""
        self.progress.start(name, self.checks[name].requirement)

    def take(self, told: Told) -> None:
        """A check has come to its end."""
        self._put(told.place, told.result)
        self.findings.traffic.add(told.traffic)

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
