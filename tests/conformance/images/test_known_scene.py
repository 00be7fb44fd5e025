"""The harness's own closed form, against its page and against numbers worked out by hand."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from splatbus_conformance.images.known_scene import (
    BALL,
    BOBS,
    FLOOR,
    NOTHING,
    SceneState,
    render,
    surface,
)
from splatbus_conformance.images.pinhole import Camera, ObjectPlacement, Rigid, rigid
from splatbus_renderer.scene import Camera as ReferenceCamera
from splatbus_renderer.scene import ObjectPose, Scene, default_scene, exact_pixel

PAGE = Path(__file__).parents[3] / "conformance" / "SCENE.md"
ROW = re.compile(r"^\| (\d+) \| (\d+) \| .* \| \((.*)\) \| (.*) \|$", re.MULTILINE)
FOCAL = 207.84609690826528
USUAL = Camera(Rigid(), FOCAL, FOCAL, 160.0, 120.0, 320, 240, 0.01, 100.0)
UNTURNED = (0.0, 0.0, 0.0, 1.0)


def small(position=(0.0, 0.0, 0.0), rotation=UNTURNED, width=32, height=24) -> Camera:
    focal = height / (2.0 * math.tan(math.radians(30.0)))
    pose = rigid(position, rotation)
    return Camera(pose, focal, focal, width / 2, height / 2, width, height, 0.01, 100.0)


def test_the_page_gives_numbers_that_are_right() -> None:
    exact = render(USUAL)
    rows = ROW.findall(PAGE.read_text("utf-8"))
    assert len(rows) == 6
    for i, j, color, depth in rows:
        expected = [float(number) for number in color.split(",")]
        assert exact.color[int(i), int(j)] == pytest.approx(expected, rel=1e-5)
        wanted = math.inf if depth == "empty" else float(depth)
        assert exact.depth[int(i), int(j)] == pytest.approx(wanted, rel=1e-8)


def test_straight_ahead_is_the_first_sphere_at_its_distance_less_its_radius() -> None:
    camera = USUAL._replace(cx=160.5, cy=120.5)
    assert render(camera).depth[120, 160] == 3.0


def test_from_above_the_square_is_as_far_as_the_camera_is_high() -> None:
    quarter = math.sqrt(0.5)
    seen = render(small((0.0, -2.0, 0.0), (-quarter, 0.0, 0.0, quarter)))
    floor = seen.what >= FLOOR
    assert floor.mean() > 0.5
    assert seen.depth[floor] == pytest.approx(3.05)


def test_below_the_square_it_is_seen_too() -> None:
    quarter = math.sqrt(0.5)
    seen = render(small((0.0, 2.0, 0.0), (quarter, 0.0, 0.0, quarter)))
    assert seen.depth[seen.what >= FLOOR] == pytest.approx(0.95)


def test_a_moved_scene_seen_by_a_camera_that_moved_along_is_the_same_image() -> None:
    q = (0.3, -0.5, 0.1, 0.8)
    alone, away = render(small()), rigid((1e6, -2e6, 3e6), q)
    along = small()._replace(pose=away)
    moved = render(along, SceneState(ObjectPlacement(away)))
    assert np.mean(alone.what == moved.what) > 0.99
    both = (alone.what == moved.what) & (alone.what != NOTHING)
    assert moved.depth[both] == pytest.approx(alone.depth[both], rel=1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_it_agrees_with_the_reference_s_own_closed_form(seed: int) -> None:
    rng = np.random.default_rng(seed)
    position, place = rng.uniform(-6, 6, 3), rng.uniform(-3, 3, 3)
    camera = small(position, rng.normal(size=4), width=16, height=12)
    scene = rigid(place, rng.normal(size=4))
    theirs = ReferenceCamera(
        *(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy),
        tuple(position),
        tuple(map(tuple, camera.pose.rotation)),
    )
    given, pose = default_scene(), ObjectPose(tuple(place), tuple(map(tuple, scene.rotation)))
    exact = render(camera, SceneState(ObjectPlacement(scene)))
    pixels = [
        [
            exact_pixel(Scene(given.spheres, given.floor, given.light, pose), theirs, u, v)
            for u in np.arange(16) + 0.5
        ]
        for v in np.arange(12) + 0.5
    ]
    color = np.array([[c for c, _ in row] for row in pixels])
    depth = np.array([[z for _, z in row] for row in pixels])
    assert exact.agreement(color, depth) == 1.0
    assert exact.color_error(color).max() < 1e-9


def test_what_is_off_by_more_than_a_255th_or_by_1e_4_is_wrong() -> None:
    exact = render(small())
    assert exact.certain.mean() > 0.95
    assert exact.agreement(exact.color + 1.1 / 255, exact.depth) == 0.0
    wrong = ~exact.depth_is_right(exact.depth * 1.0002)
    assert wrong[exact.certain & (exact.what != NOTHING)].mean() > 0.9
    assert exact.depth_is_right(exact.depth * (1 + 1e-7)).all()


def test_a_pixel_at_an_edge_is_not_certain() -> None:
    """The top of the first sphere: y/z = −1/√15 in units of d."""
    focal = 100.0
    top = -focal / math.sqrt(15.0)
    for shift, certain in ((0.0, False), (0.01, True)):
        camera = Camera(Rigid(), focal, focal, 0.5, 0.5 - top - shift, 1, 1, 0.01, 100.0)
        assert render(camera).certain[0, 0] == certain


def test_a_camera_whose_far_plane_touches_a_surface_is_not_certain() -> None:
    camera = USUAL._replace(cx=160.5, cy=120.5, far=3.0 * (1 + 1e-7))
    assert not render(camera).certain[120, 160]


def test_surfaces_tell_how_far_outside_of_them_a_point_lies() -> None:
    points = np.array([(0.0, 0.0, 2.5), (0.0, 1.0, 0.0)])
    distance, normal = surface(np.array([0, FLOOR]), points)
    assert distance == pytest.approx([0.5, 0.05])
    assert normal.tolist() == [[0.0, 0.0, -1.0], [0.0, -1.0, 0.0]]


def test_an_object_of_half_its_size_at_half_its_distance_looks_the_same_and_is_nearer() -> None:
    """The camera is the point from which it shrinks: colours stay, depths in world units halve."""
    usual, small_one = render(small()), render(small(), SceneState(ObjectPlacement(scale=0.5)))
    assert (small_one.what == usual.what).all()
    assert small_one.color == pytest.approx(usual.color)
    seen = usual.what != NOTHING
    assert small_one.depth[seen] == pytest.approx(0.5 * usual.depth[seen])


@pytest.mark.parametrize("scale", [1e-3, 0.25, 7.0])
def test_a_scaled_object_is_cut_by_the_planes_of_the_world(scale: float) -> None:
    seen = render(small()._replace(near=3.0, far=4.0), SceneState(ObjectPlacement(scale=scale)))
    depths = seen.depth[seen.what != NOTHING]
    assert ((depths >= 3.0) & (depths <= 4.0)).all()


def test_the_ball_is_placed_by_itself_where_it_is_an_object() -> None:
    still, camera = ObjectPlacement(), USUAL._replace(cx=160.5, cy=120.5)
    ahead = ObjectPlacement(Rigid(position=np.array((-0.75, -0.275, 0.6))), 0.5)
    seen = render(camera, SceneState(still, ahead))
    assert seen.what[120, 160] == 2 * BALL
    assert seen.depth[120, 160] == pytest.approx(0.5 * 2.8 + 0.6 - 0.225)
    alone = render(small(), SceneState(still, still))
    assert (alone.what == render(small()).what).all()


@pytest.mark.parametrize(("time", "y"), [(0.0, 0.4), (1.0, 0.15), (2.0, -0.1), (4.0, 0.4)])
def test_one_sphere_bobs(time: float, y: float) -> None:
    camera = USUAL._replace(pose=Rigid(position=np.array((-1.6, y, 0.0))), cx=160.5, cy=120.5)
    seen = render(camera, SceneState(time=time))
    assert seen.what[120, 160] == 2 * BOBS
    assert seen.depth[120, 160] == pytest.approx(2.6)
