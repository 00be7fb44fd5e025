"""What is done about failures: how often each was seen again is said as it was, and none is lost.

In place of a stand that starts testees there is one whose deliveries take a second each and fail as
they are told.
"""

import shlex
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from itertools import cycle
from pathlib import Path
from types import SimpleNamespace

import pytest
from splatbus_conformance.cases.script import Case, Script, as_text, load
from splatbus_conformance.cli.arguments import plan_of
from splatbus_conformance.cli.parsing import parser
from splatbus_conformance.plan import SIDES, NoVerdict, Plan
from splatbus_conformance.run import failures, replay
from splatbus_conformance.run.failures import work_out
from splatbus_conformance.run.options import as_options
from splatbus_conformance.selection import Selection
from splatbus_conformance.verdicts import Level, Result, Verdict

PLAN = Plan("client", "./my-viewer", "127.0.0.1", (0, 0), (64, 48), 10.0)
Fails = Callable[[str, tuple[Case, ...]], bool]


def failure(requirement: str, *cases: int, verdict: Verdict = Verdict.FAIL) -> Result:
    row = tuple(Case(False, number) for number in cases)
    script = Script("client", requirement, "check_it", False, (row,))
    return Result(requirement, "check_it", Level.WIRE, verdict, "first", script=as_text(script))


class Desk:
    """Where scripts are delivered; the clock goes on by a second for each."""

    def __init__(self, fails: Fails) -> None:
        self.fails = fails
        self.now = 0.0
        self.delivered: list[tuple[str, int]] = []
        """The requirement, and how many cases."""

    def replay(self, testbed: object, script: Script) -> replay.Replay:
        self.now += 1
        (row,) = script.cases
        self.delivered.append((script.requirement, len(row)))
        broken = "again" if self.fails(script.requirement, row) else None
        trial = SimpleNamespace(simpler=[])
        return replay.Replay(broken, "", trial, ("bytes",))  # type: ignore[arg-type]


@pytest.fixture
def desk(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    made = Desk(request.param)
    clock = SimpleNamespace(monotonic=lambda: made.now)
    for module in (failures, replay):
        monkeypatch.setattr(module, "replay", made.replay)
        monkeypatch.setattr(module, "time", clock)
    testbed = SimpleNamespace(introduce=lambda: None, close=lambda: None)
    monkeypatch.setattr(failures, "set_up", lambda plan: testbed)
    return made


def told(folder: Path, *results: Result, seconds: float = 1000.0, plan: Plan = PLAN) -> list[str]:
    given = work_out(plan, results, folder, seconds, lambda text: None)
    assert [it.verdict for it in given] == [it.verdict for it in results]
    return [it.smallest for it in given]


def always(requirement: str, row: tuple[Case, ...]) -> bool:
    return True


def never(requirement: str, row: tuple[Case, ...]) -> bool:
    return False


@pytest.mark.parametrize("desk", [always], indirect=True)
def test_each_is_seen_again_before_any_is_made_small(desk: Desk, tmp_path: Path) -> None:
    said = told(tmp_path, failure("FRM-1", 1, 2, 3), failure("FRM-3", 4), seconds=3.0)
    assert desk.delivered[:2] == [("FRM-1", 3), ("FRM-3", 1)]
    assert all("tried" in it and "not tried" not in it for it in said)


@pytest.mark.parametrize("desk", [always], indirect=True)
def test_what_time_did_not_reach_is_not_said_to_be_gone(desk: Desk, tmp_path: Path) -> None:
    said = told(tmp_path, *(failure(f"FRM-{n}", 1, 2) for n in (1, 2, 3)), seconds=2.0)
    assert said == [
        "2 cases; tried once more, seen 1",
        "2 cases; tried once more, seen 1",
        "2 cases; not tried again: --shrink's time was up",
    ]


@pytest.mark.parametrize("desk", [never], indirect=True)
def test_what_is_not_seen_again_was_tried_so_often_and_stays_a_failure(
    desk: Desk, tmp_path: Path
) -> None:
    assert told(tmp_path, failure("FRM-1", 1)) == ["one case; tried 3 times more, seen no more"]
    script = load(tmp_path / "FRM-1-it.json")
    assert (script.tried, script.again, script.seen) == (3, 0, "first")


NOW_AND_THEN = cycle([True, False, True])


@pytest.mark.parametrize("desk", [lambda *_: next(NOW_AND_THEN)], indirect=True)
def test_what_is_seen_now_and_then_says_how_often(desk: Desk, tmp_path: Path) -> None:
    assert told(tmp_path, failure("FRM-1", 1, 2)) == ["2 cases; tried 3 times more, seen 2"]


@pytest.mark.parametrize("desk", [lambda it, row: Case(False, 7) in row], indirect=True)
def test_a_smaller_one_is_counted_by_itself(desk: Desk, tmp_path: Path) -> None:
    [said] = told(tmp_path, failure("FRM-1", *range(9)))
    assert said == "one case; tried 3 times more, seen 3"
    assert desk.delivered[-1] == ("FRM-1", 1)


@pytest.mark.parametrize("desk", [always], indirect=True)
@pytest.mark.parametrize(
    ("seconds", "plan", "why"),
    [
        (0.0, PLAN, "--shrink 0 leaves no time"),
        (9.0, replace(PLAN, launch=None, ports=(6001, 6000)), "the harness does not start it"),
    ],
)
def test_what_is_never_tried_says_why(
    desk: Desk, seconds: float, plan: Plan, why: str, tmp_path: Path
) -> None:
    said = told(tmp_path, failure("FRM-1", 1), seconds=seconds, plan=plan)
    assert said == [f"one case; not tried again: {why}"]
    assert desk.delivered == []


@pytest.mark.parametrize("error", [NoVerdict("gone"), KeyboardInterrupt(), ValueError("a fault")])
def test_verdicts_survive_what_goes_wrong_afterwards(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails() -> None:
        raise error

    testbed = SimpleNamespace(introduce=fails, close=lambda: None)
    monkeypatch.setattr(failures, "set_up", lambda plan: testbed)
    [said] = told(tmp_path, failure("FRM-1", 1))
    assert "not tried again: " in said


HOW_IT_IS_MET: dict[str, object] = {
    "host": "0.0.0.0",
    "ports": (7001, 7000),
    "viewport": (1920, 1080),
    "patience": 61.5,
    "stand_in_cuda": True,
}
BY_WHAT = {"launch": None, "adapter": "python 'my adapter.py'"}
NOT_HOW = {
    "side": "server",
    "profile": "full",
    "seed": 3,
    "selection": Selection(("FRM",)),
    "allow_crash": True,
    "parallel": 4,
    "within": 60.0,
    "exitfirst": True,
    "record": "sessions",
}
"""What a script says itself, or what a replay has no use for."""


def test_each_member_of_a_plan_is_told_again_or_known_to_be_needless() -> None:
    known = {*HOW_IT_IS_MET, *BY_WHAT, *NOT_HOW}
    assert known == {field.name for field in fields(Plan)}


@pytest.mark.parametrize("name", HOW_IT_IS_MET)
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("launched", [True, False])
def test_options_meet_the_same_testee(name: str, side: str, launched: bool) -> None:
    if (name == "stand_in_cuda" and not launched) or (name == "viewport" and side == "server"):
        return
    how = ["--launch", "./my-viewer 'a b'"] if launched else []
    how = how or (["--wait"] if side == "client" else ["--connect"])
    usual = plan_of(side, parser().parse_args([side, *how]))  # type: ignore[arg-type]
    plan = replace(usual, **{name: HOW_IT_IS_MET[name]})  # type: ignore[arg-type]
    for it in (usual, plan):
        line = shlex.split(shlex.join(as_options(it)))
        again = plan_of(it.side, parser().parse_args([it.side, *line]))
        assert replace(again, parallel=it.parallel) == it
    assert as_options(usual) == how
    for other, value in NOT_HOW.items():
        if other not in ("side", "parallel"):
            assert as_options(replace(plan, **{other: value})) == as_options(plan)  # type: ignore[arg-type]


def test_an_adapter_is_started_again() -> None:
    options = as_options(replace(PLAN, **BY_WHAT))  # type: ignore[arg-type]
    assert options == ["--adapter", "python 'my adapter.py'"]


def test_the_line_that_is_printed_has_all_of_it(tmp_path: Path) -> None:
    plan = replace(PLAN, ports=(7001, 7000), patience=60.0, host="0.0.0.0")
    [given] = work_out(plan, [failure("FRM-1", 1)], tmp_path, 0.0, lambda text: None)
    path = tmp_path / "FRM-1-it.json"
    assert given.replay == (
        f"splatbus-conformance replay {path} --launch ./my-viewer"
        " --host 0.0.0.0 --ports 7001,7000 --patience 60"
    )
