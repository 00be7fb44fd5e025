"""Replaces parts of a program that runs; the process ends with it, so nothing is put back."""

from collections.abc import MutableMapping
from typing import Any


class Patch:
    """Replaces attributes and items.

    `pytest.MonkeyPatch` does as much, but takes longer to import than the reference to start.
    """

    def setattr(self, owner: object, name: str, value: object) -> None:
        """Replace an attribute."""
        setattr(owner, name, value)

    def setitem(self, mapping: MutableMapping[str, Any], key: str, value: Any) -> None:
        """Set an item."""
        mapping[key] = value
