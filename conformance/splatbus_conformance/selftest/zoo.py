"""Every mutant and every allowed variation."""

import importlib
import pkgutil
from collections.abc import Iterator
from types import ModuleType
from typing import TypeVar

from splatbus_conformance.selftest import mutants as families
from splatbus_conformance.selftest import variations as allowed
from splatbus_conformance.selftest.specimen import Mutant, Variation

S = TypeVar("S", Mutant, Variation)


def mutants() -> tuple[Mutant, ...]:
    """Every mutant, family by family, each in the order of its module."""
    return tuple(each for module in _families() for each in _declared(module, Mutant))


def variations() -> tuple[Variation, ...]:
    """Every allowed variation."""
    return tuple(_declared(allowed, Variation))


def _families() -> Iterator[ModuleType]:
    for found in pkgutil.iter_modules(families.__path__, f"{families.__name__}."):
        if not found.name.endswith("__main__"):
            yield importlib.import_module(found.name)


def _declared(module: ModuleType, kind: type[S]) -> Iterator[S]:
    for value in vars(module).values():
        specimen = getattr(value, "specimen", None)
        if isinstance(specimen, kind):
            yield specimen
