"""What is said of a client or server that the harness is tried on, and how one is declared."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from splatbus_conformance.plan import Side

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam

Alter = Callable[[Patch], None]
A = TypeVar("A", bound=Callable[..., Any])

SIDES: tuple[Side, Side] = ("client", "server")
SERVERS = "server-"
"""With what the name of a server's begins whose alteration is a client's, too."""
RULE = "rule"
"""The name under which a report lists what passive rules found."""
TRAFFIC: dict[Side, str] = {"client": "CHN-10", "server": "FRM-4"}
"""The requirement whose checks make usual traffic."""


@dataclass(frozen=True)
class Mutant:
    """The reference client or server with one behaviour broken."""

    name: str
    does: str
    alter: Alter
    """Overrides the behaviour, from outside, before the program starts."""
    requirement: str
    """The one requirement that it breaks."""
    check: str
    """The check that has to find out, or RULE."""
    code: str
    """That of the failure: the check found this, not something else."""
    through: str
    """The requirement whose checks have to run: its own, or one that makes traffic for a rule."""
    side: Side
    """Which of the reference pair it is."""
    axes: str = ""
    """Of the engine whose client it plays, beside its adapter; without an adapter if not given."""


@dataclass(frozen=True)
class Variation:
    """The reference client or server made unusual, but conforming."""

    name: str
    does: str
    alter: Alter
    warns: frozenset[str]
    """The advice that it does not follow: SHOULDs that must warn, and no others."""
    axes: str = ""
    """As of a mutant."""
    members: tuple[str, ...] = ()
    """Of which variations it takes the liberties, all at once; of none but its own if empty."""

    @property
    def side(self) -> Side:
        """Which of the reference pair it is."""
        return _side(self.alter)


def mutant(
    requirement: str,
    *,
    check: str = RULE,
    code: str,
    through: str = "",
    axes: str = "",
    both: bool = False,
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
        at: the seam; the function is given the original step first, then its arguments.
    """

    def declare(function: A) -> A:
        name, does = _name_and_docstring(function)
        alter = _alteration(function, at)
        tried: dict[str, Side] = {name: _side(function)}
        if both:
            tried[f"{SERVERS}{name}"] = "server"
        function.specimens = tuple(  # type: ignore[attr-defined]
            Mutant(name, does, alter, requirement, check, code, run, side, axes)
            for name, side in tried.items()
            for run in [requirement if check != RULE else through or TRAFFIC[side]]
        )
        return function

    return declare


def variation(
    *, warns: tuple[str, ...] = (), axes: str = "", at: Seam | None = None
) -> Callable[[A], A]:
    """Declare a function to be an allowed variation; `axes` and `at` as of a mutant."""

    def declare(function: A) -> A:
        name, does = _name_and_docstring(function)
        alter = _alteration(function, at)
        function.specimens = (Variation(name, does, alter, frozenset(warns), axes),)  # type: ignore[attr-defined]
        return function

    return declare


def together(*members: Alter) -> Callable[[A], A]:
    """Declare variations whose liberties go together, to be judged at once.

    The function that is declared does nothing; its docstring says what they have in common.
    """
    variations: list[Variation] = [it for each in members for it in each.specimens]  # type: ignore[attr-defined]
    warns = frozenset[str]().union(*(it.warns for it in variations))
    (axes,) = {it.axes for it in variations}

    def declare(alter: A) -> A:
        name, does = _name_and_docstring(alter)

        @functools.wraps(alter)
        def alter_all(patch: Patch) -> None:
            for it in variations:
                it.alter(patch)

        names = tuple(it.name for it in variations)
        alter.specimens = (Variation(name, does, alter_all, warns, axes, names),)  # type: ignore[attr-defined]
        return alter

    return declare


def _alteration(function: Callable[..., Any], at: Seam | None) -> Alter:
    if at is None:
        return function

    @functools.wraps(function)
    def alter(patch: Patch) -> None:
        at.wrap(patch, function)

    return alter


def _side(alter: Alter) -> Side:
    return "server" if alter.__name__.startswith("server") else "client"


def _name_and_docstring(alter: Alter) -> tuple[str, str]:
    does = inspect.getdoc(alter)
    assert does, f"{alter.__name__} does not say what it does"
    return alter.__name__.replace("_", "-"), " ".join(does.split())
