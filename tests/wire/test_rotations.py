import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from splatbus_conformance import oracle
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.rotations import check_quaternion, quaternion_from_matrix, rotation_matrix

from benchmarks.accuracy.search import HALF_TURNS
from tests.wire.stress import quaternions, within


def rows(flat):
    return flat[:3], flat[3:6], flat[6:]


patient = settings(deadline=None, max_examples=100)
searching = settings(deadline=None, max_examples=600)


def stress(test):
    for q in HALF_TURNS:
        test = example(q)(test)
    return searching(given(quaternions())(test))


@stress
def test_each_entry_of_the_matrix_is_within_8u(q):
    error = oracle.error_in_u(rotation_matrix(q), sum(oracle.rotation_matrix(q), ()))
    within("entry of R", error, 8, "u", q)  # ACC-2


@stress
def test_the_matrix_is_orthogonal_to_16u(q):
    error = oracle.orthogonality_error(rows(rotation_matrix(q))) / float(oracle.U)
    within("‖RᵀR − I‖₂", error, 16, "u", q)  # ACC-3


@stress
def test_a_quaternion_and_its_negative_are_the_same_rotation(q):
    assert rotation_matrix(q) == rotation_matrix(tuple(-a for a in q))


def test_a_quarter_turn_about_z_takes_x_to_y():
    half = math.sqrt(0.5)
    x_turned = rotation_matrix((0.0, 0.0, half, half))[0::3]
    assert x_turned == pytest.approx((0, 1, 0), abs=1e-15)


@pytest.mark.parametrize("norm", [0.99, 0.9901, 1.0, 1.0099, 1.01])
@pytest.mark.parametrize("axis", range(4))
def test_a_norm_within_a_hundredth_of_one_is_taken(norm, axis):
    check_quaternion(tuple(norm if i == axis else -0.0 for i in range(4)))


@pytest.mark.parametrize(
    "q",
    [
        (0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.9899),
        (0.0, 0.0, 0.0, 1.0101),
        (0.0, -2.0, 0.0, 0.0),
        (1e160, 0.0, 0.0, 0.0),
        (1e-160, 1e-160, 1e-160, 1e-160),
        (math.nan, 0.0, 0.0, 1.0),
        (0.0, math.inf, 0.0, 1.0),
        (0.0, 0.0, -math.inf, math.nan),
    ],
)
def test_any_other_norm_is_refused_by_requirement_and_place(q):
    with pytest.raises(ProtocolError) as caught:
        check_quaternion(q, pointer="/rotation")
    assert not isinstance(caught.value, FramingError)
    assert (caught.value.code, caught.value.requirement) == ("invalid_rotation", "POS-3")
    assert caught.value.pointer == "/rotation"
    assert "POS-3" in str(caught.value)
    assert "/rotation" in str(caught.value)


@stress
def test_the_quaternion_of_a_matrix_is_a_unit_one_and_the_same_rotation(q):
    back = quaternion_from_matrix(rotation_matrix(q))
    assert math.hypot(*back) == pytest.approx(1.0, abs=4e-16)
    assert max(back) > 0
    assert oracle.angle_between(q, back) < 2e-15


@patient
@given(quaternions())
def test_a_reflection_has_no_quaternion(q):
    r00, r01, r02, *rest = rotation_matrix(q)
    with pytest.raises(ValueError, match="reflection"):
        quaternion_from_matrix((-r00, -r01, -r02, *rest))


@pytest.mark.parametrize("scale", [0.0, 0.99, 1.01, 1e200, math.nan, math.inf])
def test_a_matrix_that_is_not_orthogonal_has_no_quaternion(scale):
    with pytest.raises(ValueError, match="not orthogonal"):
        quaternion_from_matrix((scale, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))


@patient
@given(quaternions())
def test_a_matrix_rounded_to_single_precision_still_has_one(q):
    R = tuple(float(np.float32(a)) for a in rotation_matrix(q))
    assert oracle.angle_between(q, quaternion_from_matrix(R)) < 3e-7
