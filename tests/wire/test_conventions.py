import pytest
from hypothesis import given, settings
from splatbus_conformance import oracle
from splatbus_wire.conventions import ENGINES
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import rotation_matrix

from tests.wire.stress import positions, quaternions, within


def rows(flat):
    return flat[:3], flat[3:6], flat[6:]


def flat(rows):
    return sum(rows, ())


def test_wire_and_oracle_know_the_same_engines():
    assert list(ENGINES) == list(oracle.ENGINES)


@pytest.mark.parametrize("name", ENGINES)
@settings(deadline=None, max_examples=100)
@given(positions, quaternions())
def test_every_engine_is_reached_and_left_as_exactly_as_granted(name, position, q):
    engine, truth, R = ENGINES[name], oracle.ENGINES[name], rotation_matrix(q)
    there = tuple(map(oracle.to_double, truth.position_from_wire(position)))
    back = tuple(map(oracle.to_double, truth.position_to_wire(position)))
    assert engine.position_from_wire(position) == there
    assert engine.position_to_wire(position) == back
    assert engine.matrix_from_wire(R) == flat(truth.matrix_from_wire(rows(R)))
    assert engine.matrix_to_wire(R) == flat(truth.matrix_to_wire(rows(R)))
    for way, got, exact in [
        ("from the wire", engine.rotation_from_wire(q), truth.quaternion_from_wire(q)),
        ("to the wire", engine.rotation_to_wire(q), truth.quaternion_to_wire(q)),
    ]:
        within(f"quaternion {way}, {name}", oracle.error_in_u(got, exact), 4, "u", q)  # ACC-7
    assert engine.from_wire(Pose(position, q)) == Pose(there, engine.rotation_from_wire(q))
    assert engine.to_wire(Pose(position, q)) == Pose(back, engine.rotation_to_wire(q))
