"""Judge a mutant that was made by machine by our tests: those that execute what was changed."""

import json
import os
import re
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from enum import StrEnum
from functools import cache, partial
from pathlib import Path

import pytest

from tests.zoo.machine.changes import Change
from tests.zoo.machine.importing import change_on_import
from tests.zoo.machine.lines import START, Watched, trace
from tests.zoo.machine.modules import OWN, WIRE, source
from tests.zoo.processes import harnesses

ROOT = Path(__file__).parents[3]
FOLDERS = ("wire", "client", "server", "pair")
"""Of tests that meet what is changed in their own process."""
TESTS_SECONDS = 900.0
TEST_SECONDS = 60
"""A single test that takes so long hangs: usually the slowest takes half of it."""
WATCHED_SECONDS = 1800.0
CALLS = 1000
"""Of a function, in one test: what they have not executed is hardly executed there."""
UNENDED = "they did not come to an end"


class ByTests(StrEnum):
    """What our tests make of a mutant."""

    KILLED = "killed"
    SURVIVED = "survived"
    UNKNOWN = "unknown"
    """They were not asked, or fail on what is unchanged too."""


class Watching:
    """A pytest plugin that notes which lines each test executes, and how long it takes."""

    def __init__(self) -> None:
        self._seen: set[tuple[str, int]] = set()
        self.lines = {START: self._seen}
        self.seconds: dict[str, float] = {}
        trace(self._note, CALLS)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """One test, with its fixtures."""
        began = time.monotonic()
        self._seen = self.lines[item.nodeid] = set()
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] = round(time.monotonic() - began, 3)

    def _note(self, module: str, line: int) -> bool:
        before = len(self._seen)
        self._seen.add((module, line))
        return len(self._seen) > before


class SelectedTests:
    """A pytest plugin that runs these tests in this order."""

    def __init__(self, names: Iterable[str]) -> None:
        self._places = {name: place for place, name in enumerate(names)}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leave out the others."""
        chosen = [it for it in items if it.nodeid in self._places]
        items[:] = sorted(chosen, key=lambda it: self._places[it.nodeid])


def watch_tests(folder: str) -> Watched:
    """Run the tests of a folder on the reference."""
    with tempfile.TemporaryDirectory(prefix="splatbus-tests-") as scratch:
        path = Path(scratch, "watched.json")
        main = partial(_watch, str(path))
        status, output = harnesses.run([f"tests/{folder}"], WATCHED_SECONDS, {}, main)
        if not path.exists():
            raise RuntimeError(f"tests/{folder} ended with {status}: {output[-400:]}")
        return Watched.from_json(json.loads(path.read_text("utf-8")))


def _watch(path: str, line: list[str]) -> int:
    plugin = Watching()
    status = _pytest(line, plugin)
    sys.settrace(None)
    lines = {name: frozenset(it) for name, it in plugin.lines.items()}
    Path(path).write_text(json.dumps(Watched(lines, plugin.seconds).as_json()), "utf-8")
    return status


def by_tests(change: Change, watched: Watched, deadly: Sequence[str]) -> tuple[ByTests, str]:
    """Run the tests that can tell, first those by which others like it died, until one fails.

    That one has to pass on what is unchanged, else it says nothing.
    """
    names = _telling(change, watched)
    names.sort(key=lambda name: name not in deadly)
    failed = failing(names, change.name) if names else None
    if failed is None:
        return ByTests.SURVIVED, ""
    if failed == UNENDED:
        return ByTests.UNKNOWN, UNENDED
    if "::" in failed and failing([failed]) is not None:
        return ByTests.UNKNOWN, f"{failed} fails on what is unchanged too"
    return ByTests.KILLED, failed


def _telling(change: Change, watched: Watched) -> list[str]:
    """What is made while a module is read is met by whoever uses it, or what imports it."""
    found = watched.telling(change)
    if len(found) < len(watched.seconds):
        return found
    users = _users(change.module)
    return [it for it in found if any(module in users for module, _ in watched.lines[it])]


@cache
def _users(module: str) -> frozenset[str]:
    """A module, and those that import it."""
    package, _, name = module.rpartition(".")
    named = re.compile(rf"import {package}\.{name}\b|from {package}\.{name} import"
                       rf"|from {package} import [^\n]*\b{name}\b")  # fmt: skip
    every = (*WIRE, *OWN["client"], *OWN["server"])
    users = (it for it in every if named.search(source(it).read_text("utf-8")))
    return frozenset((module, *users))


def failing(names: Sequence[str], change: str = "") -> str | None:
    """The first of these tests that fails, empty where they cannot even be read, or None."""
    files = dict.fromkeys(name.partition("::")[0] for name in names)
    main = partial(_meet, change, names)
    status, output = harnesses.run([*files], TESTS_SECONDS, {}, main)
    if status is None:
        return UNENDED
    if status == pytest.ExitCode.OK:
        return None
    failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", output, re.MULTILINE)
    return failed[1] if failed else ""


def _meet(change: str, names: Sequence[str], line: list[str]) -> int:
    if change:
        change_on_import(change)
    timeout = ("-o", f"timeout={TEST_SECONDS}")
    # Threads that a change has hung keep no process alive.
    return _ending(_pytest([*line, "-x", *timeout], SelectedTests(names)))


def _pytest(line: Sequence[str], plugin: object) -> int:
    os.chdir(ROOT)
    os.environ.pop("PYTEST_CURRENT_TEST", None)
    with tempfile.TemporaryDirectory(prefix="splatbus-tests-") as folder:
        os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = folder
        options = ("-q", "--no-header", "--tb=no", "-p", "no:cacheprovider")
        imported = ("pytest.PytestAssertRewriteWarning", "hypothesis.errors.HypothesisWarning")
        early = [f"-Wignore::{it}" for it in imported]  # by the harness, and drawn from
        return int(pytest.main([*line, *options, *early, "--basetemp", f"{folder}/t"], [plugin]))


def _ending(status: int) -> int:
    sys.stdout.flush()
    os._exit(status)
