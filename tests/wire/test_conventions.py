import numpy as np
import pytest
from hypothesis import given, settings
from splatbus_conformance import oracle
from splatbus_wire.conventions import ENGINES
from splatbus_wire.poses import IDENTITY, Pose
from splatbus_wire.rotations import rotation_matrix

from tests.wire.stress import positions, quaternions, within

every_engine = pytest.mark.parametrize("name", ENGINES)
stress = settings(deadline=None, max_examples=60)


def rows(flat):
    return flat[:3], flat[3:6], flat[6:]


def flat(rows):
    return sum(rows, ())


def test_wire_and_oracle_know_the_same_engines():
    assert list(ENGINES) == list(oracle.ENGINES)


@every_engine
@stress
@given(positions)
def test_positions_are_correctly_rounded(name, position):
    engine, truth = ENGINES[name], oracle.ENGINES[name]
    there = tuple(map(oracle.to_double, truth.position_from_wire(position)))
    back = tuple(map(oracle.to_double, truth.position_to_wire(position)))
    assert engine.position_from_wire(position) == there
    assert engine.position_to_wire(position) == back


@every_engine
@stress
@given(quaternions())
def test_matrices_are_exact(name, q):
    engine, truth, R = ENGINES[name], oracle.ENGINES[name], rotation_matrix(q)
    assert engine.matrix_from_wire(R) == flat(truth.matrix_from_wire(rows(R)))
    assert engine.matrix_to_wire(R) == flat(truth.matrix_to_wire(rows(R)))


@every_engine
@stress
@given(quaternions())
def test_quaternions_are_within_4u(name, q):
    engine, truth = ENGINES[name], oracle.ENGINES[name]
    for way, got, exact in [
        ("from the wire", engine.rotation_from_wire(q), truth.quaternion_from_wire(q)),
        ("to the wire", engine.rotation_to_wire(q), truth.quaternion_to_wire(q)),
    ]:
        within(f"quaternion {way}, {name}", oracle.error_in_u(got, exact), 4, "u", q)  # ACC-7


@every_engine
@stress
@given(positions, quaternions())
def test_there_and_back_is_the_same_pose(name, position, rotation):
    engine = ENGINES[name]
    back = engine.to_wire(engine.from_wire(Pose(position, rotation)))
    assert oracle.norm_error(back.position, oracle.exact(position)) <= 2 * oracle.U
    assert oracle.error_in_u(back.rotation, oracle.exact(rotation)) <= 8


LANDMARKS = {
    # engine: the camera's own forward and up, and those of the wire's world, in the engine's axes
    "unity": ((0, 0, 1), (0, 1, 0), (0, 0, 1), (0, 1, 0)),
    "unreal": ((1, 0, 0), (0, 0, 1), (1, 0, 0), (0, 0, 1)),
    "blender_object": ((0, 1, 0), (0, 0, 1), (0, 1, 0), (0, 0, 1)),
    "blender_camera": ((0, 0, -1), (0, 1, 0), (0, 1, 0), (0, 0, 1)),
    "opengl": ((0, 0, -1), (0, 1, 0), (0, 0, -1), (0, 1, 0)),
    "opengl_camera": ((0, 0, -1), (0, 1, 0), (0, 0, 1), (0, -1, 0)),
}


@every_engine
def test_a_camera_at_rest_looks_forward_with_its_head_up(name):
    forward, up, forward_in_world, up_in_world = LANDMARKS[name]
    engine = ENGINES[name]
    turned = np.reshape(rotation_matrix(engine.from_wire(IDENTITY).rotation), (3, 3))
    assert turned @ forward == pytest.approx(forward_in_world, abs=1e-15)
    assert turned @ up == pytest.approx(up_in_world, abs=1e-15)


@every_engine
def test_one_unit_ahead_on_the_wire_is_one_metre_ahead_in_the_engine(name):
    engine = ENGINES[name]
    ahead = np.multiply(LANDMARKS[name][2], engine.scale)
    assert engine.position_from_wire((0.0, 0.0, 1.0)) == tuple(ahead)
