from __future__ import annotations

import math

import numpy as np
import pytest
from splatbus_server.control import Poses
from splatbus_server.view import Intrinsics, View, field_of_view, lens_of, without_size
from splatbus_wire.lens import Lens, as_high, fits, scaled
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose, Vector

POSE = Pose((1.0, -2.0, 5.0), (-0.1, 0.2, -0.3, 0.9273618495495703))
FAR = (6e5, -6.4e5, 4.8e5)
STRAIGHT = Pose((0.0, 0.0, 0.0), IDENTITY.rotation)


def view(
    camera: Pose,
    points: Pose = IDENTITY,
    origin: Vector = (0.0, 0.0, 0.0),
    scale: float = 1.0,
) -> View:
    chair = Placement("chair", POSE, 3.0)
    poses = Poses(camera, {"default": Placement("default", points, scale), "chair": chair})
    size = (1920, 1080)
    return View(poses, field_of_view(*size), *size, frozenset(("color",)), 1, origin)


def ahead(camera: Pose, count: int = 100) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Points 1 to 10 units ahead of a camera that is not turned, in double precision."""
    random = np.random.default_rng(1)
    z = random.uniform(1.0, 10.0, (count, 1))
    return np.hstack((random.uniform(-0.5, 0.5, (count, 2)) * z, z)) + camera.position


def test_an_object_that_is_moved_turned_and_scaled() -> None:
    """[CNV-1, OBJ-1, OBJ-5, OBJ-6]: X_world = s·R·X + p, and depth is in units of the world."""
    camera = Pose((3.0, 1.0, -2.0), (0.2, 0.3, -0.1, 0.9273618495495703))
    seen, point = view(camera, POSE, scale=0.25), np.array((2.0, -1.0, 4.0, 1.0))
    turned = [  # by the worked example of chapter 7.3 of 1.0
        [0.74, 0.51641711, 0.43094474],
        [-0.59641711, 0.8, 0.06547237],
        [-0.31094474, -0.30547237, 0.9],
    ]
    in_world = 0.25 * (turned @ point[:3]) + POSE.position
    np.testing.assert_allclose((seen.object_to_world @ point)[:3], in_world, atol=1e-7)
    in_camera = seen.world_to_camera @ seen.object_to_world @ point
    np.testing.assert_allclose(seen.object_to_camera @ point, in_camera, atol=1e-14)
    np.testing.assert_allclose(
        seen.world_to_camera @ (*camera.position, 1.0), (0, 0, 0, 1), atol=1e-14
    )
    np.testing.assert_allclose(
        seen.object_to_world @ (*seen.eye(), 1.0), (*camera.position, 1.0), atol=1e-14
    )
    moved, matrix = seen.camera_relative(point[None, :3])
    np.testing.assert_allclose(matrix[:3, :3] @ moved[0], in_camera[:3], rtol=1e-6)
    chair, alone = seen.of("chair"), view(camera, POSE, scale=3.0)
    assert (chair.object_to_camera == alone.object_to_camera).all()
    assert chair.eye() == alone.eye()
    with pytest.raises(KeyError, match="no object 'table': the scene has default, chair"):
        seen.of("table")


def test_an_object_and_a_camera_that_move_together_look_the_same() -> None:
    """The centre is subtracted before rotating: 1 unit is 1 unit at 10¹⁵ too."""
    far = Pose((1e15, 1e15, -1e15), POSE.rotation)
    np.testing.assert_allclose(view(far, far).object_to_camera, np.eye(4), atol=1e-15)
    near = Pose((1e15 + 1.0, 1e15, -1e15), IDENTITY.rotation)
    offset = view(far, near).object_to_camera[:3, 3]
    assert np.linalg.norm(offset) == pytest.approx(1.0, abs=1e-15)


def test_origin_lets_the_wire_have_small_numbers() -> None:
    """[MEM-12]: a position in the scene's own coordinates is that on the wire plus `origin`."""
    on_wire = Pose((1.0, 2.0, 3.0), POSE.rotation)
    origin = (FAR[0] - 1.0, FAR[1] - 2.0, FAR[2] - 3.0)
    seen, means = view(on_wire, origin=origin), ahead(Pose(FAR, POSE.rotation))
    stored, given = (means - origin).astype(np.float32), np.empty((100, 3), np.float32)
    points, matrix = seen.camera_relative(stored, out=given)
    assert points is given
    np.testing.assert_allclose(points, means - FAR, atol=1e-6)
    in_own_coordinates, same_matrix = seen.camera_relative(means, origin=(0.0, 0.0, 0.0))
    np.testing.assert_allclose(in_own_coordinates, means - FAR, rtol=1e-7)
    assert points.dtype == matrix.dtype == np.float32
    assert (matrix == same_matrix).all()
    assert not matrix[:3, 3].any()
    assert (seen.eye(), seen.eye((0.0, 0.0, 0.0))) == (on_wire.position, FAR)


def test_a_scene_in_tiles_takes_a_matrix_a_tile() -> None:
    seen = view(Pose(FAR, POSE.rotation), Pose((0.5, 0.0, 0.0), POSE.rotation))
    tile, corner = (-3e5, 1e5, 9e5), np.array((1.0, -2.0, 3.0))
    in_tile = seen.tile_to_camera(tile)[:3] @ (*corner, 1.0)
    whole = seen.object_to_camera[:3] @ (*(corner + tile), 1.0)
    np.testing.assert_allclose(in_tile, whole, atol=1e-8)
    points, matrix = seen.camera_relative(corner[None], origin=tile)
    np.testing.assert_allclose(matrix[:3, :3] @ points[0], in_tile, rtol=1e-6)


def test_it_tells_what_the_plain_way_would_cost() -> None:
    near, far = (Pose(at, IDENTITY.rotation) for at in ((0.1, 0.2, 0.3), FAR))
    at_home, away = (view(each).pixel_errors(ahead(each)) for each in (near, far))
    assert 0.0 < at_home.camera_relative <= at_home.plain < 1e-3
    assert away.camera_relative < 1e-3 < 1.0 < away.plain
    assert at_home.points_seen == away.points_seen == 100
    beyond = Pose((1e39, 0.0, 0.0), IDENTITY.rotation)
    assert view(beyond).pixel_errors([[1e39, 0.0, 5.0]]).plain == math.inf


def test_only_points_that_are_seen_count() -> None:
    beside = [[5.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 101.0], [0.0, 0.0, 0.001]]
    assert view(STRAIGHT).pixel_errors(beside) == (0.0, 0.0, 0)
    assert view(STRAIGHT).pixel_errors([*beside, [0.0, 0.0, 2.0]]).points_seen == 1


LENS = Lens(1500.0, 1400.0, 900.0, 500.0, 1920, 1080, 0.01, 100.0)


def test_a_lens_for_images_of_another_size() -> None:
    """[CAM-5, CAM-6]: another shape shows more or less at the sides."""
    assert scaled(LENS, 960, 540) == Lens(750.0, 700.0, 450.0, 250.0, 960, 540, 0.01, 100.0)
    assert scaled(LENS, 1920, 1080) == as_high(LENS, 1920, 1080) == LENS
    assert fits(LENS, 854, 480)
    assert not fits(LENS, 640, 480)
    wide = as_high(LENS, 2160, 540)
    assert wide == pytest.approx(Lens(750.0, 700.0, 1050.0, 250.0, 2160, 540, 0.01, 100.0))


def test_the_default_field_of_view_keeps_its_angle() -> None:
    found = field_of_view(320, 240)
    assert found == pytest.approx(Intrinsics(207.846096908, 207.846096908, 160.0, 120.0))
    default = lens_of(found, 320, 240)
    assert without_size(default) == found
    assert without_size(as_high(default, 1000, 480)) == pytest.approx(field_of_view(1000, 480))
