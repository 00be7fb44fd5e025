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
    in_words,
)
from splatbus_conformance.checks.stateful.explore import (
    MOST_CUT_SHORT,
    Amount,
    go_through,
)
from splatbus_conformance.checks.stateful.scripted_clients import VIEWPORT, Asker, Reader
from splatbus_conformance.plan import Plan, Side
from splatbus_conformance.run.replay import replay, worked_out
from splatbus_conformance.run.testbed import Testbed, set_up
from splatbus_conformance.trials.trial import NotObservable, Stand, Trial, Violation
from splatbus_schemas.requirements import requirements

from tests.zoo import mutants
from tests.zoo.judge import PROGRAMS, USUAL

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


# What is known of the clients in a session with a server


def asker(*asked: int) -> Asker:
    connection: Any = None
    return Asker(0, connection, list(asked))


CAMERA = {"position": [1, 2, 3], "rotation": [0, 0, 0, 1]}
OTHER = {"position": [3, 2, 1], "rotation": [0, 0, 0, 1]}
SIZE = {"viewport_size": [64, 48]}


def test_replies_are_told_by_kind_camera_and_number() -> None:
    cameras = (CAMERA, OTHER)
    client = asker(VIEWPORT, 0, 1)
    assert client.wrong([], cameras) is None
    assert client.wrong([SIZE, CAMERA | {"type": "camera"}, OTHER], cameras) is None
    wrong = client.wrong([SIZE, OTHER], cameras)
    assert str(wrong) == "reply 2 to message client 0 answers another request"
    assert client.wrong([CAMERA], cameras) is not None
    assert "4 replies to 3" in str(client.wrong([SIZE, CAMERA, OTHER, SIZE], cameras))


@pytest.mark.parametrize("camera", [None, {}, {"position": []}, {"position": ["far"]}])
def test_a_frame_without_a_camera_shows_none(camera: Any) -> None:
    connection: Any = None
    reader = Reader(0, connection)
    reader.show({"camera": {"position": [0.5, 0, 0]}})
    assert reader.camera == 0.5
    reader.show({"camera": camera})
    assert (reader.frames, reader.camera) == (2, None)


# With processes


@pytest.fixture
def testbed(request: pytest.FixtureRequest) -> Iterator[Testbed]:
    """Of one of the reference pair, or one of its mutants."""
    side, name = request.param
    module = f"{mutants.__name__} {name}" if name else PROGRAMS[side]
    command = f'"{sys.executable}" -m {module} {USUAL[side]}'
    made = set_up(Plan(side, command, "127.0.0.1", (0, 0), (64, 48), 10.0))
    made.introduce()
    yield made
    made.close()


def of_sessions(side: Side, requirement: str) -> Any:
    """The check by sessions of this requirement."""
    found = (f for f in checks_of(side) if ".stateful." in f.play.__module__)
    return next(f for f in found if f.requirement == requirement)


def run(testbed: Testbed, side: Side, requirement: str) -> Trial:
    """Run the check by sessions of this requirement."""
    made = testbed.trial(requirements("1.1")[requirement])
    of_sessions(side, requirement).play(made)
    return made


@pytest.mark.parametrize("testbed", [("server", "")], indirect=True)
def test_the_reference_server_serves_in_any_session(testbed: Testbed) -> None:
    for requirement in ("CHN-14", "REQ-7", "POS-11", "IMG-2", "IMG-17"):
        made = run(testbed, "server", requirement)
        assert made.delivered == len(made.went_through[0]) > 1


@pytest.mark.parametrize("testbed", [("client", "")], indirect=True)
def test_the_reference_client_survives_any_session(testbed: Testbed) -> None:
    made = run(testbed, "client", "CHN-19")
    assert made.delivered == len(made.went_through[0]) > 1


@pytest.mark.parametrize("testbed", [("client", "keeps-the-last-size-over-a-loss")], indirect=True)
def test_a_session_that_fails_is_shown_again(testbed: Testbed) -> None:
    made = testbed.trial(requirements("1.1")["CHN-24"])
    check = of_sessions("client", "CHN-24")
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


def test_a_session_in_words() -> None:
    assert in_words([("drop", "ipc", "reset"), ("lend",)]) == "drop ipc reset; lend"
    assert in_words([]) == "no step"
