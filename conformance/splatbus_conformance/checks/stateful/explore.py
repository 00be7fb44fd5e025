"""Go through sessions: those that are kept, then those that Hypothesis makes up.

A session that breaks a requirement is made small against new testees, within a time limit; by delta
debugging, for Hypothesis removes choices, and where a step is possible only after others it needs
hundreds of tries. Every session is noted in the trial, so that a script shows it again.
"""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from hypothesis import HealthCheck, Phase, Verbosity, seed, settings
from hypothesis import strategies as st
from hypothesis.errors import Flaky
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule, run_state_machine_as_test

from splatbus_conformance.cases.script import Case
from splatbus_conformance.cases.shrinking import smallest, without_one
from splatbus_conformance.checks.stateful import BreachFound, Counterpart, Session, Step
from splatbus_conformance.trials.trial import Trial

EXPLORING_SECONDS = {False: 10.0, True: 40.0}
"""No session is begun after so long; a testee that is quick comes to the end long before."""
SHRINKING_SECONDS = {False: 10.0, True: 30.0}
MOST_CUT_SHORT = 2
"""Sessions that end because they broke another requirement, before the check gives up."""


class Amount(NamedTuple):
    """How many sessions Hypothesis makes up, and the most steps of one."""

    sessions: int
    steps: int


class _OutOfTime(BaseException):
    """Ends a search at once: Hypothesis takes every Exception for a failure to be made smaller."""


def go_through(
    trial: Trial,
    part: Callable[[], Counterpart],
    kinds: Sequence[str],
    *,
    kept: Sequence[Sequence[Step]] = (),
    quick: Amount,
    full: Amount,
) -> None:
    """Judge the trial's requirement by sessions of these kinds of step.

    Args:
        trial: in whose script the sessions are noted; its seed makes up the same sessions.
        part: makes the other side of each session.
        kinds: of the steps that Hypothesis chooses from, the simplest first.
        kept: sessions that come first, each time.
        quick: how much to make up in the quick profile.
        full: how much in the full one.
    """
    search = _Search(trial, part)
    none: tuple[list[Step], ...] = ()
    for case in trial.each(none, simpler=without_one):
        search.deliver(case)
    if trial.script is None:
        for steps in kept:
            search.deliver(steps)
        search.explore(kinds, full if trial.thorough else quick)
    if search.other and not trial.delivered:
        trial.not_observable(f"each session was cut short: {search.other[-1]}")


class _Search:
    """Sessions with one testee, one after the other."""

    def __init__(self, trial: Trial, part: Callable[[], Counterpart]) -> None:
        self.other: list[str] = []
        """What cut sessions short."""
        self._trial, self._part = trial, part
        self._found: list[BreachFound] = []
        self._until = time.monotonic() + EXPLORING_SECONDS[trial.thorough]

    def deliver(self, steps: Sequence[Step]) -> None:
        """Take these steps with the testee."""
        if found := self._fails_by(steps):
            self._trial.violated(found.code, str(found))

    def begin(self) -> Session:
        """A new session, which is noted; with a new testee while a failure is made smaller."""
        steps: list[Step] = []
        if self._found:
            self._trial.end_testee()
        elif self._trial.script is None:
            self._trial.note(steps)
        return Session(self._part(), self._trial.requirement.id, steps)

    def done(self, session: Session) -> None:
        """Count a session that broke nothing that is judged."""
        if self._found:
            return
        if session.other is None:
            self._trial.delivered += 1
        else:
            self.other.append(f"{session.other.requirement} was broken: {session.other}")

    def explore(self, kinds: Sequence[str], amount: Amount) -> None:
        """Let Hypothesis make up sessions; the smallest that fails is the violation."""
        chosen = settings(
            max_examples=self._trial.share(amount.sessions),
            stateful_step_count=amount.steps,
            database=None,
            deadline=None,
            derandomize=False,
            print_blob=False,
            report_multiple_bugs=False,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
            verbosity=Verbosity.quiet,
        )
        with contextlib.suppress(BreachFound, Flaky, _OutOfTime):
            run_state_machine_as_test(self._machine(kinds), settings=chosen)
        if self._found:
            smallest(self._shortest().steps, self._fails_too, self._in_time)
            shortest = self._shortest()
            if len(self._found) > 1:
                # It failed with new testees too: what came before it has no part in it.
                self._trial.went_through[-1][:] = [Case(True, list(shortest.steps))]
            self._trial.violated(shortest.code, str(shortest))

    def _fails_by(self, steps: Sequence[Step]) -> BreachFound | None:
        try:
            session = self.begin()
            for step in steps:
                session.take(step)
            session.end()
        except BreachFound as found:
            return found
        self.done(session)
        return None

    def _fails_too(self, steps: Sequence[Step]) -> bool:
        if found := self._fails_by(steps):
            self._found.append(found)
        return found is not None

    def _shortest(self) -> BreachFound:
        return min(reversed(self._found), key=lambda found: len(found.steps))

    def _in_time(self) -> bool:
        return time.monotonic() < self._until

    def _machine(self, kinds: Sequence[str]) -> type[RuleBasedStateMachine]:
        search = self

        def take(session: Session, step: Step) -> None:
            with search.noting():
                session.take(step)

        def init(self: Any) -> None:
            RuleBasedStateMachine.__init__(self)
            search.stop_in_time()
            with search.noting():
                self.session = search.begin()

        def teardown(self: Any) -> None:
            with search.noting():
                self.session.end()
            search.done(self.session)

        members = {kind: _rule(kind, take) for kind in kinds}
        machine = type(
            "Sessions",
            (RuleBasedStateMachine,),
            {"__init__": init, "teardown": teardown, **members},
        )
        return seed(self._trial.seed)(machine)

    @contextlib.contextmanager
    def noting(self) -> Iterator[None]:
        """The first failure ends the search for others, and begins that for a smaller one."""
        try:
            yield
        except BreachFound as found:
            if not self._found:
                self._until = time.monotonic() + SHRINKING_SECONDS[self._trial.thorough]
            self._found.append(found)
            raise

    def stop_in_time(self) -> None:
        """Raises _OutOfTime once no further session is to begin."""
        if not self._in_time() or len(self.other) >= MOST_CUT_SHORT:
            raise _OutOfTime


def _rule(kind: str, take: Callable[[Session, Step], None]) -> Any:
    """A rule for one kind of step, that chooses among those that may come next."""
    choices = st.runner().flatmap(lambda machine: st.sampled_from(machine.session.choices(kind)))

    def chosen(self: Any, step: Step) -> None:
        take(self.session, step)

    chosen.__name__ = kind
    applies = precondition(lambda self: len(self.session.choices(kind)) > 0)
    return applies(rule(step=choices)(chosen))
