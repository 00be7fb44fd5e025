"""Rotations and views, against SciPy and against themselves."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from splatbus_conformance.oracle import rotations
from splatbus_conformance.oracle.rounding import exact

components = st.floats(-1, 1).filter(lambda a: a == 0 or abs(a) > 1e-100)
quaternions = st.tuples(*[components] * 4).filter(lambda q: math.hypot(*q) > 0.1)
vectors = st.tuples(*[st.floats(-1e6, 1e6)] * 3)
some = settings(deadline=None, max_examples=60)


@some
@given(quaternions)
def test_rotation_matrices_are_those_of_scipy_and_exactly_orthogonal(q):
    R = rotations.rotation_matrix(q)
    assert np.array(R, float) == pytest.approx(Rotation.from_quat(q).as_matrix(), abs=3e-15)
    gram = rotations.multiply(rotations.transpose(R), R)
    assert gram == (exact((1, 0, 0)), exact((0, 1, 0)), exact((0, 0, 1)))


@some
@given(quaternions, quaternions)
def test_products_of_quaternions_are_products_of_rotations(p, q):
    R, S = rotations.rotation_matrix(p), rotations.rotation_matrix(q)
    both = rotations.product(exact(p), exact(q))
    assert rotations.multiply(R, S) == rotations.rotation_matrix(both)


@some
@given(vectors, quaternions)
def test_the_view_turns_back_and_sends_the_camera_to_the_origin(position, q):
    view = rotations.view_matrix(position, q)
    assert rotations.apply(view, (*exact(position), Fraction(1))) == exact((0, 0, 0, 1))
    turned = tuple(row[:3] for row in view[:3])
    assert rotations.transpose(turned) == rotations.rotation_matrix(q)


@some
@given(quaternions)
def test_the_quaternion_of_a_rotation_is_the_one_it_came_from_but_for_its_sign(q):
    back = rotations.quaternion_of(rotations.rotation_matrix(q))
    unit = [a / rotations.norm(q) for a in exact(q)]
    sign = 1 if sum(a * b for a, b in zip(back, unit, strict=True)) > 0 else -1
    assert max(abs(sign * a - b) for a, b in zip(back, unit, strict=True)) < Fraction(2) ** -390


def test_the_zero_quaternion_is_no_rotation():
    with pytest.raises(ZeroDivisionError):
        rotations.rotation_matrix((0, 0, 0, 0))
