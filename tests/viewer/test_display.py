"""Frames as a screen wants them, from whatever the semantics say."""

import math

import numpy as np
import pytest
from splatbus_viewer.display import shown
from splatbus_wire.messages import FrameCamera
from splatbus_wire.poses import IDENTITY
from splatbus_wire.semantics import Semantics

CAMERA = FrameCamera(IDENTITY, 2.0, 2.0, 1.5, 1.0, 3, 2, 0.01, 100.0)


def image(color, depth):
    return (
        np.full((2, 3, 4), color, np.float32),
        np.full((2, 3), depth, np.float32),
        CAMERA,
    )


def test_premultiplied_colour_is_divided_by_alpha():
    semantics = Semantics(alpha="premultiplied")
    result = shown(*image((0.1, 0.2, 0.3, 0.5), 3.0), semantics)
    np.testing.assert_allclose(result.color[0, 0], [0.2, 0.4, 0.6, 0.5], rtol=1e-6)
    assert not shown(*image((0, 0, 0, 0), 3.0), semantics).color.any()


@pytest.mark.parametrize(
    ("light", "code"), [(0.0, 0.0), (1.0, 1.0), (0.0031308, 0.04045), (0.5, 0.735357)]
)
def test_linear_light_is_encoded(light, code):
    result = shown(*image((light, light, light, 1.0), 3.0), Semantics(color_space="linear"))
    np.testing.assert_allclose(result.color[0, 0], [code, code, code, 1.0], atol=1e-5)


def test_distance_along_the_ray_becomes_planar_depth():
    result = shown(*image((1, 1, 1, 1), 3.0), Semantics(depth_kind="ray_distance"))
    x, y = (0.5 - 1.5) / 2, (0.5 - 1.0) / 2
    assert result.depth[0, 0] == pytest.approx(3.0 / math.sqrt(x * x + y * y + 1.0))
    assert np.isinf(
        shown(*image((1, 1, 1, 1), np.inf), Semantics(depth_kind="ray_distance")).depth
    ).all()


@pytest.mark.parametrize(
    ("alpha", "depth", "empty"),
    [
        (0.0, 3.0, math.inf),
        (1.0, math.inf, math.inf),
        (1.0, 100.0, 100.0),
        (1.0, math.nan, math.inf),
        (1.0, 0.0, math.inf),
        (1.0, -3.0, math.inf),
    ],
)
def test_what_is_no_surface_is_infinitely_far(alpha, depth, empty):
    result = shown(*image((1, 1, 1, alpha), depth), Semantics(depth_empty=empty))
    assert np.isposinf(result.depth).all()
