"""The NumPy renderer against the closed form, over poses drawn at random and on purpose."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from splatbus_renderer.raycast import Raycaster
from splatbus_renderer.scene import (
    Camera,
    ObjectPose,
    default_camera,
    default_scene,
    exact_pixel,
)

SCENE = default_scene()
CAMERA = default_camera(32, 24)
RAYCASTER = Raycaster(32, 24)
EDGE = 1e-5  # in image coordinates x = (u − cx)/fx


def rotation(x, y, z, w):
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return (
        (1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)),
        (s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)),
        (s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)),
    )


COORDINATES = st.floats(-6.0, 6.0)
VECTORS = st.tuples(COORDINATES, COORDINATES, COORDINATES)
COMPONENTS = st.floats(-1.0, 1.0)
ROTATIONS = (
    st.tuples(COMPONENTS, COMPONENTS, COMPONENTS, COMPONENTS)
    .filter(lambda q: math.hypot(*q) > 0.1)
    .map(lambda q: rotation(*q))
)


@st.composite
def positions(draw):
    """Anywhere; in or on a sphere; close over or under the floor; far away."""
    sphere = draw(st.sampled_from(SCENE.spheres))
    x, y, z = draw(VECTORS)
    length = max(math.hypot(x, y, z), 1e-3)
    reach = draw(st.sampled_from([0.3, 0.99, 1.0, 1.001, 1.02])) * sphere.radius / length
    on_sphere = tuple(c + reach * d for c, d in zip(sphere.center, (x, y, z), strict=True))
    grazing = (x, SCENE.floor.height + draw(st.sampled_from([-0.1, -1e-3, 0.0, 1e-3, 0.1])), z)
    return draw(st.sampled_from([(x, y, z), on_sphere, grazing, (9 * x, 9 * y, 9 * z)]))


@st.composite
def cameras(draw):
    return replace(
        CAMERA,
        position=draw(positions()),
        rotation=draw(ROTATIONS),
        cx=draw(st.sampled_from([16.0, 3.0, 30.5])),
        near=draw(st.sampled_from([0.01, 0.5, 4.0])),
        far=draw(st.sampled_from([100.0, 5.0])),
    )


POSES = st.builds(ObjectPose, VECTORS, ROTATIONS, st.sampled_from([1.0, 0.3, 4.0]))


def is_close(pixel, depth, exact):
    color, z = exact
    return max(abs(a - b) for a, b in zip(pixel, color, strict=True)) <= 1 / 255 and (
        depth == z or abs(depth - z) <= 1e-5 * max(1.0, z)
    )


def is_close_within_an_edge(pixel, depth, scene, camera, u, v):
    """Whether some ray within EDGE has that colour, and others a depth on either side of it.

    The very edge of the floor belongs to it and has the colour of the check behind it.
    """
    wider = replace(scene, floor=replace(scene.floor, extent=1.01 * scene.floor.extent))
    nearby = [
        exact_pixel(each, camera, u + i * EDGE * camera.fx, v + j * EDGE * camera.fy)
        for each in (scene, wider)
        for i in (-1.0, -0.5, 0.0, 0.5, 1.0)
        for j in (-1.0, -0.5, 0.0, 0.5, 1.0)
    ]
    depths = [z for _, z in nearby]
    return any(is_close(pixel, z, (color, z)) for color, z in nearby) and (
        min(depths) * (1 - 1e-5) <= depth <= max(depths) * (1 + 1e-5)
    )


def assert_exact(scene, camera):
    render = RAYCASTER.render(scene, camera)
    for row in range(camera.height):
        for column in range(camera.width):
            pixel = [float(c) for c in render.color[row, column]]
            depth = float(render.depth[row, column])
            u, v = column + 0.5, row + 0.5
            exact = exact_pixel(scene, camera, u, v)
            assert is_close(pixel, depth, exact) or is_close_within_an_edge(
                pixel, depth, scene, camera, u, v
            ), f"pixel ({u}, {v}) is {pixel} at depth {depth}, exactly {exact}"


ABOVE_THE_EDGE = replace(
    CAMERA, position=(5.5, 0.9500000000000001, 0.0), rotation=rotation(0.0, 0.0, 0.0, 1.0)
)
"""One column of pixels shows the floor where it ends."""


@settings(deadline=None, max_examples=60)
@given(cameras())
@example(ABOVE_THE_EDGE)
def test_every_pixel_is_the_exact_one_or_lies_on_an_edge(camera):
    assert_exact(SCENE, camera)


@settings(deadline=None, max_examples=20)
@given(cameras(), POSES)
def test_a_moved_turned_and_scaled_scene_is_exact_too(camera, pose):
    assert_exact(replace(SCENE, pose=pose), camera)


def test_in_the_default_view_no_pixel_needs_the_excuse_of_an_edge():
    camera = default_camera(160, 120)
    render = Raycaster(160, 120).render(SCENE, camera)
    assert all(
        is_close(
            [float(c) for c in render.color[row, column]],
            float(render.depth[row, column]),
            exact_pixel(SCENE, camera, column + 0.5, row + 0.5),
        )
        for row in range(120)
        for column in range(160)
    )


def test_far_from_the_origin_nothing_is_lost():
    """The camera's centre is subtracted in float64, before anything is float32."""
    away = (1e6, -2e6, 3e6)
    scene = replace(SCENE, pose=ObjectPose(away))
    assert_exact(scene, replace(CAMERA, position=away))


def test_spheres_behind_beside_and_beyond_are_culled():
    count = len(SCENE.spheres)
    behind = replace(CAMERA, position=(0.0, 0.0, 20.0))
    beside = replace(CAMERA, position=(30.0, 0.0, 0.0))
    beyond = replace(CAMERA, far=0.5)
    for camera in (behind, beside, beyond):
        render = RAYCASTER.render(replace(SCENE, floor=None), camera)
        assert render.stats == (count, 0)
        assert not render.color.any()
        assert np.all(render.depth == np.inf)


def test_a_small_sphere_costs_its_own_rectangle_only():
    whole = RAYCASTER.render(replace(SCENE, floor=None), CAMERA).stats
    assert whole.spheres_culled == 0
    assert whole.pixels_tested < CAMERA.width * CAMERA.height
    one = RAYCASTER.render(replace(SCENE, floor=None, spheres=SCENE.spheres[2:3]), CAMERA)
    assert one.stats.pixels_tested < 1.6 * np.count_nonzero(one.color[..., 3]) + 32


def test_depth_is_handed_out_only_when_wanted():
    assert RAYCASTER.render(SCENE, CAMERA, want_depth=False).depth is None
    assert RAYCASTER.render(SCENE, CAMERA).depth.dtype == np.float32


def test_nothing_of_the_frame_before_shows_through():
    RAYCASTER.render(SCENE, CAMERA)
    render = RAYCASTER.render(SCENE, replace(CAMERA, position=(0.0, 0.0, 20.0)))
    fresh = Raycaster(32, 24).render(SCENE, replace(CAMERA, position=(0.0, 0.0, 20.0)))
    np.testing.assert_array_equal(render.color, fresh.color)
    np.testing.assert_array_equal(render.depth, fresh.depth)


def test_a_camera_of_another_size_is_refused():
    with pytest.raises(ValueError, match="33×24"):
        RAYCASTER.render(SCENE, Camera(33, 24, 20.0, 20.0, 16.0, 12.0))
