"""The long run: its plan is whole, it goes on where it stopped, it says how far it is behind."""

import json
import subprocess
import time

import pytest

from tests import long
from tests.foreign.programs import programs

COMMIT = "c0ffee"


@pytest.fixture
def result(tmp_path, monkeypatch):
    monkeypatch.setattr(long, "RESULT", tmp_path / "results" / "long.json")
    return long.RESULT


def state(**values):
    return {"commit": COMMIT, "seconds": 0, "tasks": {}, **values}


def repository(monkeypatch, **answers):
    """A git that answers so, by its first word."""

    def git(*words):
        answer = answers.get(words[0].replace("-", "_"), "")
        if answer is None:
            raise subprocess.CalledProcessError(128, "git")
        return answer

    monkeypatch.setattr(long, "git", git)


def test_everything_is_in_the_plan_and_once():
    names = [task.name for task in long.plan(COMMIT)]
    count = len(programs("client")) + len(programs("server")) + 6 + 3  # for engines and Blenders
    assert len(set(names)) == len(names) == count + 3 * 4 + 4 + 3 + 1


def test_a_sitting_ends_in_time_and_the_next_goes_on(result):
    def fails(scratch):
        raise RuntimeError("no report was written")

    tasks = [long.Task(name, lambda scratch: []) for name in "ab"]
    tasks.append(long.Task("c", fails))
    first = state()
    long.sit(list(tasks), first, time.monotonic() - 1)
    assert not result.exists()
    long.sit(tasks, first, time.monotonic() + 60)
    assert json.loads(result.read_text())["tasks"] == {
        "a": [],
        "b": [],
        "c": ["no report was written"],
    }


@pytest.mark.parametrize(
    ("diff", "goes_on"), [("", True), ("conformance/x.py", False), (None, False)]
)
def test_what_was_done_counts_for_the_same_sources(result, monkeypatch, diff, goes_on):
    name = next(long.plan(COMMIT)).name
    long.save(state(tasks={name: []}))
    repository(monkeypatch, diff=diff, rev_parse="f00d")
    assert set(long.begun()["tasks"]) == ({name} if goes_on else set())


def test_what_is_not_committed_has_no_result(result, monkeypatch, capsys):
    repository(monkeypatch, status=" M conformance/x.py")
    assert long.long([]) == 2
    assert "conformance/x.py" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("whole", "count", "told"),
    [
        (True, "3", "the result of `python -m tests long` is 3 changes"),
        (True, "0", ""),
        (True, None, ""),
        (False, "0", "the result of `python -m tests long` is not whole (0 of "),
    ],
)
def test_how_far_it_is_behind_is_told(result, monkeypatch, whole, count, told):
    assert "no result" in long.behind()
    long.save(state(tasks={task.name: [] for task in long.plan(COMMIT) if whole}))
    repository(monkeypatch, rev_list=count)
    assert long.behind().startswith(told)
    assert bool(long.behind()) == bool(told)
