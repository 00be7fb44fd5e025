"""The long run: its plan is whole, it goes on where it stopped, it says how far it is behind."""

import json
import re
import subprocess
import sys
import time

import pytest

from tests import long
from tests.foreign.programs import FOLDERS, Lacking, programs


@pytest.fixture
def result(tmp_path, monkeypatch):
    monkeypatch.setattr(long, "RESULT", tmp_path / "results" / "long.json")
    monkeypatch.setattr(long, "MUTANTS", tmp_path / "results" / "machine.json")
    return long.RESULT


def state(**values):
    return {"commit": "c0ffee", "seconds": 0, "tasks": {}, "mutants": [], **values}


def repository(monkeypatch, **answers):
    """A git that answers so, by its first word."""

    def git(*words):
        answer = answers.get(words[0].replace("-", "_"), "")
        if answer is None:
            raise subprocess.CalledProcessError(128, "git")
        return answer

    monkeypatch.setattr(long, "git", git)


def test_everything_is_in_the_plan_and_once():
    names = [task.name for task in long.plan()]
    count = len(programs("client")) + len(programs("server")) + 6 + 3  # for engines and Blenders
    assert len(set(names)) == len(names) == 2 * (3 * count + 20 * 4 + 5 * 4) + 3
    ours = [name.startswith("our ") for name in names]
    assert ours == sorted(ours), "what has found most comes first"


def test_the_pair_and_blender_are_judged_alone():
    found = {False: set(), True: set()}
    for task in long.plan():
        found[bool(re.match("our |blender |tests of blender ", task.name))].add(task.at_a_time)
    assert found == {False: {long.AT_A_TIME}, True: {1}}


def test_what_never_rests_rests_when_the_run_is_over(tmp_path, monkeypatch):
    beside = []
    start = subprocess.Popen

    def own(name, profile, seed, scratch):
        assert [process.poll() for process in beside] == [None] * long.BUSY
        return {"wrong": [], "others": {"CHN-1": "skip"}}

    def popen(line):
        beside.append(start([sys.executable, "-c", "input()"], stdin=subprocess.PIPE))
        return beside[-1]

    monkeypatch.setattr(long, "own", own)
    monkeypatch.setattr(long.subprocess, "Popen", popen)
    assert long.hurried("server", "quick", 20, tmp_path) == {"wrong": []}
    assert None not in [process.poll() for process in beside]


@pytest.mark.skipif(not (long.ROOT / ".git").exists(), reason="git tells which files are ours")
def test_what_has_no_part_in_a_result_does_not_end_it():
    judged = long.git("ls-files", "--", *long.JUDGED).splitlines()
    assert judged
    assert not [name for name in judged if name.endswith(".md") or "/test_" in name]
    assert not [name for name in judged if "/variations/" in name or "/mutants/v1_0/" in name]
    assert "tests/foreign/programs.py" in judged
    assert "tests/zoo/machine/changes.py" in judged
    assert "schemas/splatbus_schemas/limits.json" in judged


def test_a_sitting_ends_in_time_and_the_next_goes_on(result):
    tasks = [long.Task(name, lambda scratch: {"wrong": []}) for name in "abc"]
    first = state()
    long.sit(list(tasks), first, time.monotonic() - 1, 2)
    assert not result.exists()
    long.sit(tasks, first, time.monotonic() + 60, 2)
    assert set(json.loads(result.read_text())["tasks"]) == set("abc")


@pytest.mark.parametrize("error", [RuntimeError, Lacking])
def test_a_task_that_raises_is_wrong(error):
    def run(scratch):
        raise error("no report was written")

    assert long.done(long.Task("it", run))["wrong"] == ["no report was written"]


@pytest.mark.parametrize(("diff", "goes_on"), [("", True), ("conformance/x.py", False)])
def test_what_was_done_counts_for_the_same_sources_only(result, monkeypatch, diff, goes_on):
    name = next(long.plan()).name
    former = state(tasks={name: {"wrong": [], "seconds": 1}})
    long.save(former)
    repository(monkeypatch, diff=diff, rev_parse="f00d")
    assert (long.begun() == former) is goes_on


def test_what_is_planned_no_longer_is_left_out(result, monkeypatch):
    long.save(state(tasks={"client of other sources, quick, seed 0": {"wrong": []}}))
    repository(monkeypatch, rev_parse="f00d")
    assert long.begun() == state()


@pytest.mark.skipif(not (long.ROOT / ".git").exists(), reason="git tells which files are ours")
def test_a_task_is_named_by_all_that_it_alone_is_made_of(monkeypatch):
    def named():
        return {it.name: long.made_of(it) for side in FOLDERS for it in programs(side)}

    judged = long.git("ls-files", "--", *long.JUDGED).splitlines()
    own = (*long.STAND_IN, *(f"tests/foreign/{side}s/" for side in FOLDERS))
    assert not [name for name in judged if name.startswith(own)]
    before, of_all = named(), {task.name for task in long.plan()}
    assert all(any(f"of {it}" in name for name in of_all) for it in before.values())
    monkeypatch.setattr(long, "STAND_IN", ("tests/package/test_long.py",))
    changed = {name for name, digest in named().items() if digest != before[name]}
    asks = {it.name for side in FOLDERS for it in programs(side) if long.ASKS_FOR_IT in it.options}
    assert changed == asks
    assert before["next_minor"] != long.digest("tests/foreign/servers/next_minor"), "it borrows"


def test_a_commit_that_is_not_here_begins_anew(result, monkeypatch):
    long.save(state(tasks={"a": {}}))
    repository(monkeypatch, diff=None, rev_parse="f00d")
    assert long.begun()["commit"] == "f00d"
    assert long.begun()["tasks"] == {}


def test_what_is_not_committed_has_no_result(result, monkeypatch, capsys):
    repository(monkeypatch, status=" M conformance/x.py")
    assert long.long([]) == 2
    assert "conformance/x.py" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("count", "told"),
    [("3", "the result of `python -m tests long` is 3 changes"), ("0", ""), (None, "")],
)
def test_how_far_it_is_behind_is_told_where_git_knows(result, monkeypatch, count, told):
    done = {task.name: {"wrong": []} for task in long.plan()}
    long.save(state(tasks=done, judged=True))
    repository(monkeypatch, rev_list=count)
    assert long.behind().startswith(told)
    assert bool(long.behind()) == bool(told)


def test_a_result_that_is_not_whole_is_never_fresh(result, monkeypatch):
    long.save(state())
    repository(monkeypatch, rev_list="0")
    assert long.behind().startswith("the result of `python -m tests long` is not whole (0 of ")


def test_that_there_is_no_result_is_told(result):
    assert "no result" in long.behind()


def test_a_verdict_that_hangs_on_the_seed_is_told():
    def ours(seed, **others):
        return {f"our server, quick, seed {seed}": {"wrong": [], "others": others}}

    same = ours(0, FRM="skip") | ours(1, FRM="skip")
    assert list(long.differing(same)) == []
    assert list(long.differing(same | ours(2))) == [
        "our server, quick: FRM is pass 1 times, skip 2 times"
    ]
