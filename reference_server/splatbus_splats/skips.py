"""What is not done because it would not be seen, each with a switch.

`EXACT` ones leave every bit of the picture as it is, but for roundings; what the others cost in
accuracy, and what each saves, is in `benchmarks/SPLATS.md`.
"""

from __future__ import annotations

from enum import Flag, auto


class Skip(Flag):
    """One of them, or several."""

    OUTSIDE = auto()
    """Gaussians beside the image have neither shape nor colour."""
    FAINT = auto()
    """Those of an opacity below 1/255 are left out, and others reach no farther than is seen."""
    HIDDEN = auto()
    """A block of pixels behind which all is opaque is finished."""
    CHANNELS = auto()
    """Depth is not summed, nor colour evaluated, where nobody reads it."""
    BANDS = auto()
    """Harmonics of bands that are zero in the whole object are not evaluated."""
    TILES = auto()
    """A tile in which nothing changed is kept: objects move before a camera that rests."""
    HALVES = auto()
    """Harmonics are kept in float16, which halves the memory that they take, and its traffic."""
    MOVING = auto()
    """While the camera moves, one pixel is drawn of four, and the others between them."""
    FAR = auto()
    """A Gaussian smaller than a pixel has the same colour from everywhere."""
    SMALL = auto()
    """One whose share of a pixel's area, times its opacity, is below 1/255 is left out."""


EXACT = Skip.OUTSIDE | Skip.FAINT | Skip.HIDDEN | Skip.CHANNELS | Skip.BANDS | Skip.TILES
USUAL = EXACT | Skip.MOVING
"""At rest, the picture is that of the definition to 1/255."""
NOTHING = Skip(0)


def named(text: str) -> Skip:
    """The skips that a text such as `hidden,faint` names; `all`, `usual` and `none` are names too.

    Raises:
        ValueError: there is no such skip.
    """
    groups = {"all": ~NOTHING, "usual": USUAL, "none": NOTHING}
    found = NOTHING
    for name in text.lower().split(","):
        if name in groups:
            found |= groups[name]
        elif name.upper() in Skip.__members__:
            found |= Skip[name.upper()]
        else:
            known = ", ".join(each.lower() for each in (*groups, *Skip.__members__))
            raise ValueError(f"{name!r} is none of {known}")
    return found
