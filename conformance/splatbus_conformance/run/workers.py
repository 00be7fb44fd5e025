"""Several testees at a time: each worker has a stand of its own, and is dealt one check at a time.

Workers are forked, where systems fork, from a process that has imported all that they need while
the testee was met: not from the process that deals, in which a driver of a GPU may be, and no such
driver stands it. Each finds the environment as the user left it.
"""

import contextlib
import math
import multiprocessing
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from enum import Enum, auto
from multiprocessing import forkserver, util
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from splatbus_schemas.requirements import requirements

from splatbus_conformance import guard
from splatbus_conformance.checks import Check
from splatbus_conformance.data import read_json
from splatbus_conformance.guard import Kind, uninterrupted
from splatbus_conformance.plan import NoVerdict, Plan, Usage
from splatbus_conformance.reports.console import complain_of_fault
from splatbus_conformance.run.checker import Checker, selected
from splatbus_conformance.run.collector import Collector
from splatbus_conformance.run.testbed import Facts, set_up
from splatbus_conformance.trials.trial import THOROUGH

FORKS = sys.platform == "linux"
"""Elsewhere there is no fork, or libraries of the system do not stand it."""
ENDING_SECONDS = 30.0
"""How long a worker may take to end its testee."""
CUT_SECONDS = 3.0
"""The same, where a report has to be written before somebody loses patience."""
PRELOADED = ["splatbus_conformance.preload"]
ISOLATED = {"PYTHONSAFEPATH": "1", "OPENBLAS_NUM_THREADS": "1"}
"""No modules of the folder that the user is in; and NumPy starts twice as fast without threads that
no check needs."""
_context: Any = multiprocessing.get_context("forkserver" if FORKS else "spawn")


class WorkerMessage(Enum):
    """What a worker tells, with something that belongs to it."""

    READY = auto()
    TOLD = auto()
    NO_VERDICT = auto()
    LEFT = auto()


@contextlib.contextmanager
def isolated() -> Iterator[None]:
    """Keep what the user's folder and environment hold away from processes that are started."""
    before = dict(os.environ)
    os.environ.update(ISOLATED)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def prepare() -> None:
    """Import what workers need, in a process of its own, while something else is waited for."""
    if FORKS:
        with isolated():
            _context.set_forkserver_preload(PRELOADED)
            guard.watch(Kind.PATH, util.get_temp_dir())  # where its socket is
            forkserver.ensure_running()


class Workers:
    """The workers of a run, as the process sees them that deals the checks.

    Args:
        plan: of the run.
        facts: what was found out of the testee.
        names: of the checks, in the order in which they are dealt.
        gathering: told of all that comes back.
    """

    def __init__(
        self, plan: Plan, facts: Facts, names: Iterable[str], gathering: Collector
    ) -> None:
        self._given = plan, dict(os.environ), facts
        self._left = list(names)[::-1]
        self._gathering = gathering
        self._processes: dict[Connection, BaseProcess] = {}
        self._under_way: dict[Connection, str] = {}

    def run(self, count: int, until: float) -> bool:
        """Have so many workers share the checks, until this moment of the monotonic clock at the
        most; whether all have run. Raises NoVerdict if one cannot meet a testee.
        """
        patience = CUT_SECONDS
        try:
            for _ in range(count):
                self._start()
            while self._processes:
                left = None if until == math.inf else max(0.0, until - time.monotonic())
                if not (spoken := wait(list(self._processes), left)):
                    return False
                for connection in spoken:
                    assert isinstance(connection, Connection)
                    self._hear(connection)
            patience = ENDING_SECONDS
        finally:
            self._end_all(patience)
        return True

    def _start(self) -> None:
        here, there = _context.Pipe()
        process = _context.Process(target=work, args=(*self._given, there))
        with isolated(), uninterrupted():
            process.start()
            guard.watch(Kind.PROCESS, process.pid)
        there.close()
        self._processes[here] = process

    def _hear(self, connection: Connection) -> None:
        try:
            word, what = connection.recv()
        except (EOFError, OSError):
            self._bury(connection)
            return
        if word is WorkerMessage.READY:
            name = self._left.pop() if self._left else ""
            self._under_way[connection] = name
            if name:
                self._gathering.start(name)
            with contextlib.suppress(OSError):  # it will be heard to have ended
                connection.send(name)
        elif word is WorkerMessage.TOLD:
            self._gathering.take(what)
        elif word is WorkerMessage.LEFT:
            self._gathering.findings.traffic.add(what)
        else:
            raise NoVerdict(what)

    def _bury(self, connection: Connection) -> None:
        """A worker has ended; another takes the place of one that died over a check."""
        process = self._processes.pop(connection)
        process.join()
        guard.forget(Kind.PROCESS, process.pid)
        if name := self._under_way.pop(connection, ""):
            self._gathering.note(name, f"the worker crashed while running it: {process.exitcode}")
            if self._left:
                self._start()

    def _end_all(self, patience: float) -> None:
        """Let them end their testees at once, and not only when their check is through."""
        for process in self._processes.values() if os.name == "posix" else ():
            if process.pid is not None and process.is_alive():
                os.kill(process.pid, signal.SIGINT)
        until = time.monotonic() + patience
        for connection, process in self._processes.items():
            connection.close()
            process.join(max(0.0, until - time.monotonic()))
            process.kill()
            guard.forget(Kind.PROCESS, process.pid)


def work(plan: Plan, environment: Mapping[str, str], facts: Facts, there: Connection) -> None:
    """Be a worker: runs in a process of its own."""
    for ending in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, ending):
            signal.signal(getattr(signal, ending), signal.default_int_handler)
    os.environ.clear()
    os.environ.update(environment)
    try:
        with contextlib.suppress(KeyboardInterrupt, OSError):  # nobody listens any more
            _work(plan, facts, there)
    except Exception:
        complain_of_fault()
        sys.exit(1)


def _work(plan: Plan, facts: Facts, there: Connection) -> None:
    try:
        with contextlib.closing(set_up(plan)) as testbed:
            testbed.meet_again(facts)
            checker = Checker(plan, testbed)
            checks = {it.name: it for it in selected(plan)}
            while name := _next(there):
                there.send((WorkerMessage.TOLD, checker.run(checks[name])))
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # it ends already
            checker.look_after()
            there.send((WorkerMessage.LEFT, checker.traffic))
    except (NoVerdict, Usage) as error:
        there.send((WorkerMessage.NO_VERDICT, str(error)))


def _next(there: Connection) -> str:
    """The check that is dealt next; nothing if none is left, or nobody listens any more."""
    there.send((WorkerMessage.READY, None))
    try:
        name: str = there.recv()
    except EOFError:
        return ""
    return name


def dealt(checks: Mapping[str, Check], plan: Plan) -> list[str]:
    """The order in which workers are dealt checks: long ones first; or, in a run that has a time to
    keep to, the shortest of each requirement, those of what must be before those of what should.

    How long a check took once on the reference pair is an estimate, and decides nothing else; one
    that nobody has measured may be the longest. What may crash a testee needs no place of its own:
    a worker starts another.
    """
    seconds = durations(plan)
    if not plan.within:
        return sorted(checks, key=lambda name: -seconds.get(name, math.inf))
    known, before = requirements("1.1"), Counter[str]()
    urgency: dict[str, tuple[bool, int]] = {}
    shortest_first = sorted(checks, key=lambda name: seconds.get(name, math.inf))
    for name in shortest_first:
        id = checks[name].requirement
        urgency[name] = not known[id].level.startswith("MUST"), before[id]
        before[id] += 1
    return sorted(shortest_first, key=urgency.__getitem__)


def durations(plan: Plan) -> dict[str, float]:
    """How many seconds checks took once, by their names."""
    stored: dict[str, dict[str, float]] = read_json("durations.json")
    return stored[plan.side] | (stored[f"{plan.side} full"] if plan.profile in THOROUGH else {})
