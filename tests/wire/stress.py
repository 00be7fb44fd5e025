"""The numbers that break careless arithmetic: what every accuracy budget is measured on."""

import math

import numpy as np
from hypothesis import strategies as st
from hypothesis import target
from splatbus_conformance.measurements import Measurements

worst = Measurements()
"""Of the test that runs; `conftest` tells them at the end."""


def within(quantity: str, error: float, budget: float, unit: str, case: object) -> None:
    """An error keeps its budget; the search climbs towards the largest, and the worst is told."""
    worst.add(quantity, error, budget, unit, str(case))
    target(error, label=quantity)
    assert error <= budget, f"{quantity}: {error} {unit} of {budget} at {case}"


components = st.floats(-1, 1) | st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.5, -0.5])
norms = st.floats(0.9901, 1.0099) | st.just(1.0)
powers = st.integers(-20, 0).map(lambda exponent: 10.0**exponent)


@st.composite
def quaternions(draw):
    """(x, y, z, w) of norm 1 ± 0.01: anywhere, near 1, near half-turns, float32."""
    x, y, z, w = draw(st.tuples(components, components, components, components))
    shape = draw(st.sampled_from(["any", "half turn", "near identity", "single"]))
    small = draw(powers)
    if shape == "half turn":
        w *= small
    elif shape == "near identity":
        x, y, z, w = x * small, y * small, z * small, 1.0
    length = math.hypot(x, y, z, w)
    if length < 1e-3:
        return (0.0, -0.0, 0.0, 1.0)
    scale = draw(norms) / length
    q = (x * scale, y * scale, z * scale, w * scale)
    return tuple(float(np.float32(a)) for a in q) if shape == "single" else q


magnitudes = st.integers(-3, 9).map(lambda exponent: 10.0**exponent)
coordinates = st.builds(lambda a, m: a * m, st.floats(-1, 1), magnitudes) | st.sampled_from(
    [0.0, -0.0, 5e-324, -2.2e-308, 1e-3, 1e9]
)
positions = st.tuples(coordinates, coordinates, coordinates)
