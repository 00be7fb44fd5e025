"""Frames as a screen wants them, from whatever the semantics say."""

import math

import numpy as np
import pytest
from splatbus_viewer.display import composed, rays, shown
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


def test_what_is_in_the_right_form_is_kept():
    result = shown(*image((0.2, 0.4, 0.6, 0.5), 3.0), Semantics())
    np.testing.assert_array_equal(result.color[0, 0], np.float32([0.2, 0.4, 0.6, 0.5]))
    assert (result.depth == 3).all()


def test_what_is_shown_is_a_copy():
    color, depth, camera = image((0.2, 0.4, 0.6, 0.5), 3.0)
    result = shown(color, depth, camera, Semantics())
    color[:], depth[:] = 0, 0
    assert result.color.all()
    assert result.depth.all()


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


def test_rays_go_through_the_centres_of_pixels():
    directions = rays(CAMERA)
    assert directions.shape == (2, 3, 3)
    np.testing.assert_array_equal(directions[0, 0], [-0.5, -0.25, 1.0])
    np.testing.assert_array_equal(directions[1, 2], [0.5, 0.25, 1.0])


MESH = np.full((2, 3, 3), (0.0, 1.0, 0.5), np.float32)


def over(colour, depth, mesh_depth, **semantics):
    """The top-left pixel of an image of one colour over a mesh of one depth."""
    plane = np.full((2, 3), mesh_depth, np.float32)
    return composed(*image(colour, depth), Semantics(**semantics), MESH, plane)[0, 0].tolist()


@pytest.mark.parametrize(
    ("colour", "alpha"),
    [((0.5, 0.5, 0.5, 0.5), "straight"), ((0.25, 0.25, 0.25, 0.5), "premultiplied")],
)
def test_splats_before_a_mesh_are_blended_by_their_alpha(colour, alpha):
    assert over(colour, 2.0, 3.0, alpha=alpha) == [0.25, 0.75, 0.5]
    assert over(colour, 3.0, 2.0, alpha=alpha) == MESH[0, 0].tolist()


@pytest.mark.parametrize("depth", [math.inf, math.nan, 0.0, -1.0, 100.0])
def test_a_mesh_is_unchanged_where_nothing_is(depth):
    assert over((1, 0, 0, 1), depth, 1e6, depth_empty=100.0) == MESH[0, 0].tolist()


def test_a_mesh_is_compared_with_planar_depth():
    """The ray through the corner is 1.14 times as long as its depth."""
    assert over((1, 0, 0, 1), 3.3, 3.0, depth_kind="ray_distance") == [1.0, 0.0, 0.0]
    assert over((1, 0, 0, 1), 3.3, 3.0) == MESH[0, 0].tolist()
