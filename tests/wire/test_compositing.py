import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from splatbus_conformance import oracle
from splatbus_conformance.oracle.rounding import SINGLE
from splatbus_wire.compositing import over_premultiplied, over_straight

from tests.wire.stress import within

unit = st.floats(0, 1, width=32)
depths = st.floats(width=32) | st.sampled_from([math.inf, math.nan, 0.0, -1.0, 1.0, 2.0, 100.0])
pixels = st.tuples(unit, unit, unit, unit, depths, unit, unit, unit, depths)


@pytest.mark.parametrize("premultiplied", [False, True])
@settings(deadline=None, max_examples=150)
@given(st.lists(pixels, min_size=1, max_size=12))
@example([(0.0, 0.0, 0.0, 0.9999999403953552, 1.0, 0.7, 0.7, 0.7, 2.0)])
@example([(*[0.0048380964435637] * 3, 0.49989965558052063, 1.0, *[0.9948040843009949] * 3, 2.0)])
def test_each_colour_is_rounded_once(premultiplied, pixels):
    image = np.array(pixels, np.float32)
    splats, depth, under, under_depth = image[:, :4], image[:, 4], image[:, 5:8], image[:, 8]
    blend = over_premultiplied if premultiplied else over_straight
    got = blend(splats, depth, under, under_depth)
    assert got.dtype == np.float32
    worst, at = 0.0, pixels[0]
    for i in range(len(image)):
        exact = oracle.composite(
            splats[i].tolist(),
            float(depth[i]),
            under[i].tolist(),
            float(under_depth[i]),
            premultiplied=premultiplied,
        )
        errors = [oracle.ulps(a, b, SINGLE) for a, b in zip(got[i].tolist(), exact, strict=True)]
        worst, at = max((worst, at), (max(errors), pixels[i]), key=lambda found: found[0])
    kind = "premultiplied" if premultiplied else "straight"
    within(f"composite, {kind}", worst, 0.501, "ULP", at)
