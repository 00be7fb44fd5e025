"""Replaces parts of a program that runs; the process ends with it, so nothing is put back."""

from collections.abc import MutableMapping
from typing import Any


class Patch:
    """Replaces what is there; what is not there any more is an error, for the mutant has to follow.

    `pytest.MonkeyPatch` does as much, but takes longer to import than the reference to start.
    """

    def setattr(self, owner: object, name: str, value: object, raising: bool = True) -> None:
        """Replace an attribute; AttributeError if there is none, unless that is expected."""
        if raising:
            getattr(owner, name)
        setattr(owner, name, value)

    def setitem(self, mapping: MutableMapping[str, Any], key: str, value: Any) -> None:
        """Set an item."""
        mapping[key] = value
