"""Deliver scripts: confirm a failure, make it small, and show it again."""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from splatbus_schemas.requirements import requirements

from splatbus_conformance.cases.script import Case, Script, ScriptError, flat, rows
from splatbus_conformance.cases.shrinking import simplest, smallest
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.rules import LOST, Breach, Sighting, guilty, sightings
from splatbus_conformance.run.testbed import Testbed
from splatbus_conformance.trials.trial import SETTLE_SECONDS, NotObservable, Trial, Violation
from splatbus_conformance.wire.transcript import excerpt

CONFIRMATIONS = 2
"""How often in a row a smaller script has to fail before it takes the place of a larger one."""
TRIES = 3
"""How often a script is delivered again of which not every delivery shows the failure."""
TRANSCRIPT_LINES = 24
LISTEN_SECONDS = 1.0
"""How long a testee may take to break again what a rule reads."""
GLANCE_SECONDS = 0.1

Pair = tuple[int, Case]


class Replay(NamedTuple):
    """What came of delivering a script once."""

    broken: Breach | None
    """What the testee did that is not accepted; None if it did nothing of the kind."""
    skipped: str
    """Why nothing can be said, if nothing can."""
    trial: Trial
    transcript: tuple[str, ...]


def replay(testbed: Testbed, script: Script) -> Replay:
    """Deliver a script to a new testee, where the harness can start one.

    Raises ScriptError if it names no check.
    """
    check = next((f for f in checks_of(script.side) if f.name == script.check), None)
    if check is None:
        raise ScriptError(f"there is no check {script.check} of a {script.side} any more")
    trial = testbed.trial(requirements("1.1")[check.requirement])
    trial.end_testee()
    trial.profile, trial.script, trial.seed = script.profile, script.cases, script.seed
    broken: Breach | None = None
    skipped = ""
    try:
        check.play(trial)
    except Violation as violation:
        broken = Breach(violation.code, str(violation))
    except NotObservable as skip:
        skipped = str(skip)
    trial.rest(SETTLE_SECONDS)
    if script.requirement != check.requirement and not script.by_rule:
        entries = list(testbed.peer.entries)
        lost = testbed.lost(briefly=False)
        broken = Breach(LOST, lost) if lost else None
        return Replay(broken, skipped, trial, tuple(excerpt(entries, TRANSCRIPT_LINES)))
    peer = testbed.peer
    if script.by_rule:
        breach = _breach(script, trial)
        broken = breach.breach if breach else None
        entries = [it for it in peer.entries if not breach or it.t <= breach.t]
        marks = [it for it in [guilty.mark(breach) if breach else None] if it]
    else:
        entries = peer.entries
        marks = guilty.marks(entries, peer.ours, script.requirement, trial.before_last_case)
    shown = excerpt(entries, TRANSCRIPT_LINES, marks, peer.ours)
    return Replay(broken, skipped, trial, tuple(shown))


def _breach(script: Script, trial: Trial) -> Sighting | None:
    """What a rule sees. After a check a testee may need a moment, to send its first pose say."""
    deadline = time.monotonic() + LISTEN_SECONDS
    while True:
        found = (it for it in sightings(list(trial.peer.entries)) if it.peer == script.side)
        broken = (it for it in found if it.breach and it.requirement == script.requirement)
        breach = next(broken, None)
        if breach or time.monotonic() >= deadline:
            return breach
        trial.rest(GLANCE_SECONDS)


def counted(script: Script, given: Replay) -> Script:
    """The script with a delivery more on its count, and what was seen in that if it showed the
    failure.
    """
    script = replace(script, tried=script.tried + 1)
    if given.broken is None:
        return script
    return replace(
        script, again=script.again + 1, seen=str(given.broken), transcript=given.transcript
    )


def worked_out(testbed: Testbed, script: Script, seconds: float) -> Script:
    """The smallest script found within so many seconds that breaks the same sentence.

    A smaller one counts once it has failed twice of two, each time with a new testee. Among many
    that are tried chance finds one that fails twice, so it is delivered once more at the end. What
    does not fail each time is only delivered again, and stays as it is.
    """
    until = time.monotonic() + seconds

    def in_time() -> bool:
        return time.monotonic() < until

    given = replay(testbed, script)
    script = best = counted(script, given)
    while script.again < script.tried < TRIES and in_time():
        script = counted(script, replay(testbed, script))
    if script.again < script.tried:
        return script
    simpler = given.trial.simpler

    def fails(pairs: Sequence[Pair]) -> bool:
        nonlocal best
        smaller = replace(script, cases=rows(pairs, len(script.cases)), tried=0, again=0)
        while smaller.tried < CONFIRMATIONS:
            smaller = counted(smaller, replay(testbed, smaller))
            if smaller.again < smaller.tried:
                return False
        best = smaller
        return True

    kept = smallest(flat(script.cases), fails, in_time)

    def fails_with(place: int, pair: Pair) -> bool:
        return fails([*kept[:place], pair, *kept[place + 1 :]])

    for place, (row, case) in enumerate(kept):
        if case.drawn and row < len(simpler):
            kept[place] = simplest(
                kept[place],
                lambda pair: (
                    (pair[0], Case(True, value)) for value in simpler[pair[0]](pair[1].value)
                ),
                partial(fails_with, place),
                in_time,
            )
    return counted(best, replay(testbed, best))
