"""Every mutant and every allowed variation, of the client and of the server."""

import importlib
import pkgutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from tests.zoo import mutants as families
from tests.zoo import variations as allowed
from tests.zoo.machine.specimens import MachineMade, machine_made
from tests.zoo.mutant import SERVERS, SIDES, Mutant, Variation

S = TypeVar("S", Mutant, Variation)
Specimens = tuple[Mutant | Variation, ...]


def mutants() -> tuple[Mutant, ...]:
    """Every mutant, family by family, each in the order of its module."""
    found = [each for module in _modules(families) for each in _declared(module, Mutant)]
    return tuple(sorted(found, key=lambda it: SIDES.index(it.side)))


def variations() -> tuple[Variation, ...]:
    """Every allowed variation."""
    return tuple(it for it in _allowed() if not it.members)


def groups() -> tuple[Variation, ...]:
    """Those that take the liberties of several at once."""
    return tuple(it for it in _allowed() if it.members)


@cache
def _allowed() -> tuple[Variation, ...]:
    return tuple(each for module in _modules(allowed) for each in _declared(module, Variation))


def specimen_named(name: str) -> Mutant | Variation | MachineMade | None:
    """A mutant or variation, or one made by machine; no module is imported but the one that
    declares it.
    """
    if made := machine_made(name):
        return made
    names = {name, name.removeprefix(SERVERS)}
    declared = [f"\ndef {it.replace('-', '_')}(" for it in names]
    for package in (families, allowed):
        folder = Path(package.__path__[0])
        for path in sorted(folder.rglob("*.py")):
            text = path.read_text("utf-8")
            if any(it in text for it in declared):
                inside = path.relative_to(folder).with_suffix("").parts
                module = importlib.import_module(".".join((package.__name__, *inside)))
                found: Specimens = (*_declared(module, Mutant), *_declared(module, Variation))
                if named := [it for it in found if it.name == name]:
                    return named[0]
    return None


def _modules(package: ModuleType) -> Iterator[ModuleType]:
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not found.name.endswith("__main__"):
            yield importlib.import_module(found.name)


def _declared(module: ModuleType, kind: type[S]) -> Iterator[S]:
    for value in vars(module).values():
        for specimen in getattr(value, "specimens", ()):
            if isinstance(specimen, kind) and specimen.alter.__module__ == module.__name__:
                yield specimen
