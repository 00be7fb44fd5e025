"""`images.json`: depth of what a rasteriser accumulates, and compositing."""

import math
from collections.abc import Sequence
from fractions import Fraction

from splatbus_conformance.oracle.images import composite, planar_depth
from splatbus_conformance.oracle.rounding import SINGLE_MAX, to_single
from splatbus_conformance.oracle.vectors.layout import Json, both, exactly, within


def single(value: float) -> float:
    """Return the single-precision number nearest to a decimal, as a float."""
    return to_single(Fraction(value)) if math.isfinite(value) else value


FIRST_COVERED = single(1 / 255)
LARGEST = float(SINGLE_MAX)

DEPTHS: dict[str, tuple[float, float | None]] = {
    "opaque": (0.25, 1.0),
    "half transparent: A/d, not 1/d": (0.125, 0.5),
    "no alpha: A is 1": (0.25, None),
    "a third": (3.0, 1.0),
    "two layers, at 2 and at 10": (0.3, 1.0),
    "rounding that a reciprocal and a product would miss": (0.7, 0.9),
    "far: no cut on d": (1e-6, 1.0),
    "twice as near": (2e-6, 1.0),
    "the least alpha that is covered": (0.001, FIRST_COVERED),
    "an alpha just below it": (0.001, single(0.003921568)),
    "alpha 0": (0.001, 0.0),
    "alpha a little above 1": (0.5, single(1.0000001)),
    "a quotient that overflows": (1e-45, 1.0),
    "a quotient just below the overflow": (2.0**-128 + 2.0**-149, 1.0),
    "d is 0": (0.0, 1.0),
    "d is negative": (-0.25, 1.0),
    "d is infinite": (math.inf, 1.0),
    "d is no number": (math.nan, 1.0),
    "alpha is infinite": (0.25, math.inf),
    "alpha is no number": (0.25, math.nan),
}

Pixel = tuple[float, ...]
GREY = (0.25, 0.25, 0.25)

COMPOSITES: dict[str, tuple[bool, Pixel, float, Pixel, float]] = {
    "straight over black": (False, (0.5, 0.5, 0.5, 0.5), 4.0, (0.0, 0.0, 0.0), 10.0),
    "straight over grey": (False, (0.5, 0.25, 1.0, 0.5), 4.0, GREY, 10.0),
    "premultiplied over grey": (True, (0.25, 0.125, 0.5, 0.5), 4.0, GREY, 10.0),
    "straight, tenths": (False, (0.1, 0.2, 0.3, 0.7), 4.0, (0.9, 0.8, 0.6), math.inf),
    "premultiplied, tenths": (True, (0.07, 0.14, 0.21, 0.7), 4.0, (0.9, 0.8, 0.6), math.inf),
    "opaque over colour": (False, (0.1, 0.2, 0.3, 1.0), 4.0, (0.9, 0.8, 0.6), 10.0),
    "nearly opaque": (False, (0.1, 0.2, 0.0, 0.99999994), 4.0, (0.9, 0.8, 0.7), 10.0),
    "a faint splat": (False, (0.1, 0.2, 0.3, 1e-30), 4.0, (0.9, 0.0, 0.6), 10.0),
    "behind the geometry": (False, (0.1, 0.2, 0.3, 1.0), 10.5, GREY, 10.0),
    "as deep as the geometry": (False, (0.1, 0.2, 0.3, 1.0), 10.0, GREY, 10.0),
    "empty: depth infinite": (False, (0.0, 0.0, 0.0, 0.0), math.inf, GREY, math.inf),
    "empty: depth 100, geometry beyond": (False, (0.0, 0.0, 0.0, 0.0), 100.0, GREY, 250.0),
    "depth 100 and alpha: a surface": (False, (1.0, 0.5, 0.0, 0.5), 100.0, GREY, 250.0),
    "depth is no number": (False, (1.0, 0.5, 0.0, 0.5), math.nan, GREY, 10.0),
    "depth 0": (False, (1.0, 0.5, 0.0, 0.5), 0.0, GREY, 10.0),
    "depth negative": (False, (1.0, 0.5, 0.0, 0.5), -4.0, GREY, 10.0),
}


def document() -> Json:
    """Return the whole file."""
    return {
        "$schema": "vectors.schema.json",
        "name": "images",
        "version": "1.0",
        "description": "One pixel a case; every given number is a single-precision one. `depth`:"
        " from inverse depth and alpha (null: the renderer gives none) to the planar depth, or"
        " +∞ where the pixel is empty; a server may store exactly 100.0 instead. `composite`: a"
        " pixel of splats (red, green, blue, alpha; straight or premultiplied) over one of the"
        " client's own geometry.",
        "requirements": ["ACC-8", "ACC-9", "ACC-10", "BUF-7", "BUF-8", "BUF-9"],
        "tolerances": {
            "depth": exactly("Correctly rounded to single precision."),
            "colour": within(
                "ulp_single", 2, "ACC-10", "ULP of single precision, at what is expected."
            ),
        },
        "cases": [
            *[_depth(name, *given) for name, given in DEPTHS.items()],
            *[_composite(name, *given) for name, given in COMPOSITES.items()],
        ],
    }


def _depth(name: str, inverse_depth: float, alpha: float | None) -> Json:
    d = single(inverse_depth)
    A = None if alpha is None else single(alpha)
    return {
        "name": name,
        "quantity": "depth",
        "inverse_depth": both(d),
        "alpha": None if A is None else both(A),
        "expected": both(planar_depth(d, 1.0 if A is None else A)),
    }


def _composite(
    name: str,
    premultiplied: bool,
    splat: Sequence[float],
    depth: float,
    background: Sequence[float],
    background_depth: float,
) -> Json:
    pixel, under = [single(a) for a in splat], [single(a) for a in background]
    colour = composite(pixel, depth, under, background_depth, premultiplied=premultiplied)
    return {
        "name": name,
        "quantity": "composite",
        "alpha": "premultiplied" if premultiplied else "straight",
        "splat": both(pixel),
        "splat_depth": both(depth),
        "background": both(under),
        "background_depth": both(background_depth),
        "expected": both(colour),
    }
