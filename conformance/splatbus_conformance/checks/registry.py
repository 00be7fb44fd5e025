"""Which requirement is judged by what, and which is not and why: no third state.

Checks and rules declare what they judge; `exclusions.json` gives the reason for the rest.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

from splatbus_schemas.requirements import Requirement, requirements

from splatbus_conformance import checks
from splatbus_conformance.checks import Check, paragraph
from splatbus_conformance.data import read_json
from splatbus_conformance.plan import Side
from splatbus_conformance.rules import all_rules


class Judge(NamedTuple):
    """A check or a rule."""

    name: str
    level: str
    what: str
    """What it does, in a sentence or two."""


class Exclusion(NamedTuple):
    """Why a requirement is not judged."""

    visible_at: str
    """The assurance level at which it could be seen; `none` if at no level."""
    reason: str


@cache
def checks_of(side: Side) -> tuple[Check, ...]:
    """Every check that judges this side, module by module."""
    modules = [
        importlib.import_module(module.name)
        for module in pkgutil.walk_packages(checks.__path__, f"{checks.__name__}.")
        if not module.ispkg
    ]
    return tuple(
        check
        for module in modules
        for name, function in vars(module).items()
        if name.startswith("check_") and (check := checks_in(function).get(side))
    )


def checks_in(function: Any) -> Mapping[Side, Check]:
    """What a function was declared to be, for each side that it judges."""
    found: Mapping[Side, Check] = getattr(function, "checks", {})
    return found


@cache
def judges(peer: Side) -> Mapping[str, list[Judge]]:
    """For each requirement, the checks and rules that judge this peer by it."""
    found: dict[str, list[Judge]] = {}
    known = requirements("1.1")
    for rule in all_rules():
        for name in rule.judges:
            if peer in known[name].binds:
                what = paragraph(rule.__doc__)
                found.setdefault(name, []).append(Judge(rule.__name__, "L0", what))
    for check in checks_of(peer):
        found.setdefault(check.requirement, []).append(Judge(check.name, check.level, check.does))
    return found


@cache
def exclusions(peer: str) -> Mapping[str, Exclusion]:
    """For each requirement that is not judged on this peer, why."""
    return {
        name: Exclusion(group["visibleAt"], group["reason"])
        for group in read_json("exclusions.json")[peer]
        for name in group["ids"]
    }


def bound(peer: str) -> Mapping[str, Requirement]:
    """The requirements that bind this peer."""
    return {name: r for name, r in requirements("1.1").items() if peer in r.binds}
