"""Mutants made by machine: what is changed, how it is found again, what is said of it."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.zoo.machine import __main__ as command
from tests.zoo.machine import (
    lines,
    modules,
    testing,
    trials,
)
from tests.zoo.machine.changes import Change, changes
from tests.zoo.machine.lines import MEETING, START, Watched, noted
from tests.zoo.machine.specimens import CHANGED, MachineMade
from tests.zoo.machine.testing import ByTests
from tests.zoo.machine.trials import HarnessVerdict, Judged, MutantFate, Phase
from tests.zoo.registry import specimen_named

MODULE = "splatbus_wire.framing"


def test_more_that_are_drawn_begin_with_the_same():
    few, many = modules.draw(10, 1), modules.draw(30, 1)
    assert many[:10] == few
    assert modules.draw(10, 2) != few
    assert modules.named(it.change.name for it in few) == few


def test_the_wire_is_judged_on_both_sides():
    sides = {it.change.module.partition(".")[0]: it.sides for it in modules.draw(100, 1)}
    assert sides["splatbus_wire"] == ("client", "server")
    assert sides["splatbus_server"] == ("server",)


def test_what_nobody_calls_who_is_judged_is_not_changed_and_is_there():
    for module, functions in modules.UNCALLED.items():
        every = {it.name.rsplit(":", 2)[0] for it in changes(_source(module), module)}
        drawn = {it.name.rsplit(":", 2)[0] for it in modules.of(module)}
        assert every - drawn == {f"{module}:{function}" for function in functions}
        assert drawn


def test_what_is_made_while_a_module_is_read_is_tried_in_every_phase():
    module = "splatbus_wire.conventions"
    change = next(it for it in modules.of(module) if it.name.startswith(f"{module}::"))
    executed = frozenset((module, line) for line in range(change.lines[0], change.lines[1] + 1))
    watched = {it.name: Watched({START: executed}, {"check_it": 1.0}) for it in trials.PHASES}
    tried = [phase for phase, _ in trials._plan(modules.as_drawn(change), watched, ())]
    assert set(tried) == set(trials.PHASES)


def _source(module):
    return modules.source(module).read_text("utf-8")


def test_a_module_is_changed_while_it_is_imported_and_only_then():
    path = modules.source(MODULE)
    source = path.read_text("utf-8")
    change = changes(source, MODULE)[0]
    code = (
        f"from tests.zoo.machine.importing import change_on_import\n"
        f"change_on_import({change.name!r})\n"
        f"import {MODULE} as it\n"
        f"code = it.__loader__.get_code({MODULE!r})\n"
        f"print(code != compile(open(it.__file__).read(), it.__file__, 'exec'))"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ran.stdout, ran.stderr) == ("True\n", "")
    assert path.read_text("utf-8") == source


def test_specimens_of_the_machine_are_found_by_their_name():
    made = MachineMade(CHANGED, "client", "unity", f"{MODULE}:f:bound:1")
    assert specimen_named(made.name) == made
    assert specimen_named("machine/what") is None


def test_lines_that_are_executed_are_noted(tmp_path):
    file = tmp_path / "lines"
    lines.nobody_yet(lines.now_of(file))
    code = (
        f"from {lines.__name__} import watch\nwatch({str(file)!r})\nimport {MODULE}\n"
        f"from {MODULE} import PacketDecoder\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))
    found = noted(file.read_text())
    assert set(found) == {START}
    assert {module for module, _ in found[START]} >= {MODULE}
    watched = Watched(found, {"check_it": 1.0})
    inside = [it for it in modules.of(MODULE) if it.name.startswith(f"{MODULE}:PacketDecoder.")]
    assert not any(watched.telling(it) for it in inside)  # nothing was called


def test_a_watched_specimen_is_told_which_check_runs(tmp_path):
    now = lines.now_of(tmp_path / "lines")
    lines.nobody_yet(now)
    assert lines.told(now) == ""
    code = (
        f"import {lines.__name__} as it\nit.tell({str(now)!r})\n"
        "from splatbus_conformance.run.collector import Collector\n"
        "from unittest import mock\n"
        "Collector.start(mock.MagicMock(), 'check_it')\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))
    assert lines.told(now) == "check_it"


LINES = {
    "check_one": frozenset({("m", 1), ("m", 2)}),
    "check_two": frozenset({("m", 2)}),
    START: frozenset({("m", 4)}),
    MEETING: frozenset({("m", 2), ("m", 3)}),
}


@pytest.mark.parametrize(
    ("line", "telling"),
    [
        (1, ["check_one"]),
        (2, ["check_two", "check_one"]),
        (3, ["check_none", "check_two", "check_one"]),
        (4, ["check_none", "check_two", "check_one"]),
        (5, []),
    ],
)
def test_who_executes_a_change_can_tell_it_or_all_where_it_lasts(line, telling):
    watched = Watched(LINES, {"check_one": 3.0, "check_two": 2.0, "check_none": 1.0})
    assert watched.telling(Change("m:f:bound:1", line, (line, line), "", "")) == telling
    assert Watched.from_json(json.loads(json.dumps(watched.as_json()))) == watched


def told(monkeypatch, *found):
    """The runs that are made, each of which comes to one of these opinions."""
    runs, left = [], list(found)

    def run(change, phase, checks=()):
        runs.append((phase.name, list(checks)))
        return left.pop(0)

    monkeypatch.setattr(trials, "run", run)
    return runs


ALIVE, DEAD, UNMET = (
    HarnessVerdict(MutantFate.SURVIVED),
    HarnessVerdict(MutantFate.KILLED, "x"),
    HarnessVerdict(MutantFate.UNMET),
)
TOKEN = "server with a token"


def wire():
    return next(it for it in modules.draw(50, 1) if len(it.sides) == 2)


def watched(*phases, count=8):
    """Each of these phases has so many checks that execute it."""
    change = wire().change
    found = {f"check_{it}": frozenset({(change.module, change.line)}) for it in range(count)}
    seen = Watched(found, dict.fromkeys(found, 1.0))
    return {it.name: seen if it.name in phases else Watched() for it in trials.PHASES}


def test_the_first_must_that_is_broken_ends_it(monkeypatch):
    runs = told(monkeypatch, ALIVE, ALIVE, DEAD)
    assert trials.by_harness(wire(), None, []) == DEAD
    assert len(runs) == 3


def test_a_side_that_is_not_met_is_not_tried_again(monkeypatch):
    runs = told(monkeypatch, UNMET, UNMET, *[ALIVE] * 9)
    assert trials.by_harness(wire(), None, []) == UNMET
    assert [name for name, _ in runs] == ["server", "client unity", "client"]


def test_a_later_phase_is_for_what_no_earlier_one_executes(monkeypatch):
    runs = told(monkeypatch, *[ALIVE] * 9)
    trials.by_harness(wire(), watched("client unity", "client telemetry"), [])
    assert [(name, len(checks)) for name, checks in runs] == [("client unity", 8)]
    runs.clear()
    trials.by_harness(wire(), watched("client telemetry", "client blender"), [])
    assert [(name, len(checks)) for name, checks in runs] == [("client telemetry", 8)]


def test_a_client_that_no_adapter_can_speak_for_is_tried_without_one(monkeypatch):
    told(monkeypatch, ALIVE, ALIVE, UNMET, DEAD)
    assert trials.by_harness(wire(), None, []) == DEAD


def test_the_check_that_killed_it_formerly_is_the_first(monkeypatch):
    runs = told(monkeypatch, ALIVE, DEAD)
    former = replace(judged(wire().change.name, MutantFate.KILLED), phase=TOKEN, check="check_it")
    trials.by_harness(wire(), None, [former])
    assert runs == [(TOKEN, ["check_it"]), (TOKEN, [])]


def test_a_few_checks_of_each_side_come_before_the_others(monkeypatch):
    runs = told(monkeypatch, *[ALIVE] * 9)
    former = replace(judged(wire().change.name, MutantFate.KILLED), phase="server", check="check_7")
    trials.by_harness(wire(), watched("server", "client unity"), [former])
    assert [(name, len(checks)) for name, checks in runs] == [
        *(("server", trials.FIRST), ("client unity", trials.FIRST)),
        *(("server", 8 - trials.FIRST), ("client unity", 8 - trials.FIRST)),
    ]
    assert runs[0][1][0] == "check_7"


def test_with_a_token_the_few_are_enough_where_all_ran_without_one(monkeypatch):
    runs = told(monkeypatch, *[ALIVE] * 9)
    trials.by_harness(wire(), watched("server", TOKEN), [])
    assert [name for name, _ in runs] == ["server", TOKEN, "server"]
    runs.clear()
    trials.by_harness(wire(), watched(TOKEN), [])
    assert [(name, len(checks)) for name, checks in runs] == [(TOKEN, 8)]


def test_what_no_run_executes_is_not_run(monkeypatch):
    runs = told(monkeypatch)
    assert trials.by_harness(wire(), watched(), []).fate is MutantFate.UNTOUCHED
    assert runs == []


def report(*cells):
    told = {"check": "check_it", "text": "so", "code": "so"}
    results = [{**told, "verdict": verdict} for verdict in cells]
    return {"requirements": [{"id": "FRM-1", "results": results}], "others": []}


@pytest.mark.parametrize(
    ("verdicts", "fate"),
    [
        (["pass", "skip"], MutantFate.SURVIVED),
        (["pass", "warn"], MutantFate.WARNED),
        (["warn", "harness-error"], MutantFate.CRASHED),
        (["harness-error", "fail"], MutantFate.KILLED),
    ],
)
def test_the_worst_verdict_decides(monkeypatch, verdicts, fate):
    monkeypatch.setattr(trials, "run_harness", lambda *given: (report(*verdicts), 1, ""))
    assert trials.run("m:f:bound:1", Phase("client")).fate is fate


def test_a_mutant_that_cannot_be_met_is_neither_killed_nor_alive(monkeypatch):
    nobody = {
        "requirement": "",
        "check": "run",
        "verdict": "harness-error",
        "text": "nobody came",
        "code": "",
    }
    given = {"requirements": [], "others": [nobody]}
    monkeypatch.setattr(trials, "run_harness", lambda *_: (given, 3, ""))
    assert trials.run("m:f:bound:1", Phase("client")).fate is MutantFate.UNMET


def test_a_test_that_fails_without_the_change_kills_nothing(monkeypatch):
    change = wire().change
    found = Watched({"x::y": frozenset({(change.module, change.line)})}, {"x::y": 1.0})
    monkeypatch.setattr(testing, "failing", lambda tests, change="": tests[0])
    assert testing.by_tests(change, found, [])[0] is ByTests.UNKNOWN
    monkeypatch.setattr(testing, "failing", lambda tests, change="": change and tests[0])
    monkeypatch.setattr(testing, "failing", lambda tests, change="": tests[0] if change else None)
    assert testing.by_tests(change, found, []) == (ByTests.KILLED, "x::y")
    assert testing.by_tests(change, Watched(), []) == (ByTests.SURVIVED, "")


def test_the_tests_meet_the_changed_module_in_the_order_that_is_asked_for():
    file = "tests/wire/test_framing.py"
    names = [f"{file}::test_the_largest_payload_is_taken"]
    names += [f"{file}::test_a_packet_is_its_length_little_endian_and_its_payload"]
    change = f"{MODULE}:encode_packet:condition:1"
    assert testing.failing(names) is None
    assert testing.failing(names, change) == names[0]
    assert testing.failing(names[::-1], change) == names[1]


def test_what_is_made_while_a_module_is_read_is_met_by_its_users():
    change = Change("splatbus_wire.fields::constant:1", 1, (1, 1), "", "")
    found = {
        START: frozenset({(change.module, 1)}),
        "a": frozenset({(change.module, 9)}),
        "b": frozenset({("splatbus_wire.init_packet", 9)}),
        "c": frozenset({("splatbus_client.backoff", 9)}),
    }
    assert testing._telling(change, Watched(found, dict.fromkeys("abc", 1.0))) == ["a", "b"]


def judged(name, fate, tested=ByTests.KILLED):
    return Judged(name, 1, "x", "y", fate, tested, "client unity", "check_it", "so")


def test_two_figures_leave_out_what_cannot_count():
    found = [
        judged("a", MutantFate.KILLED),
        judged("b", MutantFate.SURVIVED),
        judged("c", MutantFate.SURVIVED, ByTests.SURVIVED),
        judged("d", MutantFate.UNTOUCHED),
        judged("e", MutantFate.UNMET),
    ]
    executed, tested, both, counts = command.sentences(found)
    assert executed.startswith("1 of 3 (33.3%) in lines that a run executes")
    assert tested.startswith("1 of 3 (33.3%) that a test kills")
    assert both.startswith("1 of 2 (50.0%) of which both is true")
    assert counts == "killed: 1; not met: 1; survived: 2; not executed: 1"


def test_what_was_judged_is_not_judged_again(monkeypatch, tmp_path):
    seen = []

    def judge(drawn, watched, former):
        seen.append(drawn.change.name)
        return judged(drawn.change.name, MutantFate.KILLED)

    monkeypatch.setattr(command, "judge", judge)
    monkeypatch.setattr(command, "watched_at", lambda *_: {})
    path = str(tmp_path / "result.json")
    drawn = ["--seed", "1", "--json", path, "--count"]
    assert command.main([*drawn, "3"]) == 0
    assert command.main([*drawn, "5", "--resume"]) == 0
    assert sorted(seen) == sorted(it.change.name for it in modules.draw(5, 1))
    assert len(command.StoredMutants.read(Path(path)).judged) == 5
    assert command.main(["--again", path, "--count", "2"]) == 0
    assert len(seen) == 7


def test_what_was_killed_has_to_be_killed_again(monkeypatch, tmp_path, capsys):
    alive, dead = (it.change.name for it in modules.draw(2, 1))
    result = command.StoredMutants(1, "")
    result.judged = {
        alive: judged(alive, MutantFate.KILLED),
        dead: judged(dead, MutantFate.SURVIVED),
        "splatbus_wire.framing:gone:bound:1": judged(
            "splatbus_wire.framing:gone:bound:1", MutantFate.KILLED
        ),
    }
    result.save(tmp_path / "former.json")
    monkeypatch.setattr(
        command, "judge", lambda it, *_: judged(it.change.name, MutantFate.SURVIVED)
    )
    assert command.main(["--again", str(tmp_path / "former.json"), "--count", "3"]) == 1
    assert "0 of 1 are killed again; 1 are not there any more" in capsys.readouterr().out


def test_most_of_the_mutants_that_have_to_die_are_still_there():
    former = command.StoredMutants.read(Path(__file__).parents[2] / "data" / "machine_mutants.json")
    assert {it.fate for it in former.judged.values()} == {MutantFate.KILLED}
    assert len(modules.named(former.judged)) >= len(former.judged) / 2
