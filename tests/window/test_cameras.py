"""Cameras that a hand moves."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_viewer.poses import look_at
from splatbus_viewer.window.cameras import KINDS, Eye, moved, nearer, rolled, turned
from splatbus_wire.poses import IDENTITY
from splatbus_wire.rotations import rotation_matrix

PLACES = st.floats(-10, 10)
ANGLES = st.floats(-0.5, 0.5)


def axes(eye: Eye) -> np.ndarray:
    return np.array(rotation_matrix(eye.pose.rotation)).reshape(3, 3).T


@st.composite
def eyes(draw: st.DrawFn) -> Eye:
    x, y, z = draw(PLACES), draw(PLACES), draw(st.floats(20, 30))
    return Eye(look_at((x, y, -z), (y, x / 4, z)), draw(st.floats(0.1, 20)))


@given(eyes(), st.lists(st.tuples(ANGLES, ANGLES), max_size=30))
def test_in_orbit_the_pivot_stays(eye: Eye, drags: list[tuple[float, float]]) -> None:
    around = eye
    for right, down in drags:
        around = turned(around, "orbit", right, down)
    assert np.allclose(around.pivot, eye.pivot, atol=1e-9)
    assert around.distance == eye.distance
    assert math.hypot(*around.pose.rotation) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_drag_to_the_right_looks_to_the_right_and_down_looks_down(kind: str) -> None:
    eye = Eye(IDENTITY)
    assert axes(turned(eye, kind, 0.1, 0.0))[2] == pytest.approx((math.sin(0.1), 0, math.cos(0.1)))
    down = turned(eye, kind, 0.0, 0.1)
    assert axes(down)[2] == pytest.approx((0, math.sin(0.1), math.cos(0.1)))
    assert kind == "orbit" or down.pose.position == eye.pose.position


@given(eyes(), st.lists(st.tuples(ANGLES, st.floats(-2, 2)), max_size=20))
def test_a_head_on_foot_stays_upright_and_at_its_height(
    eye: Eye, drags: list[tuple[float, float]]
) -> None:
    height = eye.pose.position[1]
    for right, down in drags:
        eye = moved(turned(eye, "first-person", right, down), "first-person", right, 0.0, down)
        across, below, _ = axes(eye)
        assert across[1] == pytest.approx(0, abs=1e-12)
        assert below[1] > 0
    assert eye.pose.position[1] == pytest.approx(height)


@given(eyes(), st.tuples(ANGLES, ANGLES, ANGLES))
def test_who_flies_goes_along_the_axes_of_the_camera(
    eye: Eye, way: tuple[float, float, float]
) -> None:
    went = np.subtract(moved(eye, "fly", *way).pose.position, eye.pose.position)
    assert np.allclose(axes(eye) @ went, way, atol=1e-12)


def test_in_orbit_the_camera_does_not_go_over_the_pole() -> None:
    eye = Eye(IDENTITY)
    for _ in range(100):
        eye = turned(eye, "orbit", 0.05, 0.2)
        assert axes(eye)[1][1] > 0  # its own down is still down
    assert axes(eye)[2][1] > math.sin(math.radians(75))  # and it came near to it


@given(eyes(), st.floats(0.1, 10))
def test_going_nearer_leaves_the_pivot_where_it_is(eye: Eye, factor: float) -> None:
    near = nearer(eye, factor)
    assert np.allclose(near.pivot, eye.pivot, atol=1e-9)
    assert near.distance == pytest.approx(factor * eye.distance)


@given(eyes(), st.floats(-3, 3))
def test_a_roll_is_clockwise_and_keeps_the_direction(eye: Eye, angle: float) -> None:
    before, after = axes(eye), axes(rolled(eye, angle))
    assert np.allclose(after[2], before[2], atol=1e-12)
    assert after[0] @ before[1] == pytest.approx(math.sin(angle), abs=1e-12)
