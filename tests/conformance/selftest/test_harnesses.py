"""Harnesses as processes: as good as if each were started in the usual way."""

import os

from splatbus_conformance.selftest.processes import harnesses

NAME = "SPLATBUS_TESTS_SAY"
SECONDS = 60.0


def say(line):
    print(os.environ.get(NAME, "nothing"), *line)
    return 7


def test_a_program_finds_the_variables_as_they_are_when_it_starts(monkeypatch):
    monkeypatch.setenv(NAME, "before")
    assert harnesses.run(["a"], SECONDS, {}, say) == (7, "before a\n")
    monkeypatch.setenv(NAME, "after")
    assert harnesses.run([], SECONDS, {}, say) == (7, "after\n")
    assert harnesses.run([], SECONDS, {NAME: "besides"}, say) == (7, "besides\n")
    monkeypatch.delenv(NAME)
    assert harnesses.run([], SECONDS, {}, say) == (7, "nothing\n")
