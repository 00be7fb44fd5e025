"""The reference with one change, or with its lines watched, as specimens that harnesses start.

They are named for the command line of the mutants: `machine/SIDE/AXES/CHANGE`, where AXES are those
of the engine that an adapter plays, and nothing without one; `lines/SIDE/AXES/FILE` is the
reference as it is, which writes into FILE which lines of the modules it executes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from splatbus_conformance.plan import Side

from tests.zoo.faults.patching import Patch
from tests.zoo.machine.importing import change_on_import
from tests.zoo.machine.lines import watch

CHANGED, WATCHED = "machine", "lines"
MAKES: dict[str, Callable[[str], None]] = {CHANGED: change_on_import, WATCHED: watch}


@dataclass(frozen=True)
class MachineMade:
    """What was not declared in the zoo."""

    how: str
    side: Side
    axes: str
    what: str
    """The change, or the file."""

    @property
    def name(self) -> str:
        """By which it is started."""
        return "/".join((self.how, self.side, self.axes, self.what))

    def alter(self, patch: Patch) -> None:
        """Before the reference is imported."""
        MAKES[self.how](self.what)


def machine_made(name: str) -> MachineMade | None:
    """The specimen of this name, if it is one of these."""
    how, *rest = name.split("/", 3)
    if how not in MAKES or len(rest) != 3:
        return None
    side, axes, what = rest
    return MachineMade(how, cast(Side, side), axes, what)
