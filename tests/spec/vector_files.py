"""The vector files as a test reads them, by `spec/vectors/README.md` alone."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / "spec" / "vectors"
NAMES = (
    "framing",
    "numbers",
    "poses",
    "conventions",
    "images",
    "intrinsics",
    "projections",
    "packets",
)
DOCUMENTS = {name: json.loads((FOLDER / f"{name}.json").read_text("utf-8")) for name in NAMES}

FORMATS = {"ulp_single": (23, -126), "ulp_double": (52, -1022)}


def chosen(name, /, **members):
    """The cases of a file that have these members; None: that lack it."""
    return [
        case
        for case in DOCUMENTS[name]["cases"]
        if all(case.get(member) == value for member, value in members.items())
    ]


def cases(name, /, **members):
    """The same as parameters of a test, named after them."""
    found = chosen(name, **members)
    assert found, members
    return pytest.mark.parametrize("case", found, ids=lambda case: case["name"])


def doubles(number):
    """A number, vector or matrix as an array."""
    return np.vectorize(float.fromhex, otypes=[float])(number["hex"])


def singles(number):
    given = doubles(number)
    narrow = given.astype(np.float32)
    assert np.array_equal(narrow, given, equal_nan=True)
    return narrow


def intrinsics(stated):
    numbers = {name: float(doubles(stated[name])) for name in ("fx", "fy", "cx", "cy")}
    return {**numbers, "width": stated["width"], "height": stated["height"]}


def is_near(name, quantity, got, expected):
    """Whether what came out is as near to what is expected as `tolerances` asks."""
    tolerance = DOCUMENTS[name]["tolerances"][quantity]
    got, expected = np.asarray(got, float), np.asarray(expected, float)
    signs = (1.0, -1.0) if tolerance.get("up_to_sign") else (1.0,)
    return any(_is_near(tolerance, sign * got, expected) for sign in signs)


def _is_near(tolerance, got, expected):
    if got.shape != expected.shape:
        return False
    if tolerance["measure"] == "exact":
        return bool((got == expected).all())
    bound = tolerance["bound"]["decimal"]
    with np.errstate(invalid="ignore"):
        difference = np.abs(got - expected)
    if tolerance["measure"] == "norm":
        scale = max(1.0, float(np.linalg.norm(expected)))
        return math.hypot(*difference.flat) <= bound * scale
    if tolerance["measure"] == "component":
        return bool((difference <= bound).all())
    return bool((difference <= bound * ulp(expected, *FORMATS[tolerance["measure"]])).all())


def ulp(value, digits, least):
    """The distance to the next greater magnitude in a format of this precision, at `value`."""
    _, exponent = np.frexp(value)
    exponent = np.where(np.asarray(value) == 0, least, exponent - 1)
    return np.ldexp(1.0, np.maximum(exponent, least) - digits)
