"""The error measures: what a search goes by is the exact error, as the oracle has it."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_conformance import oracle
from splatbus_conformance.oracle.rounding import SINGLE, ulp
from splatbus_wire.poses import Pose, view_matrix
from splatbus_wire.rotations import rotation_matrix

from benchmarks.accuracy import integers, search
from benchmarks.accuracy.images import ulps
from tests.wire.stress import positions, quaternions

patient = settings(deadline=None, max_examples=60)
U = float(oracle.U)


def fractions(exact):
    return tuple(Fraction(n, exact.denominator) for n in exact.numerators)


@patient
@given(quaternions())
def test_rotations_are_those_of_the_oracle(q):
    assert fractions(integers.rotation(q)) == sum(oracle.rotation_matrix(q), ())


@patient
@given(positions, quaternions())
def test_products_are_those_of_the_oracle(position, q):
    turned = integers.product(integers.rotation(q), integers.over(position), transposed=True)
    assert tuple(-a for a in fractions(turned)) == oracle.view_translation(position, q)
    R = integers.rotation(q)
    one = fractions(integers.product(R, R, transposed=True))
    assert one == (1, 0, 0, 0, 1, 0, 0, 0, 1)
    assert fractions(integers.product(R, integers.Over((1, 0, 0), 1))) == fractions(R)[0::3]


@patient
@given(positions, quaternions())
def test_errors_are_those_of_the_oracle(position, q):
    R = rotation_matrix(q)
    entry = integers.entry_error(R, integers.rotation(q)) / U
    assert entry == pytest.approx(oracle.error_in_u(R, sum(oracle.rotation_matrix(q), ())))
    rows = (R[:3], R[3:6], R[6:])
    off = integers.orthogonality_error(R)
    assert off == pytest.approx(oracle.orthogonality_error(rows), rel=1e-6, abs=1e-25)
    t = view_matrix(Pose(position, q))[3:12:4]
    exact = oracle.view_translation(position, q)
    moved = integers.product(integers.rotation(q), integers.over(position), transposed=True)
    error = integers.norm_error([-a for a in t], moved)
    assert error == pytest.approx(oracle.norm_error(t, exact), rel=1e-9, abs=1e-40)


def test_what_is_not_finite_is_infinitely_wrong():
    R = [math.nan] * 9
    assert integers.entry_error(R, integers.rotation((0.0, 0.0, 0.0, 1.0))) == math.inf
    assert integers.orthogonality_error(R) == math.inf
    assert ulps(np.array([np.nan, np.inf], np.float32), np.array([1.0, 1.0])).tolist() == [
        math.inf,
        math.inf,
    ]


@given(st.floats(0, float(np.finfo(np.float32).max), width=32), st.floats(0.5, 2))
def test_ulps_of_arrays_are_those_of_the_oracle(got, factor):
    exact = min(got * factor, 3.4e38)
    (error,) = ulps(np.array([got], np.float32), np.array([exact]))
    expected = abs(Fraction(got) - Fraction(exact)) / ulp(Fraction(exact), SINGLE)
    assert error == pytest.approx(float(expected))


def test_climbing_finds_a_peak_that_the_pool_does_not_hold():
    def error(x):
        return 1.0 / (1e-9 + abs(x[0] - math.pi))

    found = search.climb(error, [(float(i),) for i in range(1, 9)], lambda x: x)
    assert found.error > 1e6 > max(error((float(i),)) for i in range(1, 9))
    assert found.input[0] == pytest.approx(math.pi, abs=1e-6)


def test_climbing_over_columns_finds_it_too_and_keeps_to_what_is_valid():
    def errors(x):
        return 1.0 / (1e-9 + np.abs(x[:, 0].astype(np.float64) - 0.7))

    pool = np.linspace(0.01, 0.5, 100, dtype=np.float32)[:, None]
    error, x = search.climb_columns(errors, pool, lambda x: np.clip(x, 0, np.float32(0.6)))
    assert x == np.float32(0.6)
    assert error == pytest.approx(10, rel=1e-3)


@given(st.tuples(*[st.floats(-2, 2)] * 4))
def test_a_repaired_quaternion_is_one_that_a_receiver_takes(q):
    assert 0.99 <= math.hypot(*search.unit(q)) <= 1.01
