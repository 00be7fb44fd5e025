"""Every specimen: the reference pair, what is allowed of it, and what is broken of it."""

import importlib
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from tests.zoo.homes import HOMES, Home, Judge
from tests.zoo.mutant import IN_DEVICE_MEMORY, SERVERS, SIDES, Kind, Specimen

HAS_CUDA = find_spec("cuda") is not None
"""Without cuda-bindings nobody has images in memory of a GPU."""
ROOT = Path(__file__).parents[2]
REFERENCES = tuple(
    Specimen(name, does, lambda patch: None, Kind.REFERENCE, home, home.axes)
    for name, home in {
        "reference-client": Home("client"),
        "reference-client-beside-its-adapter": Home("client", axes="unity"),
        "reference-server": Home("server"),
        "reference-server-that-wants-a-token": Home("server"),
    }.items()
    for does in [f"the reference {home.side} as it is"]
)


@cache
def specimens() -> tuple[Specimen, ...]:
    """All: the reference pair, liberties that are taken at once, each liberty, and the mutants of
    each side, family by family.
    """
    declared = [
        it
        for module, home in HOMES.items()
        if home.judge is not Judge.WITH_CUDA or HAS_CUDA
        for it in _declared(module)
        if it.home.judge is not Judge.WITH_CUDA or HAS_CUDA
    ]
    variations = [it for it in declared if it.kind is Kind.VARIATION]
    mutants = [it for it in declared if it.kind is Kind.MUTANT]
    variations.sort(key=lambda it: not it.members)
    mutants.sort(key=lambda it: SIDES.index(it.side))
    return *REFERENCES, *variations, *mutants


def mutants() -> tuple[Specimen, ...]:
    """Every mutant."""
    return tuple(it for it in specimens() if it.kind is Kind.MUTANT)


def variations() -> tuple[Specimen, ...]:
    """Every allowed variation."""
    return tuple(it for it in specimens() if it.kind is Kind.VARIATION and not it.members)


def groups() -> tuple[Specimen, ...]:
    """Those that take the liberties of several at once."""
    return tuple(it for it in specimens() if it.members)


def specimen_named(name: str) -> Specimen | None:
    """The one of this name; only the module that declares it is imported."""
    names = {name, name.removeprefix(SERVERS), name.removesuffix(IN_DEVICE_MEMORY)}
    spelled = [f"\ndef {it.replace('-', '_')}(" for it in names]
    for module in HOMES:
        text = Path(ROOT, *module.split(".")).with_suffix(".py").read_text("utf-8")
        found = _declared(module) if any(it in text for it in spelled) else ()
        if named := [it for it in found if it.name == name]:
            return named[0]
    return None


def _declared(module: str) -> Iterator[Specimen]:
    for value in vars(importlib.import_module(module)).values():
        for specimen in getattr(value, "specimens", ()):
            if specimen.alter.__module__ == module:
                yield specimen
