"""Several testees at a time: pytest-xdist starts workers, and each has a stand of its own.

A worker loads this module as a plugin (`-p`). The controller hands it the plan and the user's
environment, which the testee has to find as it was.
"""

import atexit
import base64
import contextlib
import json
import os
import pickle
import signal
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, TypeVar

import pytest

from splatbus_conformance.data import read_json
from splatbus_conformance.findings import Findings, Traffic
from splatbus_conformance.plan import NoVerdict, Plan, Usage
from splatbus_conformance.plugin import CheckPlugin, declared
from splatbus_conformance.stand import Facts, Stand, set_up
from splatbus_conformance.trial import THOROUGH

T = TypeVar("T")
GIVEN, NO_VERDICT, LEFT = "splatbus_given", "splatbus_no_verdict", "splatbus_left"
"""What a worker is given, and what it gives back at its end: the last two, where there are any."""
USUAL_SECONDS = 0.2


def arguments(workers: int) -> list[str]:
    """What pytest is told, so that it starts workers and deals them one check after the other."""
    return [
        *("-p", "xdist.plugin", "-p", __name__),
        *("-n", str(workers), "--dist", "load", "--maxschedchunk", "1"),
    ]


class Controller:
    """The plugin of the process that starts the workers."""

    def __init__(
        self, plan: Plan, environment: Mapping[str, str], facts: Facts, findings: Findings
    ) -> None:
        self.findings = findings
        self.no_verdict = ""
        """Why a worker could not meet its testee."""
        self._given = json.dumps(
            {
                "plan": plan.as_text(),
                "environment": dict(environment),
                "facts": base64.b64encode(pickle.dumps(facts)).decode("ascii"),
            }
        )
        self._workers: list[int] = []

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """A worker is about to start."""
        node.workerinput[GIVEN] = self._given

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodeready(self, node: Any) -> None:
        """A worker has started."""
        self._workers.append(node.gateway._rinfo().pid)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """A worker has ended."""
        given_back: dict[str, Any] = getattr(node, "workeroutput", {})
        if left := given_back.get(LEFT):
            self.findings.traffic.add(Traffic.from_text(left))
        if text := given_back.get(NO_VERDICT):
            self.no_verdict = text
            pytest.exit(text)

    def pytest_keyboard_interrupt(self) -> None:
        """Let the workers end their testees at once, and not only when their check is through."""
        for pid in self._workers if os.name == "posix" else ():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGINT)


class Worker:
    """The plugin of a worker: sets up its stand, for a testee that was met, and registers the
    checks.
    """

    def __init__(self, config: pytest.Config, given: str, workers: int) -> None:
        values = json.loads(given)
        os.environ.clear()
        os.environ.update(values["environment"])
        self.config, self.workers = config, workers
        self.plan = Plan.from_text(values["plan"])
        self.facts: Facts = pickle.loads(base64.b64decode(values["facts"]))
        self.stand: Stand | None = None
        self.checks: CheckPlugin | None = None

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self) -> None:
        """Start the testee, before the checks are asked for."""
        try:
            self.stand = set_up(self.plan)
            self.stand.meet_again(self.facts)
        except (NoVerdict, Usage) as error:
            self.config.workeroutput[NO_VERDICT] = _printable(str(error))  # type: ignore[attr-defined]
            pytest.exit("the testee was not met")
        profile = "full" if self.plan.profile in THOROUGH else "quick"
        order = partial(dealt, workers=self.workers, profile=profile)
        self.checks = CheckPlugin(self.plan, self.stand, order)
        self.config.pluginmanager.register(self.checks)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self) -> None:
        """End the testee: without a controller, nothing that comes later is called."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # it ends already
        if self.checks:
            self.checks.look_after()
            self.config.workeroutput[LEFT] = self.checks.traffic.as_text()  # type: ignore[attr-defined]
        if self.stand:
            self.stand.close()
        # All is given back; taking down each module first would take longer than many a check.
        atexit.register(os._exit, 0)


def pytest_configure(config: pytest.Config) -> None:
    """Be a worker, if this process is one."""
    workerinput: dict[str, Any] | None = getattr(config, "workerinput", None)
    if workerinput is not None:
        worker = Worker(config, workerinput[GIVEN], workerinput["workercount"])
        config.pluginmanager.register(worker)


def dealt(items: list[pytest.Item], workers: int, profile: str) -> list[pytest.Item]:
    """The order in which workers are dealt checks: long ones first, those that may crash last.

    How long a check took once on the reference client is an estimate, and decides nothing else.
    """
    durations: dict[str, float] = read_json("durations.json")[profile]
    ordered = sorted(
        items,
        key=lambda it: (declared(it).may_crash, -durations.get(it.name, USUAL_SECONDS)),
    )
    return paired(ordered, workers)


def paired(ordered: Sequence[T], workers: int) -> list[T]:
    """Each worker is dealt two to begin with: give each that has a long one a short one with it."""
    first, rest = ordered[: 2 * workers], ordered[2 * workers :]
    if len(first) < 2 * workers:
        return list(ordered)
    pairs = zip(first[:workers], reversed(first[workers:]), strict=True)
    return [item for pair in pairs for item in pair] + list(rest)


def _printable(text: str) -> str:
    """Without what cannot be sent: half a pair of surrogates."""
    return text.encode("utf-8", "replace").decode("utf-8")
