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

NEAR_HALF_TURNS = [
    # Found by climbing: what these cost 1 − s(y² + z²) summed in order is 9u, and 20u in RᵀR − I.
    (-0.001679857130093146, 0.8105190822669939, 0.5862386132455417, -0.0009542649806552684),
    (-0.7142254160634234, 0.708424877744617, 0.012598090850222975, 1.0274872004014964e-05),
    (0.7080916218046034, 0.7084141741311736, -0.01850032608345227, 1.0048220438809929e-08),
    (0.7072903396458428, 0.7105116724151237, -0.07730604940000613, 0.0025501131426139624),
    (-0.003066021279409015, 1.0001740825831513, 0.017486229539117538, -5.849537083236257e-07),
    (0.013311314657677376, -1.0019143669312318, 0.005065870778411405, -0.00028612686603677744),
]
