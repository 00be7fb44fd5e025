"""What is not done because it would not be seen, each with a switch.

`EXACT` ones leave the picture as it is, but for roundings; what the others cost in accuracy, and
what each saves, is in `benchmarks/SPLATS.md`.
"""

from __future__ import annotations

from enum import Flag, auto


class Skip(Flag):
    """One of them, or several; `MEANINGS` says what each is."""

    OUTSIDE = auto()
    HIDDEN = auto()
    TILES = auto()
    MOVING = auto()
    SMALL = auto()


MEANINGS = {
    "outside": "Gaussians beside the image, and whole runs of them",
    "hidden": "Gaussians behind pixels that are already opaque, and whole runs of them",
    "tiles": "tiles in which nothing changed, as where one object moves and the camera rests",
    "moving": "three pixels of four while the camera moves",
    "small": "Gaussians whose share of a pixel's area, times their opacity, is below 1/255",
}
NOTHING = Skip(0)
EXACT = Skip.OUTSIDE | Skip.HIDDEN | Skip.TILES
USUAL = EXACT | Skip.MOVING
"""At rest, the picture is that of the definition to 1/255."""
GROUPS = {"none": NOTHING, "exact": EXACT, "usual": USUAL, "all": ~NOTHING}


def named(text: str) -> Skip:
    """The skips that a text such as `hidden,tiles` names; the names of `GROUPS` are names too.

    Raises:
        ValueError: there is no such skip.
    """
    found = NOTHING
    for name in text.lower().split(","):
        if name in GROUPS:
            found |= GROUPS[name]
        elif name in MEANINGS:
            found |= Skip[name.upper()]
        else:
            known = ", ".join((*GROUPS, *MEANINGS))
            raise ValueError(f"{name!r}: give names of {known}, such as hidden,tiles")
    return found
