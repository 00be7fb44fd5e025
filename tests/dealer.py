"""Deals the tests to processes, some at a time: `python -m pytest -p tests.dealer --deal N`.

Pytest collects once; each file is then run by a process that is forked from it, the long ones
first. A file whose tests wait rather than compute marks them `apart`, and each is dealt by itself.
What a test starts has to end with it: a process that is left behind fails the last test of its
file, and memory or a folder the run.
"""

import atexit
import faulthandler
import gc
import itertools
import os
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from multiprocessing import util
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import pytest
from splatbus_conformance import guard

from tests.durations import Durations
from tests.keeper import Fate, Kept, abandoned, end, segments
from tests.progress import Progress
from tests.spare import LOOK_SECONDS, Spare

SOME = 5
"""That are named of many."""
BUDGET_SECONDS = 25.0
"""Of a processor, that a file may take."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """How many at a time."""
    parser.addoption(
        "--deal",
        type=int,
        metavar="N",
        default=0,
        help="deal to N processes, and to twice as many while the machine has time",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Where it is asked for."""
    if config.getoption("--deal"):
        config.pluginmanager.register(Dealer(config), "dealer")


@pytest.hookimpl(wrapper=True)
def pytest_report_teststatus(config: pytest.Config) -> Any:
    """Print no letters, neither there nor here: `Progress` says how far it is."""
    told = yield
    return (told[0], "", "") if config.getoption("--deal") else told


@dataclass
class Unit:
    """Tests that one process runs, one after the other."""

    number: int
    name: str
    items: list[pytest.Item] = field(default_factory=list)
    lived: tuple[float, float] = (0.0, 0.0)
    """From when to when it ran."""
    speaks: bool = True
    """Its process may have something to say yet."""
    ended: set[str] = field(default_factory=set)
    """The tests that have come to their end."""

    @property
    def file(self) -> str:
        """In which they are."""
        return self.name.partition("::")[0]


class Dealer:
    """The plugin, in the process that deals."""

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.running: dict[Kept, Unit] = {}
        self.ended: list[Unit] = []
        self.durations = Durations("files")
        self.cpu_seconds: dict[str, float] = {}
        self.folder = Path()
        """For the files that tests make for a time."""

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """In place of pytest's own, which runs one after the other."""
        if session.testsfailed and not self.config.option.continue_on_collection_errors:
            raise session.Interrupted(f"{session.testsfailed} errors while collecting")
        left = units(session.items)
        if unknown := self.durations.unknown(unit.name for unit in left):
            some = ", ".join(unknown[:SOME]) + " …" * (len(unknown) > SOME)
            self._say(f"not known how long these {len(unknown)} take, so they come first: {some}")
        left.sort(key=lambda unit: -self.durations.of(unit.name))
        progress = Progress("tests", self.durations.expected(unit.name for unit in left))
        before = segments()
        self.folder = guard.folder("t")
        deal: int = self.config.option.deal
        spare = Spare(deal)  # for most of what is long waits
        gc.collect()
        gc.freeze()  # else each process copies what it only looks through
        try:
            while (left and not session.shouldfail) or self.running:
                while left and len(self.running) < deal + spare.now():
                    self._start(left.pop(0))
                self._hear(progress)
                if told := progress.now([unit.name for unit in self.running.values()]):
                    failed = f"; {session.testsfailed} failed" if session.testsfailed else ""
                    self._say(f"{told}{failed}")
                if session.shouldfail:
                    left.clear()
        finally:
            end(*self.running)
            guard.remove(self.folder)
        for path, made in abandoned(before).items():
            then = [unit.name for unit in self.ended if unit.lived[0] <= made <= unit.lived[1]]
            self._fail("the whole run", f"{path} was left behind by one of {', '.join(then)}")
        if self.config.args_source.name != "ARGS":  # all of them ran
            self.durations.save(gone=True)
        return True

    def pytest_terminal_summary(self) -> None:
        """Name the files that take much."""
        for file, seconds in sorted(self.cpu_seconds.items(), key=lambda it: -it[1]):
            if seconds > BUDGET_SECONDS:
                self._say(f"{file} took {seconds:.0f} s of a processor, and may {BUDGET_SECONDS:g}")

    def _say(self, line: str) -> None:
        print(line, flush=True)

    def _start(self, unit: Unit) -> None:
        unit.lived = time.time(), 0.0
        self.running[Kept(lambda said: self._work(unit, said))] = unit

    def _work(self, unit: Unit, said: Connection) -> None:
        """In the process that runs them."""
        plugins = self.config.pluginmanager
        plugins.unregister(self)
        endings: Any = atexit
        endings._clear()  # of whoever deals
        capture: Any = plugins.getplugin("capturemanager")
        capture.stop_global_capturing()  # its files are those of whoever deals
        faulthandler.enable(os.dup(2))  # for what crashes takes what it has printed with it
        capture.start_global_capturing()
        plugins.register(Sender(self.config, said))
        folder = self.folder / str(unit.number)
        folder.mkdir()
        tempfile.tempdir = os.environ["TMPDIR"] = str(folder)
        for item, following in itertools.pairwise([*unit.items, None]):
            assert item is not None
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        endings._run_exitfuncs()  # as a process ends that Python has not forked
        leave: Any = util
        leave._exit_function()
        names = [it.name for it in folder.iterdir()]
        if left := [it for it in names if not it.startswith("pytest-of-")]:
            said.send(f"it left files behind: {', '.join(left)}")

    def _hear(self, progress: Progress) -> None:
        ends = [kept.fate for kept in self.running]
        ends += [kept.said for kept, unit in self.running.items() if unit.speaks]
        come = wait(ends, timeout=LOOK_SECONDS)
        for kept in [it for it in self.running if it.said in come or it.fate in come]:
            self._take_reports(kept)
            if kept.fate in come:
                fate: Fate = kept.fate.recv()
                unit = self.running.pop(kept)
                end(kept)
                self._bury(unit, fate)
                progress.done(unit.name)

    def _take_reports(self, kept: Kept) -> None:
        unit = self.running[kept]
        try:
            while kept.said.poll():
                message = kept.said.recv()
                if isinstance(message, str):
                    self._fail(unit.file, message)
                    continue
                hook = self.config.hook
                report = hook.pytest_report_from_serializable(config=self.config, data=message)
                if report.failed:
                    self._say(f"FAILED {report.nodeid} ({report.when})")
                if report.when == "teardown":
                    unit.ended.add(report.nodeid)
                hook.pytest_runtest_logreport(report=report)
        except EOFError:
            unit.speaks = False

    def _bury(self, unit: Unit, fate: Fate) -> None:
        unit.lived = unit.lived[0], time.time()
        self.ended.append(unit)
        self.durations.took(unit.name, unit.lived[1] - unit.lived[0])
        self.cpu_seconds[unit.file] = self.cpu_seconds.get(unit.file, 0.0) + fate.cpu_seconds
        if lost := [item.nodeid for item in unit.items if item.nodeid not in unit.ended]:
            self._fail(lost[0], f"its process ended with {fate.status}")
        if fate.left:
            self._fail(unit.name, f"it left processes behind: {'; '.join(fate.left)}")

    def _fail(self, where: str, what: str) -> None:
        self._say(f"FAILED {where}: {what}")
        place = (where.partition("::")[0], None, where)
        self.config.hook.pytest_runtest_logreport(
            report=pytest.TestReport(where, place, {}, "failed", what, "call")
        )


class Sender:
    """The plugin, in a process that runs tests."""

    def __init__(self, config: pytest.Config, said: Connection) -> None:
        self._config, self._said = config, said

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """A part of a test has come to its end."""
        hook = self._config.hook
        self._said.send(hook.pytest_report_to_serializable(config=self._config, report=report))


def units(items: Iterable[pytest.Item]) -> list[Unit]:
    """What is dealt: files, and tests that are marked to be dealt apart."""
    found: dict[str, Unit] = {}
    for item in items:
        apart = item.get_closest_marker("apart") is not None
        name = item.nodeid if apart else item.nodeid.partition("::")[0]
        found.setdefault(name, Unit(len(found), name)).items.append(item)
    return list(found.values())
