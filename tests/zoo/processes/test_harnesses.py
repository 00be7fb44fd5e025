"""Harnesses as processes: as good as if each were started in the usual way."""

import os
import time
from types import SimpleNamespace

import pytest

from tests.zoo.processes import harnesses

NAME = "SPLATBUS_TESTS_SAY"
SECONDS = 60.0


def say(line):
    print(os.environ.get(NAME, "nothing"), *line)
    return 7


@pytest.mark.parametrize(("prints", "ends"), [(9, True), (5, False)])
def test_a_program_ends_by_itself_as_long_as_it_prints(prints, ends, tmp_path, monkeypatch):
    clock = SimpleNamespace(now=0.0)
    output = tmp_path / "output.txt"

    def join(seconds):
        clock.now += seconds
        if clock.now <= prints * harnesses.LOOK_SECONDS:
            output.write_text("more" * int(clock.now))

    process = SimpleNamespace(is_alive=lambda: clock.now < 10 * harnesses.LOOK_SECONDS, join=join)
    monkeypatch.setattr(harnesses, "time", SimpleNamespace(monotonic=lambda: clock.now))
    silent = 3 * harnesses.LOOK_SECONDS
    assert harnesses._comes_to_an_end(process, output, silent) is ends


def sleep(line):
    time.sleep(600.0)


def test_a_program_that_says_nothing_is_ended():
    status, told = harnesses.run([], 0.5, {}, sleep)
    assert (status, told.partition(",")[0]) == (None, "it said nothing for 0.5 s")


def test_a_program_finds_the_variables_as_they_are_when_it_starts(monkeypatch):
    monkeypatch.setenv(NAME, "before")
    assert harnesses.run(["a"], SECONDS, {}, say) == (7, "before a\n")
    monkeypatch.setenv(NAME, "after")
    assert harnesses.run([], SECONDS, {}, say) == (7, "after\n")
    assert harnesses.run([], SECONDS, {NAME: "besides"}, say) == (7, "besides\n")
    monkeypatch.delenv(NAME)
    assert harnesses.run([], SECONDS, {}, say) == (7, "nothing\n")
