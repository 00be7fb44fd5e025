import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from splatbus_conformance import oracle
from splatbus_wire.errors import FramingError
from splatbus_wire.rotations import check_quaternion, quaternion_from_matrix, rotation_matrix

from benchmarks.accuracy.search import HALF_TURNS
from tests.wire.payloads import refusal
from tests.wire.stress import quaternions, within

searching = settings(deadline=None, max_examples=600)


def stress(test):
    for q in HALF_TURNS:
        test = example(q)(test)
    return searching(given(quaternions())(test))


@stress
def test_a_rotation_is_within_8u_orthogonal_to_16u_and_comes_back_from_its_matrix(q):
    R = rotation_matrix(q)
    error = oracle.error_in_u(R, sum(oracle.rotation_matrix(q), ()))
    within("entry of R", error, 8, "u", q)  # ACC-2
    error = oracle.orthogonality_error((R[:3], R[3:6], R[6:])) / float(oracle.U)
    within("‖RᵀR − I‖₂", error, 16, "u", q)  # ACC-3
    back = quaternion_from_matrix(R)
    assert math.hypot(*back) == pytest.approx(1.0, abs=4e-16)
    assert max(back) > 0
    assert oracle.angle_between(q, back) < 2e-15
    rounded = tuple(float(np.float32(a)) for a in R)
    assert oracle.angle_between(q, quaternion_from_matrix(rounded)) < 3e-7
    with pytest.raises(ValueError, match="reflection"):
        quaternion_from_matrix((*(-a for a in R[:3]), *R[3:]))


@pytest.mark.parametrize(
    "q",
    [
        (0.0, 0.0, 0.0, 0.0),
        (math.nan, 0.0, 0.0, 1.0),
        (0.0, 0.0, -math.inf, math.nan),
    ],
)
def test_any_other_norm_is_refused_by_requirement_and_place(q):
    error = refusal(check_quaternion, q, pointer="/rotation")
    assert not isinstance(error, FramingError)
    assert (error.code, error.requirement) == ("invalid_rotation", "POS-3")
    assert error.pointer == "/rotation"
    assert str(error).endswith("at /rotation [POS-3]")


@pytest.mark.parametrize("scale", [0.0, 0.99, 1.01, 1e200, math.nan, math.inf])
def test_a_matrix_that_is_not_orthogonal_has_no_quaternion(scale):
    with pytest.raises(ValueError, match="not orthogonal"):
        quaternion_from_matrix((scale, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
