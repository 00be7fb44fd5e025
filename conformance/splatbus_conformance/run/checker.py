"""How a check is called, judged and told: each gets a trial, and comes to a result.

The rules judge all that crossed the wire meanwhile, and afterwards the testee has to be sound.
"""

import time
import traceback
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from splatbus_schemas.requirements import requirements

from splatbus_conformance.cases.drawing import leave_nothing_where_the_user_works
from splatbus_conformance.cases.script import Script, as_text, from_text
from splatbus_conformance.checks import Check
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.images.pictures import Picture
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
from splatbus_conformance.trials.trial import SETTLE_SECONDS, NotObservable, Trial, Violation
from splatbus_conformance.verdicts import BROKEN, Level, Result, Verdict, failing
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
PLACES = {
    "ipc": "the ipc channel",
    "msg": "the msg channel",
    "host": "memory of the host",
    "device": "memory of the device",
    "calls": "the calls for memory of the device",
}
NOTHING_PROVEN = "nothing was delivered that the testee was seen to take"
MAY_CRASH = "it may crash a testee that was not launched by the harness: --allow-crash"


class Told(NamedTuple):
    """What came of a check, in whichever process it ran."""

    place: int
    """Among those that the plan selects."""
    result: Result
    traffic: Traffic

    @property
    def breaks_a_must(self) -> bool:
        """Whether it has shown that the testee breaks one."""
        known = requirements("1.1")
        by_rule = (name for name, count in self.traffic.tally.items() if count.broken)
        musts = [name for name in by_rule if failing(known[name].level) is Verdict.FAIL]
        return bool(musts or self.traffic.losses) or self.result.verdict is Verdict.FAIL


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


MEETING = Check("CHN-19", {None: ()}, False, "quick")
"""The first meeting, as if it were a check."""


class Checker:
    """Runs checks on a stand whose testee has been met."""

    def __init__(self, plan: Plan, testbed: Testbed) -> None:
        self.plan, self.testbed = plan, testbed
        self.places = {it.name: place for place, it in enumerate(selected(plan), 1)}
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

    def run(self, check: Check) -> Told:
        """Judge the testee by a check: once more, where others before it may have taken what it
        needs, or a busy machine kept it waiting.
        """
        result, again = self._judged(check)
        if again:
            if result.verdict not in BROKEN:
                self.testbed.testee.stop()
            first, (result, _) = result, self._judged(check)
            if told := self._second_look.end(first, result):
                self.traffic.advice.append(told)
        traffic, self.traffic = self.traffic, self._nothing_yet()
        return Told(self.places[check.name], result, traffic)

    def _judged(self, check: Check) -> tuple[Result, bool]:
        """What came of it, and whether a testee started anew may show more."""
        self.trial_now = None
        try:
            result = self._played(check)
            kept = self.testbed.peer.kept_seconds()
        except KeyboardInterrupt:
            if self.trial_now is not None:
                self._keep(self.places[check.name], check.name)
            raise
        self._last_verdict = result.verdict
        if self.trial_now is None:
            return result, False
        again = self._second_look.is_wanted(result, kept)
        try:
            self._see_to(check, self.trial_now)
        except Exception as error:
            if result.verdict in BROKEN:  # which is no less broken for what came of it
                return result, False
            return replace(result, verdict=Verdict.ERROR, text=_of_ours(error)), False
        return result, again

    def _played(self, check: Check) -> Result:
        began, code, script = time.monotonic(), "", ""
        evidence: tuple[str, ...] = ()
        shown: tuple[Picture, ...] = ()
        try:
            trial = self._trial(check)
            check.play(trial)
            verdict, text = _passed(trial)
        except NotObservable as nothing:
            verdict, text = Verdict.SKIP, str(nothing)
        except Violation as broken:
            verdict, code = failing(self.known[check.requirement].level), broken.code
            text = str(broken) + (self._last_words() if self.testbed.testee.ended() else "")
            evidence = self._evidence(check.requirement)
            script = self._script(check.requirement, check.name, by_rule=False)
            shown = self.trial_now.pictures() if self.trial_now else ()
        except Exception as error:
            verdict, text = Verdict.ERROR, _of_ours(error)
            lines = "".join(traceback.format_exception(error)).splitlines()
            evidence = (*self._evidence(check.requirement), *lines[-EVIDENCE_LINES:])
        seconds, now = time.monotonic() - began, self.trial_now
        late = self.testbed.peer.late_seconds >= LATE_SECONDS
        return Result(
            check.requirement,
            check.name,
            Level(check.level),
            verdict,
            text,
            evidence,
            seconds,
            tuple(now.measurements) if now else (),
            script,
            delivered=now.delivered if now else 0,
            missed=verdict is Verdict.SKIP and now is not None and late,
            code=code,
            pictures=shown,
        )

    def _trial(self, check: Check) -> Trial:
        """One with fresh connections."""
        if reason := check.lacks(self.testbed.facts):
            raise NotObservable(reason)
        if check.may_crash and not (self.testbed.testee.expendable or self.plan.allow_crash):
            raise NotObservable(MAY_CRASH)
        self._began = (time.monotonic(), time.process_time())
        self._second_look.begin()
        trial = self.trial_now = self.testbed.trial(self.known[check.requirement])
        trial.seed, trial.profile = self.plan.seed, self.plan.profile
        trial.purpose = f"{check.requirement}: {check.does}"
        return trial

    def _see_to(self, check: Check, trial: Trial) -> None:
        """What follows a check: its traffic is judged, and what the testee has lost is charged."""
        testee, peer = self.testbed.testee, self.testbed.peer
        peer.until(lambda: heard_out(peer), SETTLE_SECONDS)
        self.traffic.delivered += trial.delivered
        self.traffic.left_out += trial.left_out
        former, self._latest = self._latest, self._deed(check)
        for loss in trial.losses:
            here = self._latest._replace(entries=loss.entries)
            deed = self._last_alive.get(loss.before, former) if loss.before else here
            self._charge(deed, loss.what)
        self._note_alive(self._latest)
        if not trial.killed:
            self._note_end()
        self._keep(self.places[check.name], check.name)
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

    def _deed(self, check: Check) -> "CheckAftermath":
        script = self._script(check.requirement, check.name, by_rule=False)
        failed = self._last_verdict in BROKEN
        return CheckAftermath(check.name, check, script, list(self.testbed.peer.entries), failed)

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
        recorded = self.testbed.peer.conversations()
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


def selected(plan: Plan) -> list[Check]:
    """The checks that a plan selects, clause by clause."""
    every = checks_of(plan.side)
    return [it for it in every if plan.selection.takes(selectable(it), plan.profile)]


def selectable(check: Check) -> Item:
    """A check as something to select."""
    return Item(check.requirement, check.name, check.level, check.profile)


def _passed(trial: Trial) -> tuple[Verdict, str]:
    """What to say of a check that saw nothing broken."""
    text = "; ".join(map(str, trial.measurements))
    if not trial.delivered:
        text = NOTHING_PROVEN
    elif not text:
        text = f"{trial.delivered} delivered"
    text += f"; {trial.extent}" if trial.extent else ""
    unseen = trial.unseen.items()
    text += "".join(f"; nothing is said of {PLACES[at]}: {why}" for at, why in unseen if at)
    return Verdict.PASS if trial.delivered else Verdict.SKIP, text


def _of_ours(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
