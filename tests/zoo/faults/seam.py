"""A point of the reference programs at which a fault is put in."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tests.zoo.faults.patching import Patch


@dataclass(frozen=True)
class Seam:
    """A step, a value or a part of a reference program that a mutant can put another in place of.

    AttributeError if there is no such name: then the program changed, and the mutant has to.
    """

    owner: object
    """A module or a class."""
    name: str
    """What it calls the step: public, since nothing else stays."""

    def __post_init__(self) -> None:
        getattr(self.owner, self.name)

    def replace(self, patch: Patch, value: object) -> None:
        """Put this in its place."""
        patch.setattr(self.owner, self.name, value)

    def wrap(self, patch: Patch, around: Callable[..., Any]) -> None:
        """Put `around` in its place, which is given the original first, then its arguments."""
        original = getattr(self.owner, self.name)

        @functools.wraps(original)
        def replaced(*arguments: Any, **named: Any) -> Any:
            return around(original, *arguments, **named)

        self.replace(patch, replaced)
