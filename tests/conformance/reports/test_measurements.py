"""The worst case is kept, with its budget and its input."""

import json
import math

import pytest
from splatbus_conformance.measurements import Measurements


@pytest.fixture
def taken():
    measurements = Measurements()
    for error, case in ((0.5, "a"), (3.0, "b"), (2.5, "c"), (1.0, "d")):
        measurements.add("colour", error, 2.0, "ULP", case)
    measurements.add("angle", 1e-9, None, "rad", "a")
    return measurements


def test_the_worst_is_kept_with_its_input(taken):
    colour, angle = taken
    assert (colour.worst, colour.input, colour.cases, colour.beyond) == (3.0, "b", 4, 2)
    assert (angle.worst, angle.budget, angle.beyond) == (1e-9, None, 0)
    assert str(colour) == "colour: worst 3 ULP of 2 in 4 cases at b"


def test_only_what_has_a_budget_can_pass_it(taken):
    assert [it.quantity for it in taken.beyond()] == ["colour"]


@pytest.mark.parametrize("error", [math.inf, math.nan])
def test_an_error_that_is_no_number_is_beyond_every_budget(error):
    measurements = Measurements()
    measurements.add("colour", error, 2.0, "ULP", "a")
    assert measurements.beyond()
    assert (
        json.loads(json.dumps(next(iter(measurements)).as_json(), allow_nan=False))["worst"] is None
    )


def test_an_error_at_the_budget_is_within_it():
    measurements = Measurements()
    measurements.add("position", 0.0, 0.0, "ULP", "a")
    assert not measurements.beyond()
