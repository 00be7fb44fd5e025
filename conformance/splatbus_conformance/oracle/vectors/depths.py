"""Cases of `images.json`: the depth of what a renderer gives, whatever its estimator."""

import math
from collections.abc import Callable

from splatbus_conformance.oracle.images import (
    accumulate,
    expected_depth,
    planar_depth,
    surface_depth,
)
from splatbus_conformance.oracle.rounding import SINGLE_MAX
from splatbus_conformance.oracle.vectors.layout import Json, both, single

FIRST_COVERED = single(1 / 255)
BELOW = single(0.003921568)
LARGEST = float(SINGLE_MAX)

Given = dict[str, tuple[float, float | None]]

HARMONIC: Given = {
    "opaque": (0.25, 1.0),
    "half transparent: A/d, not 1/d": (0.125, 0.5),
    "no alpha: A is 1": (0.25, None),
    "a third": (3.0, 1.0),
    "two layers, at 2 and at 10": (0.3, 1.0),
    "rounding that a reciprocal and a product would miss": (0.7, 0.9),
    "far: no cut on d": (1e-6, 1.0),
    "twice as near": (2e-6, 1.0),
    "the least alpha that is covered": (0.001, FIRST_COVERED),
    "an alpha just below it": (0.001, BELOW),
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
    "a millionth of a unit away": (1e6, 1.0),
    "a thousand million units away": (1e-9, 1.0),
    "a subnormal d that does not overflow": (1e-40, FIRST_COVERED),
    "a subnormal depth": (LARGEST, 1.0),
    "the least depth of all": (LARGEST, FIRST_COVERED),
    "d is minus 0": (-0.0, 1.0),
    "d is minus infinity": (-math.inf, 1.0),
    "d is the least subnormal, and negative": (-1e-45, 1.0),
    "alpha 1e-7": (1e-9, 1e-7),
    "alpha is negative": (0.25, -0.5),
    "alpha is minus infinity": (0.25, -math.inf),
    "no alpha, and d is 0": (0.0, None),
    "no alpha, and d is no number": (math.nan, None),
}

EXPECTED: Given = {
    "opaque": (4.0, 1.0),
    "half transparent: D/A, not D": (2.0, 0.5),
    "no alpha: A is 1": (4.0, None),
    "two layers, at 2 and at 10": (6.0, 1.0),
    "rounding that a reciprocal and a product would miss": (0.7, 0.9),
    "the least alpha that is covered": (0.5, FIRST_COVERED),
    "an alpha just below it": (0.5, BELOW),
    "alpha 0": (0.5, 0.0),
    "alpha a little above 1": (4.0, single(1.0000001)),
    "a quotient that overflows": (LARGEST, 0.5),
    "a thousand million units away": (1e9, 1.0),
    "a subnormal D": (1e-40, 0.7),
    "the least subnormal": (1e-45, 1.0),
    "D is 0": (0.0, 1.0),
    "D is negative": (-4.0, 1.0),
    "D is infinite": (math.inf, 1.0),
    "D is no number": (math.nan, 1.0),
    "alpha is infinite": (4.0, math.inf),
    "alpha is no number": (4.0, math.nan),
}

SURFACE: Given = {
    "alpha does not divide it": (4.0, 0.5),
    "no alpha": (4.0, None),
    "100.0 is a depth like others": (100.0, 1.0),
    "a thousand million units away": (1e9, 1.0),
    "the least subnormal": (1e-45, 1.0),
    "the largest": (LARGEST, 1.0),
    "the least alpha that is covered": (4.0, FIRST_COVERED),
    "an alpha just below it": (4.0, BELOW),
    "alpha 0": (4.0, 0.0),
    "0": (0.0, 1.0),
    "negative": (-4.0, 1.0),
    "infinite": (math.inf, 1.0),
    "no number": (math.nan, 1.0),
    "infinite, and no alpha": (math.inf, None),
    "alpha is no number": (4.0, math.nan),
}

LAYERS = {
    "one, opaque": [(4.0, 1.0)],
    "one, half transparent: every estimator finds it": [(4.0, 0.5)],
    "one, faint": [(4.0, 1e-7)],
    "half transparent at 2, a wall at 10": [(2.0, 0.5), (10.0, 1.0)],
    "thin at 1, a wall at 8": [(1.0, 0.25), (8.0, 1.0)],
    "never half: the median is the last": [(2.0, 0.125), (3.0, 0.125)],
    "two at one depth": [(5.0, 0.75), (5.0, 0.5)],
    "a speck close by, a wall far off": [(0.001, 0.0625), (1e6, 1.0)],
    "ten of a tenth": [(float(z), 0.1) for z in range(1, 11)],
}

SURFACE_CLAUSES = {"harmonic": "ACC-8", "expected": "MEM-14", "median": "MEM-14", "none": "BUF-6"}

Estimate = Callable[[float, float], float]


def cases() -> list[Json]:
    """Return the cases of `depth`."""
    estimators = (
        ("", "harmonic", "inverse_depth", planar_depth, HARMONIC),
        ("expected: ", "expected", "accumulated_depth", expected_depth, EXPECTED),
        ("median: ", "median", "depth", surface_depth, SURFACE),
        ("given: ", "none", "depth", surface_depth, SURFACE),
    )
    return [
        _case(title + name, estimator, member, given, estimate)
        for title, estimator, member, estimate, all_given in estimators
        for name, given in all_given.items()
    ]


def _case(
    name: str,
    estimator: str,
    member: str,
    given: tuple[float, float | None],
    estimate: Estimate,
) -> Json:
    depth, alpha = given
    A = None if alpha is None else single(alpha)
    stored = estimate(single(depth), 1.0 if A is None else A)
    return {
        "name": name,
        "requirement": SURFACE_CLAUSES[estimator] if math.isfinite(stored) else "ACC-9",
        **_since(estimator),
        "quantity": "depth",
        "estimator": estimator,
        member: both(single(depth)),
        "alpha": None if A is None else both(A),
        "expected": both(stored),
    }


def _since(estimator: str) -> Json:
    return {"since": "1.1"} if SURFACE_CLAUSES[estimator] == "MEM-14" else {}


def layers() -> list[Json]:
    """Return the cases of `layers`."""
    return [_layers(name, [(z, single(a)) for z, a in given]) for name, given in LAYERS.items()]


def _layers(name: str, given: list[tuple[float, float]]) -> Json:
    sums = accumulate([(single(z), alpha) for z, alpha in given])
    return {
        "name": f"layers: {name}",
        "requirement": "MEM-14",
        "since": "1.1",
        "quantity": "layers",
        "layers": [{"depth": both(single(z)), "alpha": both(alpha)} for z, alpha in given],
        "expected": {
            "alpha": both(sums.alpha),
            "inverse_depth": both(sums.inverse_depth),
            "accumulated_depth": both(sums.depth),
            "harmonic": both(sums.alpha / sums.inverse_depth),
            "expected": both(sums.depth / sums.alpha),
            "median": both(sums.median),
        },
    }
