"""What is said of a client or server that is judged, and how one is declared."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, TypeVar

from splatbus_conformance.plan import Side

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam
from tests.zoo.homes import HOMES, Home, Judge

Alter = Callable[[Patch], None]
A = TypeVar("A", bound=Callable[..., Any])

SIDES: tuple[Side, Side] = ("client", "server")
SERVERS = "server-"
"""With what the name of a server's begins whose alteration is a client's, too."""
IN_DEVICE_MEMORY = "-in-device-memory"
"""With what the name of a server's ends whose images of 1.0 lie there, and which lends none."""
RULE = "rule"
"""The name under which a report lists what passive rules found."""
TRAFFIC: dict[Side, str] = {"client": "CHN-10", "server": "FRM-4"}
"""The requirement whose checks make usual traffic."""


class Kind(StrEnum):
    """What a specimen is for."""

    REFERENCE = "reference"
    """One of the reference pair as it is: it has to pass."""
    VARIATION = "variation"
    """It is made unusual, but conforming, and has to pass too."""
    MUTANT = "mutant"
    """One behaviour is broken, and has to be found out."""


@dataclass(frozen=True)
class Specimen:
    """The reference client or server, altered."""

    name: str
    does: str
    alter: Alter
    """Overrides a behaviour, from outside, before the program starts."""
    kind: Kind
    home: Home
    axes: str = ""
    """Of the engine whose client it plays, beside its adapter; without an adapter if not given."""
    requirement: str = ""
    """The one that a mutant breaks; none where an invariant has to find it out."""
    check: str = ""
    """The check that has to find out, or RULE, or the invariant."""
    code: str = ""
    """That of the failure: the check found this, not something else."""
    through: str = ""
    """The requirement whose checks have to run: its own, or one that makes traffic for a rule."""
    warns: frozenset[str] = frozenset()
    """The advice that a variation does not follow: SHOULDs that must warn, and no others."""
    members: tuple[str, ...] = ()
    """Of which variations it takes the liberties, all at once; of none but its own if empty."""

    @property
    def side(self) -> Side:
        """Which of the reference pair it is."""
        return self.home.side


def mutant(
    requirement: str = "",
    *,
    check: str = RULE,
    code: str = "",
    through: str = "",
    axes: str = "",
    both: bool = False,
    in_device_memory: bool = False,
    at: Seam | None = None,
) -> Callable[[A], A]:
    """Declare a function to be the alteration of a mutant, or the step that it has in place of that
    of a seam; its docstring says what it does.

    Args:
        requirement: that it breaks.
        check: that has to find out; a passive rule if not given.
        code: that the failure has to have.
        through: for a rule, the requirement whose check makes the traffic that it judges; a usual
            session if not given.
        axes: for what only an adapter shows, the engine whose client it plays.
        both: what is altered is what client and server share, and both are tried.
        in_device_memory: a server is tried a second time, which stores its images there.
        at: the seam; the function is given the original step first, then its arguments.
    """

    def declare(function: A) -> A:
        name, does, alter, home = _read(function, at)
        tried = {name: (alter, home)}
        if both:
            tried[f"{SERVERS}{name}"] = alter, Home("server")
        if in_device_memory:
            there = Home("server", Judge.WITH_CUDA)
            tried[f"{name}{IN_DEVICE_MEMORY}"] = _made_at(there, alter, lends=False), there
        function.specimens = tuple(  # type: ignore[attr-defined]
            Specimen(
                *(each, does, made, Kind.MUTANT, where, axes or where.axes),
                *(requirement, check, code),
                requirement if check != RULE else through or TRAFFIC[where.side],
            )
            for each, (made, where) in tried.items()
        )
        return function

    return declare


def variation(
    *, warns: tuple[str, ...] = (), axes: str = "", at: Seam | None = None
) -> Callable[[A], A]:
    """Declare a function to be an allowed variation; `axes` and `at` as of a mutant."""

    def declare(function: A) -> A:
        name, does, alter, home = _read(function, at)
        given = name, does, alter, Kind.VARIATION, home, axes or home.axes
        function.specimens = (Specimen(*given, warns=frozenset(warns)),)  # type: ignore[attr-defined]
        return function

    return declare


def together(*members: Alter) -> Callable[[A], A]:
    """Declare variations whose liberties go together, to be judged at once.

    The function that is declared does nothing; its docstring says what they have in common.
    """
    taken: list[Specimen] = [it for each in members for it in each.specimens]  # type: ignore[attr-defined]
    warns = frozenset[str]().union(*(it.warns for it in taken))
    (axes,) = {it.axes for it in taken}

    def declare(function: A) -> A:
        @functools.wraps(function)
        def alter(patch: Patch) -> None:
            for it in taken:
                it.alter(patch)

        variation(warns=tuple(warns), axes=axes)(alter)
        (all_,) = alter.specimens  # type: ignore[attr-defined]
        names = tuple(it.name for it in taken)
        function.specimens = (replace(all_, members=names),)  # type: ignore[attr-defined]
        return function

    return declare


def _read(function: Callable[..., Any], at: Seam | None) -> tuple[str, str, Alter, Home]:
    """Its name, what it does, how that alters a program, and where it lives."""
    name, does = function.__name__, inspect.getdoc(function)
    assert does, f"{name} does not say what it does"

    @functools.wraps(function)
    def alter(patch: Patch) -> None:
        if at is None:
            function(patch)
        else:
            at.wrap(patch, function)

    home = HOMES[function.__module__]
    return name.replace("_", "-"), " ".join(does.split()), _made_at(home, alter), home


def _made_at(home: Home, alter: Alter, *, lends: bool = True) -> Alter:
    """How that is altered which has this home: of a server, with its images there."""
    if home != Home("server", Judge.WITH_CUDA):
        return alter

    @functools.wraps(alter)
    def moved(patch: Patch) -> None:
        from tests.zoo.faults import device  # only here: it takes cuda-bindings

        device.keeps_images_there(patch, lends=lends)
        alter(patch)

    return moved
