"""The closed-form scene: values worked out by hand."""

import math
from dataclasses import replace

import pytest
from splatbus_renderer.scene import (
    Camera,
    Floor,
    ObjectPose,
    Scene,
    Sphere,
    default_camera,
    default_scene,
    exact_pixel,
)

QUARTER_TURN_ABOUT_Y = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
CAMERA = Camera(100, 80, 50.0, 50.0, 50.0, 40.0)
RED, WHITE, BLACK = (1.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
BALL = Scene((Sphere((0.0, 0.0, 4.0), 1.0, RED),), None, light=(0.0, 0.0, -1.0))
FLOOR = Scene((), Floor(1.0, 8.0, 1.0, WHITE, BLACK), light=(0.0, -1.0, 0.0))


def test_the_middle_of_a_sphere_lit_head_on_is_fully_bright_at_distance_minus_radius():
    assert exact_pixel(BALL, CAMERA, 50.0, 40.0) == ((1.0, 0.0, 0.0, 1.0), 3.0)


def test_a_miss_is_transparent_black_at_infinity():
    assert exact_pixel(BALL, CAMERA, 0.5, 0.5) == ((0.0, 0.0, 0.0, 0.0), math.inf)


def test_depth_is_planar_not_along_the_ray():
    wall = replace(BALL, spheres=(Sphere((0.0, 0.0, 1e6 + 2.0), 1e6, RED),))
    assert exact_pixel(wall, CAMERA, 95.0, 40.0)[1] == pytest.approx(2.0, abs=1e-5)


def test_image_x_grows_right_and_y_down_as_the_world_does():
    right_and_low = replace(BALL, spheres=(Sphere((2.0, 1.0, 4.0), 0.1, RED),))
    assert exact_pixel(right_and_low, CAMERA, 50.0 + 25.0, 40.0 + 12.5)[0][3] == 1.0
    assert exact_pixel(right_and_low, CAMERA, 50.0 - 25.0, 40.0 - 12.5)[0][3] == 0.0


@pytest.mark.parametrize(
    ("x", "z", "color"),
    [(0.5, 2.5, WHITE), (-0.5, 2.5, BLACK), (-0.5, 1.5, WHITE), (0.5, 1.5, BLACK)],
)
def test_the_floor_is_checkered_evenly_across_zero(x, z, color):
    u, v = 50.0 + 50.0 * x / z, 40.0 + 50.0 * 1.0 / z
    rgba, depth = exact_pixel(FLOOR, CAMERA, u, v)
    assert depth == pytest.approx(z)
    assert rgba == (*color, 1.0)


def test_the_floor_ends():
    assert exact_pixel(FLOOR, CAMERA, 50.0, 40.0 + 50.0 / 7.9)[0][3] == 1.0
    assert exact_pixel(FLOOR, CAMERA, 50.0, 40.0 + 50.0 / 8.1)[0][3] == 0.0


def test_near_and_far_cut_planar_depth():
    cut_to_the_far_side = replace(CAMERA, near=3.5)
    assert exact_pixel(BALL, cut_to_the_far_side, 50.0, 40.0)[1] == 5.0
    assert exact_pixel(BALL, replace(CAMERA, far=2.5), 50.0, 40.0)[1] == math.inf


def test_from_within_a_sphere_its_inside_is_seen():
    inside = replace(CAMERA, position=(0.0, 0.0, 4.0))
    color, depth = exact_pixel(BALL, inside, 50.0, 40.0)
    assert depth == 1.0
    assert color == pytest.approx((0.2, 0.0, 0.0, 1.0))


def test_a_camera_pose_is_camera_to_world():
    from_the_left = replace(CAMERA, position=(-4.0, 0.0, 4.0), rotation=QUARTER_TURN_ABOUT_Y)
    assert exact_pixel(BALL, from_the_left, 50.0, 40.0)[1] == 3.0


def test_an_object_pose_moves_the_scene_and_scales_its_depth():
    moved = replace(BALL, pose=ObjectPose((3.0, 0.0, 0.0), QUARTER_TURN_ABOUT_Y, 2.0))
    # the ball's centre goes to 2·R·(0, 0, 4) + (3, 0, 0) = (11, 0, 0), its radius to 2
    facing_x = replace(CAMERA, rotation=QUARTER_TURN_ABOUT_Y)
    color, depth = exact_pixel(moved, facing_x, 50.0, 40.0)
    assert depth == pytest.approx(9.0)
    assert color[0] == pytest.approx(1.0)  # the light turns with the object


def test_the_default_view_shows_every_sphere_and_both_checks():
    scene, camera = default_scene(), default_camera(64, 48)
    hues = set()
    for v in range(camera.height):
        for u in range(camera.width):
            (r, g, b, a), _ = exact_pixel(scene, camera, u + 0.5, v + 0.5)
            if a:
                hues.add((round(r / (r + g + b), 6), round(g / (r + g + b), 6)))
    assert len(hues) == len(scene.spheres) + 2
