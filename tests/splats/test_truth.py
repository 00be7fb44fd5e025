"""The definition in float64 is what SPLATS.md says: by hand, and once more in fifty digits."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from splatbus_server.view import Intrinsics, View
from splatbus_splats.drawing.definition import LARGEST_ALPHA, Image, placed
from splatbus_splats.drawing.truth import at_pixels, truth
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import made
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

from tests.splats.shots import HEIGHT, WIDTH, some, view_of

LENS = Intrinsics(50.0, 50.0, WIDTH / 2, HEIGHT / 2)
MIDDLE = (HEIGHT // 2, WIDTH // 2)
"""The pixel whose centre is half a pixel right of and below the principal point."""


def seen(gaussians: Gaussians, view: View | None = None) -> Image:
    view = view or view_of(intrinsics=LENS)
    return truth(placed(view, {"default": gaussians}), view.intrinsics, view.width, view.height)


def test_one_gaussian_is_a_bell_of_its_projected_variance() -> None:
    image = seen(some((0, 0, 2), (0.2, 0.1, 5), 0.5, (0.25, 0.5, 1)))
    variances = np.array([(0.2 * 25) ** 2 + 0.3, (0.1 * 25) ** 2 + 0.3])
    for dx, dy in ((0, 0), (6, 0), (0, 3), (-4, 2)):
        q = (dx + 0.5) ** 2 / variances[0] + (dy + 0.5) ** 2 / variances[1]
        alpha = 0.5 * math.exp(-q / 2)
        at = MIDDLE[0] + dy, MIDDLE[1] + dx
        np.testing.assert_allclose(
            image.color[at], alpha * np.array([0.25, 0.5, 1, 1]), rtol=1e-6, atol=1e-7
        )
        np.testing.assert_allclose(image.inverse[at], alpha / 2)


def test_it_ends_where_alpha_is_less_than_a_255th() -> None:
    image = seen(some((0, 0, 2), 0.2, 0.5))
    alphas = image.color[..., 3]
    assert alphas[alphas > 0].min() >= 1 / 255
    radius = math.sqrt(2 * math.log(255 * 0.5) * (5**2 + 0.3))
    v, u = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    inside = np.hypot(u - WIDTH / 2, v - HEIGHT / 2) < radius
    np.testing.assert_array_equal(alphas > 0, inside)


def test_opacity_is_at_most_99_percent() -> None:
    assert seen(some((0, 0, 2), 5, 1.0)).color[MIDDLE][3] == LARGEST_ALPHA


def test_the_nearer_one_covers_the_farther_whatever_their_order() -> None:
    red, blue = (1, 0, 0), (0, 0, 1)
    for order in ((0, 1), (1, 0)):
        pick = np.array(order)
        means, colors = np.array([(0, 0, 2), (0, 0, 5)])[pick], np.array([red, blue])[pick]
        image = seen(some(means, 20, 0.5, colors))
        np.testing.assert_allclose(image.color[MIDDLE], [0.5, 0, 0.25, 0.75], atol=1e-5)
        np.testing.assert_allclose(image.inverse[MIDDLE], 0.5 / 2 + 0.25 / 5, rtol=1e-5)


def test_of_equal_depths_the_first_is_in_front() -> None:
    image = seen(some([(0, 0, 2), (0, 0, 2)], 20, 0.5, [(1, 0, 0), (0, 0, 1)]))
    np.testing.assert_allclose(image.color[MIDDLE], [0.5, 0, 0.25, 0.75], atol=1e-5)


def test_a_pixel_is_finished_before_the_gaussian_that_would_leave_too_little() -> None:
    depths, opacities = [(0, 0, z) for z in (2, 3, 4, 5)], np.array((0.9, 0.95, 0.999, 0.5))
    alphas = [seen(some(depths[:n], 200, opacities[:n])).color[MIDDLE][3] for n in range(1, 5)]
    np.testing.assert_allclose(alphas, [0.9, 0.995, 0.995, 0.995], rtol=1e-4)
    opacities[2] = 0.9
    alpha = seen(some(depths, 200, opacities)).color[MIDDLE][3]
    np.testing.assert_allclose(alpha, 0.99975, rtol=1e-5)


@pytest.mark.parametrize(("z", "is_drawn"), [(0.19, False), (0.1999, False), (0.21, True)])
def test_the_near_plane_is_for_centres(z: float, is_drawn: bool) -> None:
    assert bool(seen(some((0, 0, z), 0.05)).color.any()) is is_drawn


@pytest.mark.parametrize(("z", "is_drawn"), [(2.9, False), (3.1, True), (4.9, True), (5.1, False)])
def test_the_views_near_and_far_are_kept(z: float, is_drawn: bool) -> None:
    view = view_of(intrinsics=LENS._replace(near=3, far=5))
    assert bool(seen(some((0, 0, z)), view).color.any()) is is_drawn


def test_an_object_is_where_its_pose_and_scale_put_it() -> None:
    placement = Placement("default", Pose((1, 0, 6), (0, 0.6, 0, 0.8)), 2.0)
    image = seen(some([(0.3, 0.1, -0.5)], (0.1, 0.2, 0.05)), view_of(IDENTITY, placement))
    c, s = 0.8**2 - 0.6**2, 2 * 0.6 * 0.8
    x, y, z = 0.3, 0.1, -0.5
    at = (1 + 2 * (c * x + s * z), 2 * y, 6 + 2 * (-s * x + c * z))
    plain = seen(some([at], (0.2, 0.4, 0.1), rotations=(0, 0.6, 0, 0.8)), view_of())
    np.testing.assert_allclose(image.color, plain.color, atol=2e-6)
    np.testing.assert_allclose(image.inverse, plain.inverse, atol=1e-6)
    assert image.color.max() > 0.1


def test_harmonics_turn_with_their_object() -> None:
    gaussians = some((0, 0, 0), 0.5)
    coefficients = np.zeros((1, 4, 3), np.float32)
    coefficients[0, 3] = 0.5  # -x: bright where it is seen along -x
    gaussians = Gaussians(*list(vars(gaussians).values())[:4], coefficients)
    half = math.sqrt(0.5)
    shades = []
    for turn in ((0, half, 0, half), (0, -half, 0, half)):
        view = view_of(IDENTITY, Placement("default", Pose((0, 0, 4), turn)))
        color = seen(gaussians, view).color[MIDDLE]
        shades.append(color[0] / color[3])
    # The sight along z is, turned back by 90° about y, along -x, and along x.
    expected = 0.4886025119029199 * 0.5
    np.testing.assert_allclose(shades, [0.5 + expected, 0.5 - expected], atol=1e-6)


def test_colours_are_clamped_at_0_and_not_at_1() -> None:
    image = seen(some((0, 0, 2), 20, 0.5, (-3, 2, 0.5)))
    np.testing.assert_allclose(image.color[MIDDLE], [0, 1, 0.25, 0.5], atol=1e-5)


def test_some_pixels_are_those_of_the_whole_image() -> None:
    scene, view = placed(view_of(), {"default": made(200)}), view_of()
    whole = truth(scene, view.intrinsics, WIDTH, HEIGHT)
    columns, rows = np.array([0, 40, 95, 50]), np.array([0, 30, 63, 40])
    part = at_pixels(scene, view.intrinsics, WIDTH, HEIGHT, columns, rows)
    np.testing.assert_allclose(part.color, whole.color[rows, columns], rtol=1e-12)
    np.testing.assert_allclose(part.inverse, whole.inverse[rows, columns], rtol=1e-12)


def test_nothing_is_seen_where_nothing_is() -> None:
    for objects in ([], placed(view_of(), {"default": some((0, 0, -5))})):
        assert not truth(objects, LENS, 8, 8).color.any()


def alpha_in_digits(g: Gaussians, lens: Intrinsics, column: int, row: int) -> float:
    """The alpha of one Gaussian before a camera at the origin, in fifty digits."""
    with mpmath.workdps(50):
        x, y, z = (mpmath.mpf(float(a)) for a in g.means[0])
        q = mpmath.matrix([mpmath.mpf(float(a)) for a in g.rotations[0]])
        a, b, c, w = q / mpmath.norm(q)
        R = mpmath.matrix([
            [w*w + a*a - b*b - c*c, 2*(a*b - w*c), 2*(a*c + w*b)],
            [2*(a*b + w*c), w*w - a*a + b*b - c*c, 2*(b*c - w*a)],
            [2*(a*c - w*b), 2*(b*c + w*a), w*w - a*a - b*b + c*c],
        ])  # fmt: skip
        S = mpmath.diag([mpmath.mpf(float(a)) for a in g.scales[0]])
        limits = 1.3 * WIDTH / (2 * mpmath.mpf(lens.fx)), 1.3 * HEIGHT / (2 * mpmath.mpf(lens.fy))
        sx, sy = (max(-m, min(m, s)) for m, s in zip(limits, (x / z, y / z), strict=True))
        J = mpmath.matrix(
            [[lens.fx / z, 0, -lens.fx * sx / z], [0, lens.fy / z, -lens.fy * sy / z]]
        )
        M = J * R * S
        sigma = M * M.T + mpmath.mpf("0.3") * mpmath.eye(2)
        d = mpmath.matrix([
            column + mpmath.mpf("0.5") - (lens.fx * x / z + lens.cx),
            row + mpmath.mpf("0.5") - (lens.fy * y / z + lens.cy),
        ])  # fmt: skip
        power = (d.T * mpmath.inverse(sigma) * d)[0] / 2
        alpha = min(
            mpmath.mpf(LARGEST_ALPHA), mpmath.mpf(float(g.opacities[0])) * mpmath.exp(-power)
        )
        return float(alpha) if alpha >= 1 / mpmath.mpf(255) else 0.0


@pytest.mark.parametrize(
    "gaussians",
    [
        some((0.3, -0.2, 2), (0.3, 0.1, 0.02), 0.9, rotations=(0.1, 0.5, -0.3, 0.7)),
        some((0, 0, 3), (1e7, 1e-3, 0), 0.9, rotations=(0, 0, 0.38, 0.92)),
        some((0, 0, 3), (1e7, 1e-3, 1e7), 0.9, rotations=(0.2, 0, 0.38, 0.9)),
        some((9, 5, 1), (3, 3, 1), 1.0, rotations=(0.1, 0.2, 0.3, 1)),
        some((0.1, 0.1, 0.25), (0, 0, 0), 1.0),
        some((1, 1, 40), (1e-20, 1e15, 2), 0.7, rotations=(0.3, 0.1, 0.4, 0.1)),
    ],
    ids=["plain", "needle", "leaf", "beside", "point", "vast"],
)
def test_alphas_are_right_to_the_last_digits(gaussians: Gaussians) -> None:
    lens = Intrinsics(50.0, 55.0, WIDTH / 2, HEIGHT / 2)
    alphas = seen(gaussians, view_of(intrinsics=lens)).color[..., 3]
    assert alphas.max() > 0
    for row, column in [divmod(i, WIDTH) for i in range(0, WIDTH * HEIGHT, 97)]:
        right = alpha_in_digits(gaussians, lens, column, row)
        assert alphas[row, column] == pytest.approx(right, rel=1e-7, abs=1e-12)
