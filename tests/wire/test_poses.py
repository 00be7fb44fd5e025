import math
from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from splatbus_conformance import oracle
from splatbus_wire.poses import (
    Pose,
    as_array,
    camera_centre,
    view_matrix,
    world_matrix,
)

from tests.wire.stress import positions, quaternions, within


def translation(matrix):
    return matrix[3], matrix[7], matrix[11]


@settings(deadline=None, max_examples=800)
@given(positions, quaternions())
def test_matrices_of_a_pose_keep_their_budgets(position, rotation):
    pose, at = Pose(position, rotation), (position, rotation)
    view, world = view_matrix(pose), world_matrix(pose)
    exact = oracle.view_translation(position, rotation)
    error = oracle.norm_error(translation(view), exact)
    within("t of the view", error / float(oracle.U), 8, "u", at)  # ACC-4
    error = oracle.norm_error(camera_centre(view), oracle.exact(position))
    within("camera centre", error, 3e-15, "of its norm", at)  # ACC-5
    single = as_array(view, np.float32)
    assert (single.dtype, as_array(view).dtype) == (np.float32, np.float64)
    error = np.linalg.norm(
        [
            oracle.to_double(Fraction(float(a)) - b)
            for a, b in zip(single[:3, 3], exact, strict=True)
        ]
    )
    ulp = np.spacing(np.float32(oracle.to_double(oracle.norm(exact))))
    within("t in single precision", float(error / ulp), 1, "ULP", at)  # ACC-6
    assert (as_array(view)[:3, :3] == as_array(world)[:3, :3].T).all()
    assert (translation(world), world[12:]) == (position, (0.0, 0.0, 0.0, 1.0))
    scale = max(1.0, math.hypot(*position))
    assert np.abs(as_array(view) @ as_array(world) - np.eye(4)).max() <= 4e-15 * scale
