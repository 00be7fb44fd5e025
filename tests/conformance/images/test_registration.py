"""The camera of an image, found again: of images rendered from cameras that are known."""

import math

import numpy as np
import pytest
from splatbus_conformance.images.known_scene import SceneState, render
from splatbus_conformance.images.pinhole import (
    Camera,
    ObjectPlacement,
    Reals,
    Rigid,
    rigid,
    rotation_matrix,
)
from splatbus_conformance.images.registration import Registration, register

SCENE = rigid((3e4, -2e4, 1e4), (0.2, -0.4, 0.1, 0.8))
LOCAL = rigid((0.3, -0.5, -1.0), (0.05, -0.1, 0.02, 0.99))
POSE = Rigid(SCENE.rotation @ LOCAL.rotation, SCENE.place(LOCAL.position))


def camera(pose: Rigid) -> Camera:
    focal = 48 / (2.0 * math.tan(math.radians(30.0)))
    return Camera(pose, focal, focal, 32.0, 24.0, 64, 48, 0.01, 100.0)


def found(used: Rigid, *, noise: float = 0.0) -> Registration:
    """What is found of an image that names POSE and was rendered with another pose."""
    named = camera(POSE)
    depth: Reals = (
        render(camera(used), SceneState(ObjectPlacement(SCENE)))
        .depth.astype(np.float32)
        .astype(np.float64)
    )
    depth *= 1.0 + np.random.default_rng(0).normal(scale=noise, size=depth.shape)
    result = register(named, depth, render(named, SceneState(ObjectPlacement(SCENE))), SCENE)
    assert result is not None
    return result


def test_the_camera_that_is_named_is_found_to_seven_digits() -> None:
    image = found(POSE)
    assert np.abs(image.rotation - POSE.rotation).max() < 1e-6
    assert np.linalg.norm(image.position - POSE.position) < 3e-6
    assert image.shear < 2e-6
    assert image.uncertainty < 1e-6


SHEARED = np.eye(3) + np.diag((1e-3, 0.0, -1e-3))


@pytest.mark.parametrize(
    ("used", "shear"),
    [
        (POSE._replace(position=POSE.position + np.array((6e-3, -5e-3, 4e-3))), 0.0),
        (Rigid(POSE.rotation @ rotation_matrix((5e-4, -3e-4, 0.0, 1.0)), POSE.position), 0.0),
        (Rigid(POSE.rotation @ SHEARED, POSE.position), 2e-3),
    ],
)
def test_a_camera_is_found_where_it_is_and_as_it_is_turned_or_sheared(
    used: Rigid, shear: float
) -> None:
    image = found(used)
    assert image.position == pytest.approx(used.position, abs=2e-4)
    assert image.rotation == pytest.approx(used.rotation, abs=5e-5)
    assert image.shear == pytest.approx(shear, rel=0.1, abs=2e-4)
    assert image.translation == pytest.approx(-image.rotation.T @ image.position)


def test_noise_makes_it_uncertain() -> None:
    assert found(POSE, noise=1e-4).uncertainty > 20 * found(POSE).uncertainty


def test_of_an_image_that_shows_too_little_nothing_is_said() -> None:
    named = camera(Rigid(position=np.array((0.0, -60.0, 0.0))))
    exact = render(named)
    assert register(named, exact.depth, exact, Rigid()) is None
