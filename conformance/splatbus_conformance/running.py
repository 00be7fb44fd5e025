"""Run the checks against a testee and gather the results."""

import os
from collections.abc import Mapping
from pathlib import Path

import pytest

import splatbus_conformance.checks
from splatbus_conformance.plugin import CheckPlugin, Run, of_run
from splatbus_conformance.rules import sightings
from splatbus_conformance.verdicts import Level, Result, Verdict, failing

ISOLATED = {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
FOREIGN = ("PYTEST_ADDOPTS", "PYTEST_PLUGINS")


class Interrupted(Exception):  # noqa: N818 - a finding, no error of ours
    """Somebody pressed Ctrl-C."""


def run_checks(run: Run) -> list[Result]:
    """Run every check that the run selects, then judge all that crossed the wire by the rules.

    The user's own pytest configuration, options and plugins have no part in it. Raises Interrupted.
    """
    folder = Path(splatbus_conformance.checks.__file__).parent / run.plan.side
    arguments = [
        str(folder),
        *("-c", os.devnull, "--rootdir", str(folder), "--import-mode=importlib"),
        *("-p", "no:cacheprovider", "-p", "no:terminal", "-p", "no:logging"),
        *("-p", "no:faulthandler", "-p", "no:warnings", "--capture=no"),
        *("-o", "python_files=*.py", "-o", "python_functions=check_*"),
    ]
    before = dict(os.environ)
    os.environ.update(ISOLATED)
    for name in FOREIGN:
        os.environ.pop(name, None)
    try:
        status = pytest.main(arguments, plugins=[CheckPlugin(run)])
    finally:
        os.environ.clear()
        os.environ.update(before)
    if status == pytest.ExitCode.INTERRUPTED:
        raise Interrupted
    if status not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        run.results.append(
            Result("", "collection", Level.WIRE, Verdict.ERROR, f"pytest ended with {status!r}")
        )
    return run.results + passive_results(run)


def passive_results(run: Run) -> list[Result]:
    """What the rules say of the testee in all recordings of the run."""
    bound = of_run(run)
    seen: dict[str, int] = {}
    breaches: dict[str, tuple[int, str]] = {}
    for recording in run.recordings:
        for sighting in sightings(recording):
            if sighting.peer == run.plan.side and sighting.requirement in bound:
                seen[sighting.requirement] = seen.get(sighting.requirement, 0) + 1
                if sighting.breach:
                    times, first = breaches.get(sighting.requirement, (0, sighting.breach))
                    breaches[sighting.requirement] = (times + 1, first)
    return [_passive(name, count, breaches, bound[name].level) for name, count in seen.items()]


def _passive(
    requirement: str, count: int, breaches: Mapping[str, tuple[int, str]], level: str
) -> Result:
    times, first = breaches.get(requirement, (0, ""))
    if not times:
        return Result(
            requirement, "rule", Level.PASSIVE, Verdict.PASS, f"held {count} times of {count}"
        )
    return Result(
        requirement,
        "rule",
        Level.PASSIVE,
        failing(level),
        f"broken {times} times of {count}; first: {first}",
    )
