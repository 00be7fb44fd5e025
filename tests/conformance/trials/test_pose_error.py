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


def greeting(axes, *, units=1.0, single=False):
    return Greeting("it", axes, units, single, frozenset(("start",)))


def off_by(position=POSE.position, rotation=POSE.rotation, right=POSE, *, single=False):
    right = exact(right.position), exact(right.rotation)
    return off(Pose(position, rotation), *right, single=single, size=(1920, 1080))


def test_the_right_pose_is_not_off_nor_its_quaternion_of_the_other_sign():
    for sign in (1, -1):
        found = off_by(rotation=tuple(sign * n for n in POSE.rotation))
        assert (found.position, found.rotation, found.angle, found.distance) == (0, 0, 0, 0)
    assert found.pixels < 1e-9
    assert found.away == pytest.approx(math.sqrt(30))


def test_the_next_number_is_one_ulp_off_in_the_precision_that_an_engine_holds():
    x, *others = POSE.position
    assert off_by((math.nextafter(x, 2), *others)).position == 1
    assert (
        off_by((float(np.nextafter(np.float32(x), np.float32(2))), *others), single=True).position
        == 1
    )
    near = (x + 1e-12, *others), tuple(n + 1e-12 for n in POSE.rotation)
    assert off_by(*near).position > 1000
    assert (off_by(*near, single=True).position, off_by(*near, single=True).rotation) == (0, 0)


def test_angles_are_those_of_scipy():
    turned = (Rotation.from_rotvec([0, 1e-9, 0]) * Rotation.from_quat(POSE.rotation)).as_quat()
    assert off_by(rotation=tuple(turned)).angle == pytest.approx(1e-9, rel=1e-5)


@pytest.mark.parametrize(
    ("step", "pixels"), [((0.001, 0, 0), 1.92), ((0, 0.001, 0), 1.92), ((0, 0, 2), math.inf)]
)
def test_pixels_are_those_of_a_pinhole_camera(step, pixels):
    """At depth 1 with fx = 1920; a point that passes behind the camera is infinitely far off."""
    moved = POSE.position + Rotation.from_quat(POSE.rotation).apply(step)
    assert off_by(tuple(moved)).pixels == pytest.approx(pixels, rel=1e-6)


def wire(engine, pose=POSE):
    p, q = engine.position_to_wire(pose.position), engine.quaternion_to_wire(pose.rotation)
    return tuple(map(float, p)), tuple(map(float, q))


def wrong(engine):
    """Poses on the wire that a mistake makes of `POSE` in the engine's axes."""
    p, q = wire(engine)
    conjugate = (*(-n for n in q[:3]), q[3])
    first = Pose(POSE.position, (POSE.rotation[3], *POSE.rotation[:3]))
    yield ORDER, Pose(p, (q[3], *q[:3]))
    yield ORDER, Pose(p, conjugate)
    yield ORDER, Pose(p, wire(engine, first)[1])
    yield "it is world-to-camera", Pose(tuple(-Rotation.from_quat(q).inv().apply(p)), conjugate)
    yield "it is in the engine's axes", POSE
    yield "only its position was converted", Pose(p, POSE.rotation)
    yield "only its rotation was converted", Pose(POSE.position, q)
    yield "its position is 3 times what it should be", Pose(tuple(3 * n for n in p), q)
    yield "", Pose((9.0, -7.0, 1.0), q)


@pytest.mark.parametrize("axes", ["unity", "opengl"])
def test_mistakes_are_named(axes):
    engine = engine_of(greeting(axes), "camera_pose")
    for words, came in wrong(engine):
        assert why(POSE, came, engine) == words


def test_the_other_direction_of_the_table_is_named_and_centimetres():
    engine = engine_of(greeting("unreal"), "camera_pose")
    there = Pose(*wire(engine))
    back = Pose(
        engine.position_from_wire(POSE.position), engine.quaternion_from_wire(POSE.rotation)
    )
    words = "it was converted in the other direction of the table"
    assert why(POSE, back, engine) == words
    assert why(POSE, there, engine, "in") == words
    assert why(POSE, POSE, engine, "in") == "it is in the wire's axes"
    assert why(POSE, back, engine, "in", right=True) == "it is right"
    engine = engine_of(greeting("unreal", units=100), "camera_pose")
    p, q = wire(engine)
    larger = Pose(tuple(100 * n for n in p), q)
    assert why(POSE, larger, engine) == "its position is in the engine's units"


def test_blender_s_cameras_and_objects_go_by_different_rows_and_only_one_needs_arithmetic():
    rows = [engine_of(greeting("blender"), it) for it in ("camera_pose", "point_cloud_pose")]
    assert rows == [ENGINES["blender_camera"], ENGINES["blender_object"]]
    for axes, single, budget in (
        ("blender", False, BUDGET_U),
        ("blender", True, BUDGET_U * 2**29),
        ("unity", True, BUDGET_U),
    ):
        assert rotation_budget(greeting(axes, single=single), "camera_pose") == budget


def test_members_are_read_by_name_and_a_pose_without_them_cannot_be():
    position, rotation = {"z": 3, "y": 2, "x": 1}, {"w": 1, "z": 0, "y": 0, "x": 0}
    read = read_pose({"rotation": rotation, "position": position})
    assert read == Pose((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))
    assert read_pose({"position": position}) is None
    for other in ([1, 2, 3], position | {"x": "1"}):
        assert read_pose({"position": other, "rotation": rotation}) is None
