"""Frames as a screen wants them, from whatever the semantics say."""

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
