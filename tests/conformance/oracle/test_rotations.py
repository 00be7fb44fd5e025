import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from splatbus_conformance.oracle import rotations
from splatbus_conformance.oracle.rounding import exact, square_root

components = st.floats(-1, 1).filter(lambda a: a == 0 or abs(a) > 1e-100)
quaternions = st.tuples(components, components, components, components).filter(
    lambda q: math.hypot(*q) > 0.1
)
vectors = st.tuples(*[st.floats(-1e6, 1e6)] * 3)
some = settings(deadline=None, max_examples=60)


@some
@given(quaternions)
def test_rotation_matrices_are_those_of_scipy(q):
    ours = np.array(rotations.rotation_matrix(q), float)
    assert ours == pytest.approx(Rotation.from_quat(q).as_matrix(), abs=3e-15)


@some
@given(quaternions)
def test_rotation_matrices_are_exactly_orthogonal(q):
    R = rotations.rotation_matrix(q)
    assert rotations.multiply(rotations.transpose(R), R) == tuple(
        tuple(Fraction(i == j) for j in range(3)) for i in range(3)
    )


@some
@given(st.floats(0.01, 3.1), st.sampled_from(range(3)))
def test_a_turn_about_an_axis_has_its_sine_and_cosine(angle, axis):
    with mpmath.workprec(500):
        half = mpmath.mpf(angle) / 2
        turn = [mpmath.mpf(0)] * 3 + [mpmath.cos(half)]
        turn[axis] = mpmath.sin(half)
        q = [Fraction(*mpmath.libmp.to_rational(a._mpf_)) for a in turn]
        R = rotations.rotation_matrix(q)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        for got, expected in [(R[i][i], mpmath.cos(angle)), (R[j][i], mpmath.sin(angle))]:
            assert abs(mpmath.mpf(got.numerator) / got.denominator - expected) < 1e-140
    assert R[axis][axis] == 1


@some
@given(quaternions, quaternions)
def test_products_of_quaternions_are_products_of_rotations(p, q):
    R, S = rotations.rotation_matrix(p), rotations.rotation_matrix(q)
    both = rotations.product(exact(p), exact(q))
    assert rotations.multiply(R, S) == rotations.rotation_matrix(both)


@some
@given(vectors, quaternions)
def test_the_view_sends_the_camera_centre_to_the_origin_and_gives_it_back(position, q):
    view = rotations.view_matrix(position, q)
    assert rotations.apply(view, (*exact(position), Fraction(1))) == exact((0, 0, 0, 1))
    assert rotations.camera_centre(view) == exact(position)


@some
@given(vectors, quaternions)
def test_the_view_is_the_inverse_of_camera_to_world(position, q):
    camera_to_world = np.eye(4)
    camera_to_world[:3, :3] = Rotation.from_quat(q).as_matrix()
    camera_to_world[:3, 3] = position
    ours = np.array(rotations.view_matrix(position, q), float)
    assert ours == pytest.approx(np.linalg.inv(camera_to_world), abs=1e-8, rel=1e-12)


@some
@given(quaternions)
def test_the_quaternion_of_a_rotation_is_the_one_it_came_from_but_for_its_sign(q):
    back = rotations.quaternion_of(rotations.rotation_matrix(q))
    unit = [a / rotations.norm(q) for a in exact(q)]
    sign = 1 if sum(a * b for a, b in zip(back, unit, strict=True)) > 0 else -1
    assert max(abs(sign * a - b) for a, b in zip(back, unit, strict=True)) < Fraction(2) ** -390


def test_a_half_turn_has_an_exact_quaternion():
    q = rotations.quaternion_of((exact((1, 0, 0)), exact((0, -1, 0)), exact((0, 0, -1))))
    assert q == (1, 0, 0, 0)


@some
@given(quaternions)
def test_the_norm_is_the_root_of_the_sum_of_squares(q):
    assume(any(q))
    assert rotations.norm(q) == square_root(sum(Fraction(a) ** 2 for a in q))
    assert float(rotations.norm(q)) == pytest.approx(math.hypot(*q), rel=1e-15)


def test_the_zero_quaternion_is_no_rotation():
    with pytest.raises(ZeroDivisionError):
        rotations.rotation_matrix((0, 0, 0, 0))
