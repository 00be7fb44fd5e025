import numpy as np
import pytest
from splatbus_splats.drawing import harmonics
from splatbus_wire.poses import Pose

from benchmarks import moved_object
from benchmarks.moved_object import ALL, ALL_AND_HARMONICS, ONE
from benchmarks.splats import drawing, turning

P, Q = (
    drawing.matrix(np.array(moved_object.quaternion(axis, angle)))
    for axis, angle in (((1, 2, 3), 40.0), ((-2, 0.5, 1), 155.0))
)


def test_the_harmonics_are_orthonormal():
    directions = harmonics.spread_directions(20_000)
    Y = harmonics.basis(directions)
    gram = 4 * np.pi * (Y @ Y.T) / len(directions)
    np.testing.assert_allclose(gram, np.eye(16), atol=1e-3)


@pytest.mark.parametrize("degree", range(4))
def test_a_degree_turns_within_itself(degree):
    """M is orthogonal, M(PQ) = M(P)·M(Q), and Y(P·d) = M(P)·Y(d) where it was not fitted."""
    M, N = turning.band_rotation(P, degree), turning.band_rotation(Q, degree)
    np.testing.assert_allclose(M.T @ M, np.eye(2 * degree + 1), atol=1e-13)
    np.testing.assert_allclose(turning.band_rotation(P @ Q, degree), M @ N, atol=1e-13)
    directions = harmonics.spread_directions(37)
    band = harmonics.BANDS[degree]
    np.testing.assert_allclose(
        harmonics.basis(directions @ P.T)[band], M @ harmonics.basis(directions)[band], atol=1e-13
    )


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("angle", [1.0, 90.0, 180.0])
def test_only_harmonics_left_behind_are_wrong(degree, angle):
    pose = Pose((0.3, -0.2, 0.5), moved_object.quaternion((1, 2, 0.5), angle))
    errors = moved_object.colour_errors(500, degree, pose)
    assert errors[ONE].max() < 1e-3
    assert errors[ALL_AND_HARMONICS].max() < 1e-3
    assert errors[ALL].max() > (1.0 if angle > 1.0 else 0.1)


def test_a_move_without_a_turn_leaves_colours_right():
    errors = moved_object.colour_errors(500, 3, Pose((0.3, -0.2, 0.5), (0.0, 0.0, 0.0, 1.0)))
    assert errors[ALL].max() < 1e-3


def test_the_picture_is_the_same_by_both_right_ways_and_by_no_other():
    images = moved_object.pictures(300)
    right = images["moved: the camera moved against it"]
    assert right.max() > 0.1
    dear = images["moved: those and harmonics"]
    errors = np.abs(dear - right).max(axis=2) * 255
    # Where a Gaussian's alpha is 1/255 but for rounding, one way may draw it and the other not.
    assert errors.max() <= 1.0
    assert (errors > 1e-6).mean() < 1e-3
    wrong = images["moved: positions and rotations"]
    assert np.abs(wrong - right).max() * 255 > 5
