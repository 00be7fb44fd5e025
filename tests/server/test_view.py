from __future__ import annotations

import math

import numpy as np
import pytest
import splatbus_server
from splatbus_server import Semantics
from splatbus_server.control import Poses
from splatbus_server.view import Intrinsics, View, field_of_view
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

from tests.peers.raw_client import Reader

POSE = Pose((1.0, -2.0, 5.0), (-0.1, 0.2, -0.3, 0.9273618495495703))


FAR = (6e5, -6.4e5, 4.8e5)


def view(
    camera: Pose,
    points: Pose = IDENTITY,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    scale: float = 1.0,
) -> View:
    poses = Poses(camera, {"default": Placement("default", points, scale)})
    size = (1920, 1080)
    return View(poses, field_of_view(*size), *size, frozenset(("color",)), 1, origin)


def ahead(camera: Pose, count: int = 100) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Points 1 to 10 units ahead of a camera that is not turned, in double precision."""
    random = np.random.default_rng(1)
    z = random.uniform(1.0, 10.0, (count, 1))
    return np.hstack((random.uniform(-0.5, 0.5, (count, 2)) * z, z)) + camera.position


def test_the_worked_example_of_the_specification() -> None:
    """[CNV-1], chapter 7.3 of 1.0."""
    found = view(POSE).world_to_camera
    rotation = [
        [0.74, 0.51641711, 0.43094474],
        [-0.59641711, 0.8, 0.06547237],
        [-0.31094474, -0.30547237, 0.9],
    ]
    np.testing.assert_allclose(found[:3, :3], np.transpose(rotation), atol=5e-9)
    np.testing.assert_allclose(found[:3, 3], [-0.3781105, 2.6109447, -4.8], atol=5e-8)


def test_an_object_and_a_camera_that_move_together_look_the_same() -> None:
    np.testing.assert_allclose(view(POSE, POSE).object_to_camera, np.eye(4), atol=1e-15)
    np.testing.assert_allclose(
        view(POSE).object_to_camera, view(POSE).world_to_camera, rtol=1e-15, atol=1e-15
    )


def test_far_from_the_origin_what_is_near_the_camera_stays_near() -> None:
    """The centre is subtracted before rotating: 1 unit is 1 unit at 10¹⁵ too."""
    far = 1e15
    camera = Pose((far, far, -far), POSE.rotation)
    near = Pose((far + 1.0, far, -far), IDENTITY.rotation)
    offset = view(camera, near).object_to_camera[:3, 3]
    assert np.linalg.norm(offset) == pytest.approx(1.0, abs=1e-15)


def test_the_default_field_of_view() -> None:
    found = field_of_view(320, 240)
    assert found == pytest.approx(Intrinsics(207.846096908, 207.846096908, 160.0, 120.0))


def test_one_call_gives_what_single_precision_needs_far_from_the_origin() -> None:
    camera = Pose(FAR, IDENTITY.rotation)
    means = ahead(camera)
    points, matrix = view(camera).camera_relative(means)
    assert points.dtype == matrix.dtype == np.float32
    assert not matrix[:3, 3].any()
    np.testing.assert_allclose(points, means - FAR, rtol=1e-7)
    given = np.empty_like(points)
    assert view(camera).camera_relative(means, out=given).points is given


def test_it_tells_what_the_plain_way_would_cost() -> None:
    near, far = (Pose(at, IDENTITY.rotation) for at in ((0.1, 0.2, 0.3), FAR))
    at_home = view(near).pixel_errors(ahead(near))
    assert 0.0 < at_home.camera_relative <= at_home.plain < 1e-3
    away = view(far).pixel_errors(ahead(far))
    assert away.plain > 1.0
    assert away.camera_relative < 1e-3
    assert at_home.points_seen == away.points_seen == 100


def test_only_points_that_are_seen_count() -> None:
    camera = Pose((0.0, 0.0, 0.0), IDENTITY.rotation)
    beside = [[5.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 101.0], [0.0, 0.0, 0.001]]
    assert view(camera).pixel_errors(beside) == (0.0, 0.0, 0)
    assert view(camera).pixel_errors([*beside, [0.0, 0.0, 2.0]]).points_seen == 1


def test_a_point_that_single_precision_cannot_hold_is_infinitely_far_off() -> None:
    camera = Pose((1e39, 0.0, 0.0), IDENTITY.rotation)
    found = view(camera).pixel_errors([[1e39, 0.0, 5.0]])
    assert found.plain == math.inf
    assert found.camera_relative < 1e-3


def test_origin_lets_the_wire_have_small_numbers() -> None:
    """[MEM-12]: a position in the scene's own coordinates is that on the wire plus `origin`."""
    own = Pose(FAR, POSE.rotation)
    on_wire = Pose((1.0, 2.0, 3.0), POSE.rotation)
    origin = (FAR[0] - 1.0, FAR[1] - 2.0, FAR[2] - 3.0)
    seen = view(on_wire, origin=origin)
    means = ahead(own)
    stored = (means - origin).astype(np.float32)

    by_default, matrix = seen.camera_relative(stored)
    np.testing.assert_allclose(by_default, means - FAR, atol=1e-6)
    in_own_coordinates, same_matrix = seen.camera_relative(means, origin=(0.0, 0.0, 0.0))
    np.testing.assert_allclose(in_own_coordinates, means - FAR, atol=1e-6)
    assert (matrix == same_matrix).all()
    assert seen.eye() == on_wire.position
    assert seen.eye((0.0, 0.0, 0.0)) == FAR


def test_a_scene_in_tiles_takes_a_matrix_a_tile() -> None:
    camera = Pose(FAR, POSE.rotation)
    seen = view(camera, Pose((0.5, 0.0, 0.0), POSE.rotation))
    tile = (-3e5, 1e5, 9e5)
    corner = np.array((1.0, -2.0, 3.0))
    np.testing.assert_allclose(
        seen.tile_to_camera(tile)[:3] @ (*corner, 1.0),
        seen.object_to_camera[:3] @ (*(corner + tile), 1.0),
        atol=1e-8,
    )
    points, matrix = seen.camera_relative(corner[None], origin=tile)
    np.testing.assert_allclose(
        matrix[:3, :3] @ points[0], seen.tile_to_camera(tile)[:3] @ (*corner, 1.0), rtol=1e-6
    )


def test_an_object_that_is_scaled() -> None:
    """[OBJ-1, OBJ-6]: X_world = s·R·X + p, and depth is in units of the world."""
    placed, camera = Pose((0.5, 0.0, 3.0), POSE.rotation), Pose((1.0, -2.0, 5.0), IDENTITY.rotation)
    seen, plain = view(camera, placed, scale=0.25), view(camera, placed)
    point = np.array((2.0, -1.0, 4.0, 1.0))
    turned = plain.object_to_world[:3, :3] @ point[:3]
    in_world = seen.object_to_world @ point
    np.testing.assert_allclose(in_world[:3], 0.25 * turned + placed.position, rtol=1e-15)
    in_camera = seen.object_to_camera @ point
    np.testing.assert_allclose(in_camera, seen.world_to_camera @ in_world, atol=1e-15)
    np.testing.assert_allclose(
        seen.object_to_world @ (*seen.eye(), 1.0), (*camera.position, 1.0), atol=1e-14
    )
    moved, matrix = seen.camera_relative(point[None, :3])
    np.testing.assert_allclose(matrix[:3, :3] @ moved[0], in_camera[:3], rtol=1e-6)
    in_front = np.linalg.inv(seen.object_to_camera) @ (0.1, 0.1, 2.0, 1.0)
    errors = seen.pixel_errors(in_front[None, :3])
    assert errors.points_seen == 1
    assert 0.0 < errors.plain < 1e-3


def test_an_object_is_seen_from_its_own_place() -> None:
    """[OBJ-5]"""
    here, there = Pose((1.0, 0.0, 0.0), IDENTITY.rotation), Pose((0.0, 2.0, 0.0), POSE.rotation)
    placed = {"default": Placement("default", here), "chair": Placement("chair", there, 3.0)}
    both = View(Poses(POSE, placed), field_of_view(4, 2), 4, 2, frozenset(("color",)), 1)
    assert (both.of("default").object_to_camera == both.object_to_camera).all()
    assert (
        both.of("chair").object_to_camera == view(POSE, there, scale=3.0).object_to_camera
    ).all()
    assert both.of("chair").eye() == view(POSE, there, scale=3.0).eye()


def test_a_view_knows_the_origin_that_was_announced() -> None:
    semantics = Semantics(origin=FAR)
    with (
        splatbus_server.serve(4, 3, semantics=semantics, ipc_port=0, message_port=0) as bus,
        Reader(bus.address.ipc_port) as reader,
    ):
        assert bus.next_view(0.0) is None
        assert reader.open()["semantics"]["origin"] == list(FAR)
        found = bus.next_view(10.0)
        assert found is not None
        assert found.origin == FAR
        bus.publish(found, np.ones((3, 4, 3)), np.ones((3, 4)))
        assert bus.next_view(0.0) is None
