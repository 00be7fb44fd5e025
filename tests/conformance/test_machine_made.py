"""Mutants made by machine: what is changed, how it is found again, what is said of it."""

import argparse
import ast
import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console
from splatbus_conformance.selftest.machine import command, modules, specimens, trials
from splatbus_conformance.selftest.machine.changes import Kind, changed, changes
from splatbus_conformance.selftest.machine.importing import CHANGE
from splatbus_conformance.selftest.machine.lines import executes, noted, watch
from splatbus_conformance.selftest.machine.trials import ByTests, Fate, Judged, Opinion, Phase
from splatbus_conformance.selftest.zoo import specimen_named

MODULE = "splatbus_wire.framing"


def every(source):
    """What each change makes of a source, by its kind."""
    return [
        (Kind(it.name.split(":")[2]), ast.unparse(changed(source, it.name)))
        for it in changes(source, "m")
    ]


@pytest.mark.parametrize(
    ("source", "kind", "changed_to"),
    [
        ("x == y", Kind.COMPARISON, "x != y"),
        ("x < y", Kind.COMPARISON, "x >= y"),
        ("x < y", Kind.BOUND, "x <= y"),
        ("0 < x < y", Kind.BOUND, "0 < x <= y"),
        ("x = 7", Kind.CONSTANT, "x = 8"),
        ("x[7]", Kind.INDEX, "x[8]"),
        ("x[4:n]", Kind.INDEX, "x[5:n]"),
        ("x + y", Kind.SIGN, "x - y"),
        ("x -= y", Kind.SIGN, "x += y"),
        ("-x", Kind.SIGN, "x"),
        ("if x:\n    y", Kind.CONDITION, "if not x:\n    y"),
        ("not x", Kind.CONDITION, "x"),
        ("x and y", Kind.CONDITION, "x or y"),
        ("f(True)", Kind.CONDITION, "f(False)"),
        ("[x for x in y if x]", Kind.CONDITION, "[x for x in y if not x]"),
        ("f(x)", Kind.DROPPED, "pass"),
        ("self.x = y", Kind.DROPPED, "pass"),
        ("f(x, y)", Kind.SWAPPED, "f(y, x)"),
        ("raise X(1, 2)", Kind.LET_GO, "pass"),
        ("try:\n    x\nexcept E:\n    y", Kind.LET_GO, "try:\n    x\nexcept E:\n    raise"),
        ("with suppress(E):\n    x", Kind.LET_GO, "if True:\n    x"),
    ],
)
def test_each_kind_changes_one_thing(source, kind, changed_to):
    assert (kind, changed_to) in every(source)


@pytest.mark.parametrize(
    "source",
    [
        "x: Annotated[int, 3]",
        "log.debug('%d', 3)",
        "def f() -> Literal[3]:\n    return x",
        "min(x, y) is None or max(y, x)",
    ],
)
def test_what_only_people_read_or_what_changes_nothing_is_left(source):
    assert not {kind for kind, _ in every(source)} & {Kind.CONSTANT, Kind.SWAPPED, Kind.INDEX}


def test_every_change_of_every_module_compiles_and_is_one():
    for module in (*modules.WIRE, *modules.OWN["client"], *modules.OWN["server"]):
        source = modules.source(module).read_text("utf-8")
        found = changes(source, module)
        assert len({it.name for it in found}) == len(found)
        for change in found[::20]:
            tree = changed(source, change.name)
            assert ast.dump(tree) != ast.dump(ast.parse(source))
            compile(tree, module, "exec")


def test_a_change_keeps_its_name_while_others_come_before_it():
    (before,) = changes("def f():\n    return x < y", "m")[1:]
    after = changes("z = 3\n\n\ndef f():\n    return x < y", "m")
    assert before.name in [it.name for it in after]


def test_a_change_that_is_gone_is_an_error():
    with pytest.raises(LookupError, match="m:f:bound:1"):
        changed("x", "m:f:bound:1")


def test_more_that_are_drawn_begin_with_the_same():
    few, many = modules.draw(10, 1), modules.draw(30, 1)
    assert many[:10] == few
    assert modules.draw(10, 2) != few
    assert modules.named(it.change.name for it in few) == few


def test_the_wire_is_judged_on_both_sides():
    sides = {it.change.module.partition(".")[0]: it.sides for it in modules.draw(100, 1)}
    assert sides["splatbus_wire"] == ("client", "server")
    assert sides["splatbus_server"] == ("server",)


def test_a_module_is_changed_while_it_is_imported_and_only_then():
    path = modules.source(MODULE)
    source = path.read_text("utf-8")
    change = changes(source, MODULE)[0]
    code = (
        f"from splatbus_conformance.selftest.machine.importing import change_on_import\n"
        f"change_on_import({change.name!r})\n"
        f"import {MODULE} as it\n"
        f"code = it.__loader__.get_code({MODULE!r})\n"
        f"print(code != compile(open(it.__file__).read(), it.__file__, 'exec'))"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ran.stdout, ran.stderr) == ("True\n", "")
    assert path.read_text("utf-8") == source


def test_specimens_of_the_machine_are_found_by_their_name():
    name = specimens.named(specimens.CHANGED, "client", "unity", f"{MODULE}:f:bound:1")
    found = specimen_named(name)
    assert (found.side, found.axes) == ("client", "unity")
    assert specimen_named("machine/what") is None


def test_lines_that_are_executed_are_noted(tmp_path):
    file = tmp_path / "lines"
    code = (
        f"from {watch.__module__} import watch\nwatch({str(file)!r})\nimport {MODULE}\n"
        f"from {MODULE} import PacketDecoder\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))
    lines = noted(file.read_text())
    assert {module for module, _ in lines} >= {MODULE}
    inside = [it for it in modules.of(MODULE) if it.name.startswith(f"{MODULE}:PacketDecoder.")]
    assert not any(executes(lines, it) for it in inside)  # nothing was called


def told(monkeypatch, *found):
    """The runs that are made, each of which comes to one of these opinions."""
    runs, left = [], list(found)

    def by_run(change, side, phase):
        runs.append((side, phase.profile))
        return left.pop(0)

    monkeypatch.setattr(trials, "_by_run", by_run)
    return runs


ALIVE, DEAD, UNMET = Opinion(Fate.SURVIVED), Opinion(Fate.KILLED, "x"), Opinion(Fate.UNMET)


def wire():
    return next(it for it in modules.draw(50, 1) if len(it.sides) == 2)


def test_the_first_must_that_is_broken_ends_it(monkeypatch):
    runs = told(monkeypatch, ALIVE, ALIVE, DEAD)
    assert trials.by_harness(wire(), None) == DEAD
    assert len(runs) == 3


def test_a_side_that_is_not_met_is_not_tried_again(monkeypatch):
    runs = told(monkeypatch, UNMET, UNMET, *[ALIVE] * 9)
    assert trials.by_harness(wire(), None) == UNMET
    assert [side for side, _ in runs] == ["client", "client", "server", "server", "server"]


def test_a_client_that_no_adapter_can_speak_for_is_tried_without_one(monkeypatch):
    told(monkeypatch, UNMET, DEAD)
    assert trials.by_harness(wire(), None) == DEAD


def test_the_run_that_killed_it_formerly_is_the_first(monkeypatch):
    runs = told(monkeypatch, DEAD)
    trials.by_harness(wire(), None, "server quick: FRM-1 check_it: wrong")
    assert runs == [("server", "quick")]


def test_what_no_run_executes_is_not_run(monkeypatch):
    runs = told(monkeypatch)
    nothing = {"client": frozenset(), "server": frozenset()}
    assert trials.by_harness(wire(), nothing).fate is Fate.UNTOUCHED
    assert runs == []


def report(*cells):
    results = [{"check": "check_it", "verdict": verdict, "text": "so"} for verdict in cells]
    return {"requirements": [{"id": "FRM-1", "results": results}], "others": []}


@pytest.mark.parametrize(
    ("verdicts", "fate"),
    [
        (["pass", "skip"], Fate.SURVIVED),
        (["pass", "warn"], Fate.WARNED),
        (["warn", "harness-error"], Fate.CRASHED),
        (["harness-error", "fail"], Fate.KILLED),
    ],
)
def test_the_worst_verdict_decides(monkeypatch, verdicts, fate):
    monkeypatch.setattr(trials, "run_harness", lambda *given: (report(*verdicts), 1, ""))
    assert trials._by_run("m:f:bound:1", "client", Phase("brief")).fate is fate


def test_a_mutant_that_cannot_be_met_is_neither_killed_nor_alive(monkeypatch):
    nobody = {"requirement": "", "check": "run", "verdict": "harness-error", "text": "nobody came"}
    given = {"requirements": [], "others": [nobody]}
    monkeypatch.setattr(trials, "run_harness", lambda *_: (given, 3, ""))
    assert trials._by_run("m:f:bound:1", "client", Phase("brief")).fate is Fate.UNMET


def test_a_test_that_fails_without_the_change_kills_nothing(monkeypatch):
    monkeypatch.setattr(
        trials, "_failing", lambda tests, change="": "tests/wire/test_it.py::test_x"
    )
    assert trials.by_tests(f"{MODULE}:f:bound:1")[0] is ByTests.UNKNOWN


def test_the_tests_meet_the_changed_module(tmp_path):
    change = modules.of(MODULE)[0]
    test = tmp_path / "test_it.py"
    test.write_text(
        f"import {MODULE} as it\n\n"
        "def test_it():\n    assert type(it.__loader__).__name__ == 'SourceFileLoader'\n"
    )
    assert trials._failing([test]) is None
    assert "test_it" in trials._failing([test], change.name)
    assert CHANGE not in os.environ


def test_the_tests_about_a_module_come_first():
    names = [path.name for path in trials.tests_of(MODULE)]
    assert names[0] == "test_framing.py"
    folders = {path.parent.name for path in trials.tests_of("splatbus_client.lease")}
    assert folders == {"client", "pair"}


def judged(name, fate, tested=ByTests.KILLED):
    return Judged(name, 1, "x", "y", fate, tested, "client brief: so")


def test_two_figures_leave_out_what_cannot_count():
    found = [
        judged("a", Fate.KILLED),
        judged("b", Fate.SURVIVED),
        judged("c", Fate.SURVIVED, ByTests.SURVIVED),
        judged("d", Fate.UNTOUCHED),
        judged("e", Fate.UNMET),
    ]
    executed, tested, both, counts = command.sentences(found)
    assert executed.startswith("1 of 3 (33.3%) in lines that a run executes")
    assert tested.startswith("1 of 3 (33.3%) that a test kills")
    assert both.startswith("1 of 2 (50.0%) of which both is true")
    assert counts == "killed: 1; not met: 1; survived: 2; not executed: 1"


def given(**values):
    return argparse.Namespace(
        **{"again": None, "json": None, "count": 3, "seed": 1, "resume": False, **values}
    )


def test_what_was_judged_is_not_judged_again(monkeypatch, tmp_path):
    seen = []

    def judge(drawn, executed, former=""):
        seen.append(drawn.change.name)
        return judged(drawn.change.name, Fate.KILLED)

    monkeypatch.setattr(command, "judge", judge)
    monkeypatch.setattr(command, "executed_lines", lambda: {"client": frozenset({("m", 1)})})
    out, path = Console(file=io.StringIO()), str(tmp_path / "result.json")
    assert command.machine(given(json=path), out) == 0
    assert command.machine(given(json=path, count=5, resume=True), out) == 0
    assert sorted(seen) == sorted(it.change.name for it in modules.draw(5, 1))
    assert len(command.Result.read(Path(path)).judged) == 5
    assert command.machine(given(again=path, count=2), out) == 0
    assert len(seen) == 7


def test_what_was_killed_has_to_be_killed_again(monkeypatch, tmp_path):
    alive, dead = (it.change.name for it in modules.draw(2, 1))
    result = command.Result(1, "", {})
    result.judged = {
        alive: judged(alive, Fate.KILLED),
        dead: judged(dead, Fate.SURVIVED),
        "splatbus_wire.framing:gone:bound:1": judged(
            "splatbus_wire.framing:gone:bound:1", Fate.KILLED
        ),
    }
    result.save(tmp_path / "former.json")
    monkeypatch.setattr(command, "judge", lambda it, *_: judged(it.change.name, Fate.SURVIVED))
    printed = io.StringIO()
    assert command.machine(given(again=str(tmp_path / "former.json")), Console(file=printed)) == 1
    assert "0 of 1 are killed again; 1 are not there any more" in printed.getvalue()


def test_most_of_the_mutants_that_have_to_die_are_still_there():
    former = command.Result.read(Path(__file__).parents[1] / "data" / "machine_mutants.json")
    assert {it.fate for it in former.judged.values()} == {Fate.KILLED}
    assert len(modules.named(former.judged)) >= len(former.judged) / 2
