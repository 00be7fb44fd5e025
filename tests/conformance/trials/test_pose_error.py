"""How far a pose is off, and what explains it: against poses that are wrong in known ways."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.oracle import ENGINES, exact
from splatbus_conformance.trials.moves.pose_error import (
    BUDGET_U,
    ORDER,
    engine_of,
    off,
    read_pose,
    rotation_budget,
    why,
)
from splatbus_conformance.trials.testee.adapter import Greeting

POSE = Pose((1.0, -2.0, 5.0), (-0.1, 0.2, -0.3, math.sqrt(0.86)))
SIZE = (1920, 1080)


def greeting(axes, *, units=1.0, single=False):
    return Greeting("it", axes, units, single, frozenset(("start",)))


def off_by(got, right=POSE, *, single=False):
    return off(got, exact(right.position), exact(right.rotation), single=single, size=SIZE)


def test_the_right_pose_is_not_off():
    found = off_by(POSE)
    assert (found.position, found.rotation, found.angle, found.distance) == (0, 0, 0, 0)
    assert found.pixels < 1e-9
    assert found.away == pytest.approx(math.sqrt(30))


def test_a_quaternion_of_the_other_sign_or_at_unit_length_is_the_same():
    assert off_by(Pose(POSE.position, tuple(-n for n in POSE.rotation))).rotation == 0
    longer = Pose(POSE.position, tuple(1.005 * n for n in POSE.rotation))
    norm = math.hypot(*longer.rotation)
    unit = Pose(POSE.position, tuple(n / norm for n in longer.rotation))
    assert off_by(unit, longer).rotation < BUDGET_U


def test_the_next_number_is_one_ulp_off():
    x, y, z = POSE.position
    assert off_by(Pose((math.nextafter(x, 2), y, z), POSE.rotation)).position == 1
    single = Pose((float(np.nextafter(np.float32(x), np.float32(2))), y, z), POSE.rotation)
    assert off_by(single, single=True).position == 1


def test_what_rounds_to_the_same_single_is_exact_for_an_engine_of_single_precision():
    near = Pose((1.0 + 1e-12, -2.0, 5.0), tuple(n + 1e-12 for n in POSE.rotation))
    assert off_by(near).position > 1000
    assert off_by(near, single=True).position == 0


def test_angles_are_those_of_scipy():
    turned = (Rotation.from_rotvec([0, 1e-9, 0]) * Rotation.from_quat(POSE.rotation)).as_quat()
    assert off_by(Pose(POSE.position, tuple(turned))).angle == pytest.approx(1e-9, rel=1e-5)


def test_pixels_are_those_of_a_pinhole_camera():
    """A sideways step of 0.001, seen at depth 1 with fx = 1920."""
    right = Rotation.from_quat(POSE.rotation).apply([0.001, 0, 0])
    moved = Pose(tuple(np.array(POSE.position) + right), POSE.rotation)
    assert off_by(moved).pixels == pytest.approx(1.92, rel=1e-6)


def test_a_point_that_passes_behind_the_camera_is_infinitely_far_off():
    ahead = Rotation.from_quat(POSE.rotation).apply([0, 0, 2.0])
    moved = Pose(tuple(np.array(POSE.position) + ahead), POSE.rotation)
    assert off_by(moved).pixels == math.inf


@pytest.mark.parametrize(("digits", "far"), [(3, True), (6, False), (9, False)])
def test_lost_digits_are_no_other_pose(digits, far):
    def shorten(number):
        return float(f"{number:.{digits - 1}e}")

    pose = Pose((1001.49, -2222.5, 3.3333333), POSE.rotation)
    shortened = Pose(*(tuple(map(shorten, part)) for part in pose))
    assert off_by(shortened, pose).far is far or digits == 3


def conjugate(q):
    return (-q[0], -q[1], -q[2], q[3])


def wrong(engine):
    """Poses on the wire that a mistake makes of `POSE` in the engine's axes."""
    p = tuple(map(float, engine.position_to_wire(POSE.position)))
    q = tuple(map(float, engine.quaternion_to_wire(POSE.rotation)))
    inverse = -Rotation.from_quat(q).inv().apply(p)
    yield ORDER, Pose(p, (q[3], *q[:3]))
    yield ORDER, Pose(p, conjugate(q))
    yield "it is world-to-camera", Pose(tuple(inverse), conjugate(q))
    yield "it is in the engine's axes", POSE
    yield "only its position was converted", Pose(p, POSE.rotation)
    yield "only its rotation was converted", Pose(POSE.position, q)
    yield "", Pose((9.0, -7.0, 1.0), q)
    yield "its position is 3 times what it should be", Pose(tuple(3 * n for n in p), q)
    first = (POSE.rotation[3], *POSE.rotation[:3])
    yield ORDER, Pose(p, tuple(map(float, engine.quaternion_to_wire(first))))


@pytest.mark.parametrize("axes", ["unity", "opengl"])
def test_mistakes_are_named(axes):
    engine = engine_of(greeting(axes), "camera_pose")
    for words, came in wrong(engine):
        assert why(POSE, came, engine) == words


def test_the_other_direction_of_the_table_is_named():
    engine = engine_of(greeting("unreal", units=1), "camera_pose")
    there = Pose(engine.position_to_wire(POSE.position), engine.quaternion_to_wire(POSE.rotation))
    back = Pose(
        engine.position_from_wire(POSE.position), engine.quaternion_from_wire(POSE.rotation)
    )
    words = "it was converted in the other direction of the table"
    assert why(POSE, back, engine) == words
    assert why(POSE, there, engine, "in") == words
    assert why(POSE, POSE, engine, "in") == "it is in the wire's axes"
    assert why(POSE, back, engine, "in", right=True) == "it is right"


def test_centimetres_are_named():
    engine = engine_of(greeting("unreal", units=100), "camera_pose")
    p = tuple(float(100 * n) for n in engine.position_to_wire(POSE.position))
    q = tuple(map(float, engine.quaternion_to_wire(POSE.rotation)))
    assert why(POSE, Pose(p, q), engine) == "its position is in the engine's units"


def test_blender_s_cameras_and_objects_go_by_different_rows():
    blender = greeting("blender")
    assert engine_of(blender, "camera_pose") == ENGINES["blender_camera"]
    assert engine_of(blender, "point_cloud_pose") == ENGINES["blender_object"]


def test_a_budget_is_that_of_the_precision_where_there_is_arithmetic():
    assert rotation_budget(greeting("blender"), "camera_pose") == BUDGET_U
    assert rotation_budget(greeting("blender", single=True), "camera_pose") == BUDGET_U * 2**29
    assert rotation_budget(greeting("unity", single=True), "camera_pose") == BUDGET_U


@pytest.mark.parametrize(
    "message",
    [
        {"position": {"x": 1, "y": 2, "z": 3}},
        {"position": [1, 2, 3], "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}},
        {"position": {"x": "1", "y": 2, "z": 3}, "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}},
    ],
)
def test_a_pose_without_its_members_cannot_be_read(message):
    assert read_pose(message) is None


def test_members_are_read_by_name():
    message = {"rotation": {"w": 1, "z": 0, "y": 0, "x": 0}, "position": {"z": 3, "y": 2, "x": 1}}
    assert read_pose(message) == Pose((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))
