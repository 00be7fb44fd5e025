"""Sessions: steps in any order, made up by Hypothesis, made small, noted, and delivered again."""

import sys
from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import pytest
from splatbus_conformance.cases.script import Case, Script
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.checks.stateful import (
    BreachFound,
    Session,
    SessionBreach,
    SessionOver,
    Step,
)
from splatbus_conformance.checks.stateful.explore import (
    MOST_CUT_SHORT,
    Amount,
    go_through,
)
from splatbus_conformance.plan import Plan
from splatbus_conformance.run.replay import replay, worked_out
from splatbus_conformance.run.testbed import Testbed, set_up
from splatbus_conformance.trials.trial import NotObservable, Stand, Trial, Violation
from splatbus_schemas.requirements import requirements

from tests.zoo import mutants

JUDGED = "CHN-19"
MANY = Amount(200, 12)


class Vault:
    """A part whose testee breaks once it was opened, emptied, closed and opened again."""

    breaks = JUDGED

    def __init__(self) -> None:
        self.open, self.history = False, ""
        self.left = 0

    def begin(self) -> None:
        pass

    def choices(self, kind: str) -> Sequence[Step]:
        steps = {
            "knock": [("knock", times) for times in range(3)],
            "open": [("open",)] if not self.open else [],
            "empty": [("empty",)] if self.open else [],
            "close": [("close",)] if self.open else [],
        }
        return steps[kind]

    def take(self, step: Step) -> None:
        self.open = {"open": True, "close": False}.get(step[0], self.open)
        self.history += step[0][0] if step[0] != "knock" else ""
        if "oeco" in self.history:
            raise SessionBreach(self.breaks, "on-fire", "it is on fire")

    def settle(self) -> None:
        pass

    def leave(self) -> None:
        self.left += 1


KINDS = ("knock", "open", "empty", "close")
FIRE = [("open",), ("empty",), ("close",), ("open",)]


def trial(seed: int = 1) -> Trial:
    """A trial with nobody."""
    peer: Any = SimpleNamespace(clear=lambda: None, entries=[])
    testee: Any = SimpleNamespace(ended=lambda: None, stop=lambda: None, expendable=False)
    made = Trial(requirements("1.1")[JUDGED], Stand(peer, testee, 1.0))
    made.seed = seed
    return made


def explore(
    made: Trial, part: Callable[[], Any] = Vault, amount: Amount = MANY, **more: Any
) -> None:
    go_through(made, part, KINDS, quick=amount, full=amount, **more)


def test_a_step_that_may_not_come_now_is_left_out() -> None:
    session = Session(Vault(), JUDGED)
    for step in (("close",), ("open",), ("open",), ("knock", 7)):
        session.take(step)
    assert session.steps == [("open",)]


def test_what_is_found_tells_the_step_and_the_session() -> None:
    session = Session(Vault(), JUDGED)
    for step in FIRE[:3]:
        session.take(step)
    with pytest.raises(BreachFound) as caught:
        session.take(FIRE[3])
    said = "at step 4 (open), it is on fire; the session: open; empty; close; open"
    assert str(caught.value) == said


def test_another_requirement_s_breach_ends_the_session_and_its_connections() -> None:
    part = Vault()
    session = Session(part, "CHN-20")
    for step in (*FIRE, ("knock", 1)):
        session.take(step)
    session.end()
    assert session.other is not None
    assert session.other.requirement == JUDGED
    assert session.steps == FIRE
    assert part.left == 1


def test_a_session_ends_with_a_testee_that_may_end() -> None:
    class Leaves(Vault):
        def take(self, step: Step) -> None:
            raise SessionOver

        def settle(self) -> None:
            raise AssertionError("nobody is there any more")

    session = Session(Leaves(), JUDGED)
    session.take(("knock", 1))
    session.take(("knock", 2))
    session.end()
    assert session.steps == [("knock", 1)]
    assert session.other is None


def test_hypothesis_finds_the_session_and_it_is_made_small() -> None:
    made = trial()
    with pytest.raises(Violation, match="it is on fire"):
        explore(made)
    assert made.went_through == [[Case(True, FIRE)]]
    assert made.simpler[0](FIRE)


def test_the_same_seed_makes_up_the_same_sessions() -> None:
    rows = []
    for seed in (5, 5, 6):
        made = trial(seed)
        explore(made, amount=Amount(4, 3))
        rows.append(made.went_through)
    assert rows[0] == rows[1] != rows[2]
    assert all(isinstance(step, tuple) for case in rows[0][0] for step in case.value)


def test_a_script_is_delivered_and_nothing_else() -> None:
    made = trial()
    made.script = ((Case(True, FIRE[:3]),),)
    explore(made, kept=[FIRE])
    assert made.went_through == [[Case(True, FIRE[:3])]]
    made.script = ((Case(True, FIRE),),)
    made.went_through.clear()
    with pytest.raises(Violation, match="open; empty; close; open"):
        explore(made)


def test_kept_sessions_come_first_and_are_noted() -> None:
    made = trial()
    with pytest.raises(Violation):
        explore(made, kept=[FIRE[:2], FIRE])
    assert made.went_through == [[Case(True, FIRE[:2]), Case(True, FIRE)]]


def test_what_fails_once_only_keeps_all_that_came_before_it() -> None:
    sessions = 0

    class FailsOnce(Vault):
        def begin(self) -> None:
            nonlocal sessions
            sessions += 1

        def settle(self) -> None:
            if sessions == 3:
                raise SessionBreach(JUDGED, "once", "for once")

        def take(self, step: Step) -> None:
            pass

    made = trial()
    with pytest.raises(Violation, match="for once"):
        explore(made, FailsOnce)
    assert len(made.went_through[0]) == 3


def test_where_every_session_is_cut_short_nothing_is_said() -> None:
    begun = 0

    class BreaksAnother(Vault):
        def begin(self) -> None:
            nonlocal begun
            begun += 1
            raise SessionBreach("IMG-12", "not-released", "it was not released")

    with pytest.raises(NotObservable, match="IMG-12 was broken: it was not released"):
        explore(trial(), BreaksAnother)
    assert begun == MOST_CUT_SHORT


# With processes


@pytest.fixture
def testbed() -> Iterator[Testbed]:
    """Of a client that fails a session."""
    command = f'"{sys.executable}" -m {mutants.__name__} keeps-the-last-size-over-a-loss view'
    made = set_up(Plan("client", command, "127.0.0.1", (0, 0), (64, 48), 10.0))
    made.introduce()
    yield made
    made.close()


def test_a_session_that_fails_is_shown_again(testbed: Testbed) -> None:
    made = testbed.trial(requirements("1.1")["CHN-24"])
    found = (it for it in checks_of("client") if ".stateful." in it.play.__module__)
    check = next(it for it in found if it.requirement == "CHN-24")
    with pytest.raises(Violation, match="was answered with open_failed") as caught:
        check.play(made)
    cases = tuple(map(tuple, made.went_through))
    script = Script("client", "CHN-24", check.name, False, cases, seen=str(caught.value))
    assert "was answered with open_failed" in str(replay(testbed, script).broken)
    small = worked_out(testbed, script, 8.0)
    assert small.again == small.tried > 1
    (((drawn, steps),),) = small.cases
    assert drawn
    assert [step[0] for step in steps] == ["announce", "drop"]
