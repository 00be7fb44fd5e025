import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from splatbus_conformance import oracle
from splatbus_wire.poses import (
    IDENTITY,
    Pose,
    as_array,
    camera_centre,
    view_matrix,
    world_matrix,
)

from tests.wire.stress import positions, quaternions, within

stress = settings(deadline=None, max_examples=400)


def translation(matrix):
    return matrix[3], matrix[7], matrix[11]


@stress
@given(positions, quaternions())
def test_the_translation_of_the_view_is_within_8u(position, rotation):
    got = translation(view_matrix(Pose(position, rotation)))
    error = oracle.norm_error(got, oracle.view_translation(position, rotation))
    within("t of the view", error / float(oracle.U), 8, "u", (position, rotation))  # ACC-4


@stress
@given(positions, quaternions())
def test_the_camera_centre_comes_back_from_the_view_to_3e_15(position, rotation):
    got = camera_centre(view_matrix(Pose(position, rotation)))
    error = oracle.norm_error(got, oracle.exact(position))
    within("camera centre", error, 3e-15, "of its norm", (position, rotation))  # ACC-5


@stress
@given(positions, quaternions())
def test_single_precision_is_within_an_ulp_norm_wise(position, rotation):
    view = as_array(view_matrix(Pose(position, rotation)), np.float32)
    assert view.dtype == np.float32
    got = view[:3, 3]
    exact = oracle.view_translation(position, rotation)
    error = np.linalg.norm(
        [oracle.to_double(Fraction(float(a)) - b) for a, b in zip(got, exact, strict=True)]
    )
    ulp = np.spacing(np.float32(oracle.to_double(oracle.norm(exact))))
    within("t in single precision", float(error / ulp), 1, "ULP", (position, rotation))  # ACC-6


@stress
@given(positions, quaternions())
def test_view_and_world_matrix_hold_one_rotation_and_undo_each_other(position, rotation):
    pose = Pose(position, rotation)
    view, world = as_array(view_matrix(pose)), as_array(world_matrix(pose))
    assert (view[:3, :3] == world[:3, :3].T).all()
    assert translation(world_matrix(pose)) == position
    scale = max(1.0, math.hypot(*position))
    assert np.abs(view @ world - np.eye(4)).max() <= 4e-15 * scale


def test_a_point_ahead_of_the_camera_has_positive_z_in_its_view():
    half = math.sqrt(0.5)
    looks_along_x = Pose((10.0, 0.0, 0.0), (0.0, half, 0.0, half))
    seen = as_array(view_matrix(looks_along_x)) @ (13.0, 0.0, 0.0, 1.0)
    assert seen == pytest.approx((0, 0, 3, 1), abs=1e-15)


def test_matrices_are_row_major():
    array = as_array(world_matrix(Pose((1.0, 2.0, 3.0), IDENTITY.rotation)))
    assert array.dtype == np.float64
    assert array.tolist() == [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    assert (as_array(view_matrix(IDENTITY)) == np.eye(4)).all()
