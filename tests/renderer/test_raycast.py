"""The NumPy renderer against the harness's closed form, over poses drawn at random."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from splatbus_conformance.images import known_scene, pinhole
from splatbus_renderer.raycast import Raycaster
from splatbus_renderer.scene import Camera, ObjectPose, default_camera, default_scene

SCENE = default_scene()
CAMERA = default_camera(32, 24)
RAYCASTER = Raycaster(32, 24)
AWAY = replace(CAMERA, position=(0.0, 0.0, 20.0))

COORDINATES = st.floats(-6.0, 6.0)
VECTORS = st.tuples(COORDINATES, COORDINATES, COORDINATES)
ROTATIONS = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .filter(lambda q: math.hypot(*q) > 0.1)
    .map(lambda q: tuple(map(tuple, pinhole.rotation_matrix(q).tolist())))
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
STILL = ObjectPose()


def rigid(of: Camera | ObjectPose) -> pinhole.Rigid:
    return pinhole.Rigid(np.array(of.rotation), np.array(of.position))


def assert_exact(raycaster: Raycaster, camera: Camera, pose: ObjectPose = STILL) -> float:
    """Compares the pixels that have no edge near; returns how many there are, of one."""
    image = raycaster.render(replace(SCENE, pose=pose), camera)
    lens = camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height
    seen = pinhole.Camera(rigid(camera), *lens, camera.near, camera.far)
    placed = pinhole.ObjectPlacement(rigid(pose), pose.scale)
    exact = known_scene.render(seen, known_scene.SceneState(placed))
    assert exact.color_error(image.color).max() <= 1 / 255
    assert exact.depth_error(image.depth).max() <= 1e-5
    return float(exact.certain.mean())


@settings(deadline=None, max_examples=200)
@given(cameras(), st.just(STILL) | POSES)
@example(replace(CAMERA, position=(5.5, 0.9500000000000001, 0.0)), STILL)  # where the floor ends
def test_every_pixel_is_the_exact_one_or_lies_on_an_edge(camera, pose):
    """Also where the scene is moved, turned and scaled."""
    assert_exact(RAYCASTER, camera, pose)


def test_in_the_default_view_few_pixels_lie_on_an_edge():
    assert assert_exact(Raycaster(160, 120), default_camera(160, 120)) > 0.99


def test_far_from_the_origin_nothing_is_lost():
    """The camera's centre is subtracted in float64, before anything is float32."""
    away = (1e6, -2e6, 3e6)
    assert_exact(RAYCASTER, replace(CAMERA, position=away), ObjectPose(away))


def test_depth_is_handed_out_only_when_wanted():
    assert RAYCASTER.render(SCENE, CAMERA, want_depth=False).depth is None
    assert RAYCASTER.render(SCENE, CAMERA).depth.dtype == np.float32


def test_nothing_of_the_frame_before_shows_through():
    RAYCASTER.render(SCENE, CAMERA)
    assert not RAYCASTER.render(replace(SCENE, floor=None), AWAY).color.any()
    assert_exact(RAYCASTER, AWAY)


def test_a_camera_of_another_size_is_refused():
    with pytest.raises(ValueError, match="33×24"):
        RAYCASTER.render(SCENE, Camera(33, 24, 20.0, 20.0, 16.0, 12.0))
