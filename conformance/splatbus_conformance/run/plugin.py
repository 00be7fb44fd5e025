"""The pytest plugin that runs the checks: gives each its trial and takes its verdict.

What it finds out leaves in the reports of pytest, as text, so that it does not matter in which
process the checks run.
"""

import sys
import time
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest
from splatbus_schemas.requirements import requirements

from splatbus_conformance.cases.drawing import leave_nothing_where_the_user_works
from splatbus_conformance.cases.script import Script, as_text, from_text
from splatbus_conformance.checks import Check
from splatbus_conformance.checks.registry import checks_in, checks_of
from splatbus_conformance.plan import Plan
from splatbus_conformance.reports import latencies
from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.rules import LOST, guilty
from splatbus_conformance.rules.tally import add, rules_on, tally
from splatbus_conformance.run.deaths import note_deaths
from splatbus_conformance.run.second_look import SecondLook
from splatbus_conformance.run.testbed import Testbed
from splatbus_conformance.run.vital_signs import forbids_loss
from splatbus_conformance.selection import RULE, Item
from splatbus_conformance.trials.trial import SETTLE_SECONDS, Trial, Violation
from splatbus_conformance.verdicts import Level, Result, Verdict, failing
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.recording import Channel, Entry
from splatbus_conformance.wire.saving import save
from splatbus_conformance.wire.sockets import Peer
from splatbus_conformance.wire.transcript import excerpt

LATE_SECONDS = 0.1
"""Half of the shortest time that a check gives a testee: one that the machine keeps waiting for so
long may not have had the other half.
"""
EVIDENCE_LINES = 12
PRINTED_LINES = 3
NOTHING_PROVEN = "nothing was delivered that the testee was seen to take"
CHECK = pytest.StashKey[Check]()
"""What was collected, as it judges this side."""
PLACE = pytest.StashKey[int]()
"""Of a check among those of a serial run."""
RESULT, TRAFFIC = "splatbus result", "splatbus traffic"
"""Properties of reports: place and result of a check, and what crossed the wire meanwhile."""
Order = Callable[[list[pytest.Item]], list[pytest.Item]]


class CheckAftermath(NamedTuple):
    """What a check has done to the testee."""

    name: str
    check: Check
    script: str
    """What it delivered, as text."""
    entries: list[Entry]
    """What crossed the wire."""
    failed: bool
    """Its own verdict says that something is broken."""


MEETING = Check("CHN-19", "what the testee does when it is left alone", {}, False, "quick")
"""The first meeting, as if it were a check."""


class Modules(pytest.Directory):
    """Python modules of a folder, found without looking through it, which takes pytest longer than
    most checks run.
    """

    modules: Sequence[Path]

    @classmethod
    def of(cls, parent: pytest.Collector, folder: Path, modules: Sequence[Path]) -> "Modules":
        """These modules of this folder."""
        node: Modules = cls.from_parent(parent, path=folder)
        node.modules = modules
        return node

    def collect(self) -> Iterator[pytest.Module]:
        """Each of them."""
        for path in self.modules:
            yield pytest.Module.from_parent(self, path=path)


class CheckPlugin:
    """Handed to `pytest.main`, with a stand whose testee has been met."""

    def __init__(self, plan: Plan, testbed: Testbed, order: Order) -> None:
        self.plan, self.testbed, self.order = plan, testbed, order
        self.known = requirements("1.1")
        self.rules = rules_on(
            {
                name
                for name, it in self.known.items()
                if plan.side in it.binds and plan.selection.takes(Item(name, RULE, "L0"))
            }
        )
        self.traffic = self._nothing_yet()
        self.trial_now: Trial | None = None
        self._latest = CheckAftermath(
            "introduction", MEETING, "", list(testbed.peer.entries), failed=False
        )
        """The check that ran last; at first, when the testee was met."""
        self._last_alive: dict[Channel, CheckAftermath] = {}
        """The last check in which the testee came to this channel: whatever takes it, does not
        show in those that follow, which may use the other alone.
        """
        self._note_alive(self._latest)
        self._last_verdict = Verdict.SKIP
        self._second_look = SecondLook(testbed.testee)
        self._began = (time.monotonic(), time.process_time())
        leave_nothing_where_the_user_works()
        self._keep(0, "introduction")
        if testbed.testee.ended() is not None:
            self._note_end()
            self.look_after()
        self._note_end()

    def pytest_collect_directory(self, path: Path, parent: pytest.Collector) -> pytest.Collector:
        """The modules of checks that hold one which was selected."""
        found = {
            Path(str(sys.modules[it.play.__module__].__file__))
            for it in checks_of(self.plan.side)
            if self._takes(it)
        }
        return Modules.of(parent, path, sorted(found))

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leave out what was not selected, and put the rest in order."""
        for item in items:
            if check := checks_in(item.function).get(self.plan.side):  # type: ignore[attr-defined]
                item.stash[CHECK] = check
        items[:] = [it for it in items if CHECK in it.stash and self._takes(declared(it))]
        for place, item in enumerate(items, 1):
            item.stash[PLACE] = place
        items[:] = self.order(items)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(
        self, item: pytest.Item, nextitem: pytest.Item | None
    ) -> Generator[None, object, object]:
        """Judge a check once more where others before it may have taken what it needs."""
        done = yield
        if self._second_look.why:
            self.testbed.testee.stop()
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=nextitem)
        return done

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Turn what happened into a result, and send it along with the report."""
        # What pytest makes of a failure holds what testees sent, which not every transport can
        # carry, and to look up the lines of source takes longer than most checks.
        item.repr_failure = lambda excinfo, style=None: ""  # type: ignore[method-assign]
        report = yield
        report.longrepr = None
        if call.when == "call" or (call.when == "setup" and call.excinfo is not None):
            result = self._result(item, call)
            self._last_verdict = result.verdict
            if not self._is_to_be_judged_again(result):
                report.user_properties.append((RESULT, (item.stash[PLACE], result)))
        elif call.when == "teardown":
            report.user_properties.append((TRAFFIC, self.traffic))
            self.traffic = self._nothing_yet()
        return report

    @pytest.fixture
    def trial(self, request: pytest.FixtureRequest) -> Iterator[Trial]:
        """A trial with fresh connections; the rules judge whatever crossed the wire."""
        check, testee = declared(request.node), self.testbed.testee
        self.trial_now = None
        if reason := self._missing(check):
            pytest.skip(reason)
        self._began = (time.monotonic(), time.process_time())
        self._second_look.begin()
        trial = self.trial_now = self.testbed.trial(self.known[check.requirement])
        trial.seed, trial.profile = self.plan.seed, self.plan.profile
        told = " ".join((request.function.__doc__ or "").split())
        trial.purpose = f"{check.requirement}: {told}"
        yield trial
        peer = self.testbed.peer
        peer.until(lambda: heard_out(peer), SETTLE_SECONDS)
        self.traffic.delivered += trial.delivered
        self.traffic.left_out += trial.left_out
        former, self._latest = self._latest, self._deed(check, request.node.name)
        for loss in trial.losses:
            here = self._latest._replace(entries=loss.entries)
            deed = self._last_alive.get(loss.before, former) if loss.before else here
            self._charge(deed, loss.what)
        self._note_alive(self._latest)
        if not trial.killed:
            self._note_end()
        self._keep(request.node.stash[PLACE], request.node.name)
        if self.plan.exitfirst and self._a_must_is_broken():
            request.session.shouldfail = "a MUST is broken"
        if testee.ended() is not None and trial.killed:
            trial.end_testee()
        elif self.plan.side == "server" or testee.ended() is not None:
            self.look_after()

    def look_after(self) -> None:
        """Look for the testee's vital signs; what it has lost is charged to the latest check, and
        one that the harness can start is started anew.
        """
        if lost := self.testbed.lost(briefly=self._latest.failed):
            self._charge(self._latest, lost)
        if lost or self.testbed.testee.ended() is not None:
            self.testbed.testee.stop()

    def _a_must_is_broken(self) -> bool:
        by_rule = (name for name, count in self.traffic.tally.items() if count.broken)
        musts = [name for name in by_rule if failing(self.known[name].level) is Verdict.FAIL]
        return bool(musts or self.traffic.losses) or self._last_verdict is Verdict.FAIL

    def _deed(self, check: Check, name: str) -> "CheckAftermath":
        script = self._script(check.requirement, name, by_rule=False)
        failed = self._last_verdict in (Verdict.FAIL, Verdict.WARN)
        return CheckAftermath(name, check, script, list(self.testbed.peer.entries), failed)

    def _note_alive(self, deed: "CheckAftermath") -> None:
        came = {entry.channel for entry in deed.entries if entry.event == "open"}
        self._last_alive |= dict.fromkeys(came, deed)

    def _charge(self, deed: "CheckAftermath", what: str) -> None:
        """A sign that was lost is the failure of the sentence that forbids it; where the check has
        failed already, that says it.
        """
        if deed.failed:
            return
        requirement = forbids_loss(self.plan.side, deed.entries)
        script = deed.script and as_text(replace(from_text(deed.script), requirement=requirement))
        loss = Result(
            requirement,
            deed.name,
            Level(deed.check.level),
            failing(self.known[requirement].level),
            f"after this check the {self.plan.side} is not what it was: {what}{self._last_words()}",
            tuple(excerpt(deed.entries, EVIDENCE_LINES)),
            script=script,
            code=LOST,
        )
        self.traffic.losses.append(loss)

    def _last_words(self) -> str:
        printed = self.testbed.testee.output().strip().splitlines()[-PRINTED_LINES:]
        return f"; the last that it printed: {' | '.join(printed)}" if printed else ""

    def _note_end(self) -> None:
        if ended := self.testbed.testee.ended():
            self.traffic.ended = f"the {self.plan.side} {ended}"
            self.traffic.printed = self.testbed.testee.output()

    def _nothing_yet(self) -> Traffic:
        facts = self.testbed.facts
        return Traffic(
            self.testbed.testee.name, facts.version(), facts.device, advice=list(facts.advice)
        )

    def _keep(self, place: int, name: str) -> None:
        """Judge what crossed the wire, count what it took, and save it where that is asked for."""
        entries = list(self.testbed.peer.entries)
        self.testbed.peer.close_all()  # what the testee does about it goes on during the judgement
        recorded = conversations(entries)
        on_record = self.testbed.peer.on_record
        lives = [(on_record(born), on_record(ended)) for born, ended in self.testbed.testee.lives]
        note_deaths(recorded, entries, self.testbed.peer.theirs, lives)
        seen = tally(recorded, self.plan.side, self.rules)
        add(self.traffic.tally, seen)
        latencies.add(self.traffic.latencies, latencies.of(recorded, self.plan.side))
        if self.trial_now is not None:
            broken = [requirement for requirement, count in seen.items() if count.broken]
            self.traffic.scripts |= {it: self._script(it, name, by_rule=True) for it in broken}
        busy = time.process_time() - self._began[1]
        self.traffic.busy_seconds += busy
        self.traffic.late_seconds = max(self.traffic.late_seconds, self.testbed.peer.late_seconds)
        self.traffic.waiting_seconds += max(0.0, time.monotonic() - self._began[0] - busy)
        if self.plan.record:
            save(entries, Path(self.plan.record, f"{place:03}-{name}.jsonl"))

    def _takes(self, check: Check) -> bool:
        return self.plan.selection.takes(selectable(check), self.plan.profile)

    def _missing(self, check: Check) -> str | None:
        if reason := check.lacks(self.testbed.facts):
            return reason
        if check.may_crash and not (self.testbed.testee.expendable or self.plan.allow_crash):
            return "it may crash a testee that was not launched by the harness: --allow-crash"
        return None

    def _result(self, item: pytest.Item, call: pytest.CallInfo[None]) -> Result:
        check, error = declared(item), call.excinfo
        measurements = tuple(self.trial_now.measurements) if self.trial_now else ()
        verdict, text = Verdict.PASS, "; ".join(map(str, measurements))
        delivered = self.trial_now.delivered if self.trial_now else 0
        if error is None and not delivered:
            verdict, text = Verdict.SKIP, NOTHING_PROVEN
        elif error is None and not text:
            text = f"{delivered} delivered; seen of each: {check.observable}"
        if error is None and self.trial_now:
            text += f"; {self.trial_now.extent}" if self.trial_now.extent else ""
            unseen = self.trial_now.unseen.items()
            text += "".join(f"; nothing is said of the {at} channel: {why}" for at, why in unseen)
        evidence: tuple[str, ...] = ()
        script = code = ""
        if error is not None:
            text = str(error.value)
            skipped = isinstance(error.value, pytest.skip.Exception)
            evidence = () if skipped else self._evidence(check.requirement)
            if isinstance(error.value, Violation):
                verdict, code = failing(self.known[check.requirement].level), error.value.code
                text += self._last_words() if self.testbed.testee.ended() else ""
                script = self._script(check.requirement, item.name, by_rule=False)
            elif skipped:
                verdict = Verdict.SKIP
            else:
                verdict, text = Verdict.ERROR, f"{error.typename}: {text}"
                lines = "".join(traceback.format_exception(error.value)).splitlines()
                evidence += tuple(lines[-EVIDENCE_LINES:])
        return Result(
            check.requirement,
            item.name,
            Level(check.level),
            verdict,
            text,
            evidence,
            call.duration,
            measurements,
            script,
            delivered=delivered,
            missed=verdict is Verdict.SKIP and self._came_late(),
            code=code,
        )

    def _is_to_be_judged_again(self, result: Result) -> bool:
        if self._second_look.why:
            if told := self._second_look.end(result):
                self.traffic.advice.append(told)
            return False
        return self.trial_now is not None and self._second_look.is_wanted(result)

    def _came_late(self) -> bool:
        """The testee has shown what the check needs, and may have been left too little time."""
        return self.trial_now is not None and self.testbed.peer.late_seconds >= LATE_SECONDS

    def _evidence(self, requirement: str) -> tuple[str, ...]:
        peer, since = self.testbed.peer, self.trial_now.before_last_case if self.trial_now else 0
        marks = guilty.marks(peer.entries, peer.ours, requirement, since)
        return tuple(excerpt(peer.entries, EVIDENCE_LINES, marks, peer.ours))

    def _script(self, requirement: str, check: str, *, by_rule: bool) -> str:
        assert self.trial_now is not None
        return as_text(
            Script(
                self.plan.side,
                requirement,
                check,
                by_rule,
                tuple(map(tuple, self.trial_now.went_through)),
                self.plan.profile,
                self.plan.viewport,
                self.plan.seed,
            )
        )


def heard_out(peer: Peer) -> bool:
    """The testee had the last word on every connection that is open: it understood what it got."""
    last = {(entry.channel, entry.conn): entry.dir for entry in peer.entries}
    alive = [it for it in peer.connections if it.open and not it.ended]
    return all(last[it.channel, it.number] == peer.theirs for it in alive)


def declared(item: pytest.Item) -> Check:
    """What a collected check is on the side that is judged."""
    return item.stash[CHECK]


def selectable(check: Check) -> Item:
    """A check as something to select."""
    return Item(check.requirement, check.name, check.level, check.profile)
