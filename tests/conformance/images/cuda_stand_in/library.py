"""What tests with the stand-in share: the library if it can be had, and what checks find."""

import inspect
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import ModuleType

import pytest
from splatbus_conformance.checks import Check, registry
from splatbus_conformance.images.memory.cuda_stand_in.building import NotAvailable, library_folder
from splatbus_conformance.images.memory.cuda_stand_in.session import StandIn
from splatbus_conformance.plan import Plan
from splatbus_conformance.run.testbed import set_up
from splatbus_conformance.trials.trial import NotObservable, Violation
from splatbus_schemas.requirements import requirements


def library() -> str:
    """The path of the library; skips the test where there is no compiler."""
    try:
        return str(library_folder() / "libcudart.so")
    except NotAvailable as error:
        pytest.skip(str(error))


@contextmanager
def stand_in() -> Iterator[StandIn]:
    library()
    found = StandIn()
    try:
        yield found
    finally:
        found.close()


def checks_in(*modules: ModuleType) -> dict[str, Check]:
    """The checks of these modules, each of one side, by name."""
    return {
        name: check
        for module in modules
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if name.startswith("check_")
        for check in registry.checks_in(function).values()
    }


def findings_of(plan: Plan, checks: Mapping[str, Check]) -> dict[str, str]:
    """What each of these checks finds: an empty text for a pass, wherever it can be tried."""
    testbed = set_up(plan)
    found = {}
    try:
        testbed.introduce()
        for name, check in checks.items():
            assert check.lacks(testbed.facts) is None
            trial = testbed.trial(requirements("1.1")[check.requirement])
            found[name] = ""
            try:
                check.play(trial)
                assert trial.delivered
                tried = check.shown_at(testbed.facts)
                unseen = [why for place, why in trial.unseen.items() if not tried[place]]
                found[name] = "".join(f"skipped: {why}" for why in unseen)
            except Violation as violation:
                found[name] = str(violation)
            except NotObservable as skipped:
                found[name] = f"skipped: {skipped}"
            if testbed.testee.ended():
                trial.end_testee()
    finally:
        testbed.close()
    return found
