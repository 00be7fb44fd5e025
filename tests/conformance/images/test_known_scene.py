"""The harness's own closed form, against its page and against numbers worked out by hand."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from splatbus_conformance.images.known_scene import FLOOR, NOTHING, SceneState, render, surface
from splatbus_conformance.images.pinhole import Camera, ObjectPlacement, Rigid, rigid
from splatbus_renderer.demo import camera_of, scene_at
from splatbus_renderer.scene import exact_pixel
from splatbus_server.control import Poses
from splatbus_server.view import Intrinsics, View
from splatbus_wire.messages import Placement
from splatbus_wire.poses import Pose

PAGE = Path(__file__).parents[3] / "conformance" / "SCENE.md"
ROW = re.compile(r"^\| (\d+) \| (\d+) \| .* \| \((.*)\) \| (.*) \|$", re.MULTILINE)
FOCAL = 207.84609690826528
USUAL = Camera(Rigid(), FOCAL, FOCAL, 160.0, 120.0, 320, 240, 0.01, 100.0)
SMALL = USUAL._replace(fx=FOCAL / 10, fy=FOCAL / 10, cx=16.0, cy=12.0, width=32, height=24)


def test_the_page_gives_numbers_that_are_right() -> None:
    exact = render(USUAL)
    rows = ROW.findall(PAGE.read_text("utf-8"))
    assert len(rows) == 6
    for i, j, color, depth in rows:
        expected = [float(number) for number in color.split(",")]
        assert exact.color[int(i), int(j)] == pytest.approx(expected, rel=1e-5)
        wanted = math.inf if depth == "empty" else float(depth)
        assert exact.depth[int(i), int(j)] == pytest.approx(wanted, rel=1e-8)


@pytest.mark.parametrize("seed", range(8))
def test_it_agrees_with_the_reference_s_own_closed_form(seed: int) -> None:
    """Wherever the camera, the scene and its ball are, at any time, between planes that cut."""
    rng = np.random.default_rng(seed)

    def anywhere(reach: float) -> Pose:
        turned = rng.normal(size=4)
        return Pose(tuple(rng.uniform(-reach, reach, 3)), tuple(turned / np.linalg.norm(turned)))

    camera, time = anywhere(6.0), rng.uniform(0.0, 4.0)
    placed = {it: Placement(it, anywhere(3.0), rng.uniform(0.5, 2.0)) for it in ("default", "ball")}
    lens = Intrinsics(14.0, 13.0, 8.25, 5.75, 2.0, 12.0)
    view = View(Poses(camera, placed), lens, 16, 12, frozenset(), 1)
    scene, theirs = scene_at(time, view), camera_of(view)
    ours = Camera(rigid(*camera), *lens[:4], 16, 12, *lens[4:])
    state = SceneState(
        *(ObjectPlacement(rigid(*it.pose), it.scale) for it in placed.values()), time
    )
    rows, columns = np.arange(12) + 0.5, np.arange(16) + 0.5
    pixels = [[exact_pixel(scene, theirs, u, v) for u in columns] for v in rows]
    color = np.array([[c for c, _ in row] for row in pixels])
    depth = np.array([[z for _, z in row] for row in pixels])
    exact = render(ours, state)
    assert exact.agreement(color, depth) == 1.0
    assert exact.color_error(color).max() < 1e-9


def test_what_is_off_by_more_than_a_255th_or_by_1e_4_is_wrong() -> None:
    exact = render(SMALL)
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
