"""What is done about failures: how often each was seen again is said as it was, and none is lost.

In place of a stand that starts testees there is one whose deliveries take a second each and fail as
they are told.
"""

import shlex
from collections.abc import Callable
from dataclasses import fields, replace
from itertools import cycle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from splatbus_conformance.cases.script import Case, Script, as_text, load
from splatbus_conformance.cli.arguments import plan_of
from splatbus_conformance.cli.parsing import parser
from splatbus_conformance.plan import SIDES, NoVerdict, Plan, Side
from splatbus_conformance.run import failures, replay
from splatbus_conformance.run.failures import work_out
from splatbus_conformance.run.options import as_options
from splatbus_conformance.selection import Selection
from splatbus_conformance.verdicts import Level, Result, Verdict

PLAN = Plan("client", "./my-viewer", "127.0.0.1", (0, 0), (64, 48), 10.0)
WAITED = replace(PLAN, launch=None, ports=(6001, 6000))
Fails = Callable[[tuple[Case, ...]], bool]


def always(row: tuple[Case, ...]) -> bool:
    return True


def never(row: tuple[Case, ...]) -> bool:
    return False


def now_and_then() -> Fails:
    order = cycle([True, False, True])
    return lambda row: next(order)


def with_a_7(row: tuple[Case, ...]) -> bool:
    return Case(False, 7) in row


def failure(number: int, cases: int) -> Result:
    row = tuple(Case(False, number) for number in range(cases))
    script = Script("client", f"FRM-{number}", "check_it", False, (row,))
    text = as_text(script)
    return Result(f"FRM-{number}", "check_it", Level.WIRE, Verdict.FAIL, "first", script=text)


def told(
    monkeypatch: pytest.MonkeyPatch,
    folder: Path,
    fails: Fails | BaseException,
    cases: list[int],
    seconds: float = 1000.0,
    plan: Plan = PLAN,
    busy: str = "",
) -> tuple[list[Result], list[tuple[str, int]]]:
    """What comes of failures with so many cases each, and the scripts that were delivered: the
    requirement, and how many cases.
    """
    delivered: list[tuple[str, int]] = []

    def deliver(testbed: object, script: Script) -> replay.Replay:
        (row,) = script.cases
        delivered.append((script.requirement, len(row)))
        assert not isinstance(fails, BaseException)
        broken: Any = "again" if fails(row) else None
        trial: Any = SimpleNamespace(simpler=[])
        return replay.Replay(broken, "", trial, ("bytes",))

    def introduce() -> None:
        if isinstance(fails, BaseException):
            raise fails

    clock = SimpleNamespace(monotonic=lambda: float(len(delivered)))
    for module in (failures, replay):
        monkeypatch.setattr(module, "replay", deliver)
        monkeypatch.setattr(module, "time", clock)
    testbed = SimpleNamespace(introduce=introduce, close=lambda: None)
    monkeypatch.setattr(failures, "set_up", lambda plan: testbed)
    results = [failure(number, count) for number, count in enumerate(cases, 1)]
    found = work_out(plan, results, folder, seconds, lambda text: None, busy)
    assert [it.verdict for it in found] == [Verdict.FAIL] * len(cases)
    return found, delivered


@pytest.mark.parametrize(
    ("fails", "cases", "more", "said"),
    [
        (
            *(always, [3, 1], {"seconds": 3.0}),
            ["3 cases; tried again 3 times, seen 3 times", "one case; tried again once, seen once"],
        ),
        (
            *(always, [2, 2, 2], {"seconds": 2.0}),
            ["2 cases; tried again once, seen once"] * 2
            + ["2 cases; not tried again: --shrink's time was up"],
        ),
        (never, [1], {}, ["one case; tried again 3 times, seen never"]),
        (
            *(never, [1], {"busy": "It was late"}),
            [
                "one case; tried again 3 times, seen never. "
                "It was late: judge it again on a quieter one"
            ],
        ),
        (always, [1], {"busy": "It was late"}, ["one case; tried again 3 times, seen 3 times"]),
        (now_and_then(), [2], {}, ["2 cases; tried again 3 times, seen 2 times"]),
        (with_a_7, [9], {}, ["one case; tried again 3 times, seen 3 times"]),
        (always, [1], {"seconds": 0.0}, ["one case; not tried again: --shrink 0 leaves no time"]),
        (
            *(always, [0], {"plan": WAITED}),
            ["no special input is needed; not tried again: the harness does not start it"],
        ),
        (
            *(NoVerdict("gone\nfor good"), [1], {}),
            ["one case; not tried again: no further testee was met: gone"],
        ),
        (KeyboardInterrupt(), [1], {}, ["one case; not tried again: it was interrupted"]),
        (
            *(ValueError("x"), [1], {}),
            ["one case; not tried again: the harness failed: ValueError: x"],
        ),
    ],
    ids=str,
)
def test_how_often_each_was_seen_again_is_said(
    fails: Fails | BaseException,
    cases: list[int],
    more: dict[str, Any],
    said: list[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    found, delivered = told(monkeypatch, tmp_path, fails, cases, **more)
    assert [it.smallest for it in found] == said
    if delivered:  # each once, before any is made small
        each = [(f"FRM-{number}", count) for number, count in enumerate(cases, 1)]
        assert delivered[: len(each)] == each[: len(delivered)]
    script = load(tmp_path / "FRM-1-it.json")
    assert (script.again, script.seen) == (script.again, "again" if script.again else "first")
    assert found[0].text == script.seen
    assert found[0].evidence == (("bytes",) if script.again else ())


HOW_IT_IS_MET: dict[str, Any] = {
    "host": "0.0.0.0",
    "ports": (7001, 7000),
    "viewport": (1920, 1080),
    "patience": 61.5,
    "stand_in_cuda": True,
    "adapter": "python 'my adapter.py'",
}
NOT_HOW: dict[str, Any] = {
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


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("launched", [True, False])
def test_options_meet_the_same_testee_and_say_no_more(side: Side, launched: bool) -> None:
    assert {field.name for field in fields(Plan)} == {*HOW_IT_IS_MET, *NOT_HOW, "side", "launch"}
    how = ["--launch", "./my-viewer 'a b'"] if launched else []
    how = how or (["--wait"] if side == "client" else ["--connect"])
    usual = plan_of(side, parser().parse_args([side, *how]))
    assert as_options(usual) == how
    for name, value in HOW_IT_IS_MET.items():
        if name in ("stand_in_cuda", "adapter") and not launched:
            continue
        if name in ("viewport", "adapter") and side == "server":
            continue
        plan = replace(usual, **{name: value})
        if name == "adapter":
            plan = replace(plan, launch=None)
        line = shlex.split(shlex.join(as_options(replace(plan, **NOT_HOW))))
        again = plan_of(side, parser().parse_args([side, *line]))
        assert replace(again, parallel=plan.parallel) == plan


def test_the_line_that_is_printed_has_all_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = replace(PLAN, ports=(7001, 7000), patience=60.0, host="0.0.0.0")
    [given], _ = told(monkeypatch, tmp_path, always, [1], seconds=0.0, plan=plan)
    assert given.replay == (
        f"splatbus-conformance replay {tmp_path / 'FRM-1-it.json'} --launch ./my-viewer"
        " --host 0.0.0.0 --ports 7001,7000 --patience 60"
    )
