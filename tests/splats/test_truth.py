"""The definition in float64 is what SPLATS.md says, which is here once more, in sixty digits."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
from splatbus_server.view import Intrinsics, View
from splatbus_splats.gaussians import Gaussians
from splatbus_wire.messages import Placement
from splatbus_wire.poses import Pose

from tests.splats.shots import HEIGHT, WIDTH, cloud, exact, some, view_of

LENS = Intrinsics(50.0, 55.0, WIDTH / 2, HEIGHT / 2)
DEPTHS = (2.9, 3.1, 4.9, 5.1)
PLANES = view_of(intrinsics=LENS._replace(near=3, far=5))
PLACED = view_of(
    Pose((0.2, -0.3, -1), (0, 0.1, 0, 0.99**0.5)),
    Placement("default", Pose((0, 0, 0.5), (0, 0.6, 0, 0.8)), 0.7),
    Placement("other", Pose((1, -1, 9), (0.5, 0.5, 0.5, 0.5)), 1.8),
    intrinsics=Intrinsics(40.0, 70.0, 11.3, 58.9, 0.01, 100.0),
)
FRONT = view_of(intrinsics=LENS)
RED_AND_BLUE = [(1, 0, 0), (0, 0, 1)]
BEHIND_EACH_OTHER = [(0, 0, z) for z in (5, 4, 3, 2)]
SCENES: dict[str, tuple[View, dict[str, Gaussians]]] = {
    "many": (FRONT, {"default": cloud(40)}),
    "placed": (PLACED, {"default": cloud(30), "other": cloud(20, 1, seed=5)}),
    "planes of the view": (PLANES, {"default": some([(i - 4, 0, i) for i in DEPTHS], 0.3)}),
    "nearest": (FRONT, {"default": some([(0.01, 0, 0.19), (0, 0, 0.21), (0, 0, -3)], 0.05)}),
    "equal depths": (FRONT, {"default": some([(0, 0, 2)] * 2, 20, 0.5, RED_AND_BLUE)}),
    "opaque": (FRONT, {"default": some(BEHIND_EACH_OTHER, 20, [0.5, 0.999, 0.95, 0.9])}),
    "nearly": (FRONT, {"default": some(BEHIND_EACH_OTHER, 20, [0.5, 0.9, 0.95, 0.9])}),
    "no light for a third": (FRONT, {"default": some(BEHIND_EACH_OTHER, 50, 1.0)}),
    "dark and bright": (FRONT, {"default": some((0, 0, 2), 20, 0.5, (-3, 2, 0.5))}),
    "turned": (FRONT, {"default": some((0.3, -0.2, 2), (0.3, 0.1, 0.02), 0.9,
               rotations=(0.1, 0.5, -0.3, 0.7))}),
    "needle": (FRONT, {"default": some((0, 0, 3), (1e7, 1e-3, 0), 0.9,
               rotations=(0, 0, 0.38, 0.92))}),
    "leaf": (FRONT, {"default": some((0, 0, 3), (1e7, 1e-3, 1e7), 0.9,
             rotations=(0.2, 0, 0.38, 0.9))}),
    "beside": (FRONT, {"default": some((9, 5, 1), (3, 3, 1), 1.0, rotations=(0.1, 0.2, 0.3, 1))}),
    "point": (FRONT, {"default": some((0.1, 0.1, 0.25), (0, 0, 0), 1.0)}),
    "vast": (FRONT, {"default": some((1, 1, 40), (1e-20, 1e15, 2), 0.7,
             rotations=(0.3, 0.1, 0.4, 0.1))}),
    "nothing": (FRONT, {}),
}  # fmt: skip


def turn_of(quaternion: Any) -> Any:
    q = mpmath.matrix([mpmath.mpf(float(each)) for each in quaternion])
    a, b, c, w = q / mpmath.norm(q)
    return mpmath.matrix([
        [w*w + a*a - b*b - c*c, 2*(a*b - w*c), 2*(a*c + w*b)],
        [2*(a*b + w*c), w*w - a*a + b*b - c*c, 2*(b*c - w*a)],
        [2*(a*c - w*b), 2*(b*c + w*a), w*w - a*a - b*b + c*c],
    ])  # fmt: skip


def column(values: Any) -> Any:
    return mpmath.matrix([mpmath.mpf(float(each)) for each in values])


def harmonics(direction: Any) -> list[Any]:
    """Real ones, as the complex ones of a library have them."""
    x, y, z = direction
    theta, phi, found = mpmath.acos(z), mpmath.atan2(y, x), []
    for degree in range(4):
        for order in range(-degree, degree + 1):
            value = mpmath.spherharm(degree, abs(order), theta, phi) * mpmath.sqrt(2 - (not order))
            found.append(value.imag if order < 0 else value.real)
    return found


def slope(value: Any, focal: Any, center: Any, size: int) -> Any:
    """Held to the image and 0.3 of half its width beyond."""
    margin = mpmath.mpf("0.3") * size / (2 * focal)
    return max(-center / focal - margin, min(value, (size - center) / focal + margin))


def flattened(view: View, objects: dict[str, Gaussians]) -> list[tuple[Any, ...]]:
    """Depth, centre, inverse covariance, opacity and colour of what is drawn, near ones first."""
    fx, fy, cx, cy, near, far = (mpmath.mpf(each) for each in view.intrinsics)
    camera, found = view.poses.camera, []
    for name, g in objects.items():
        pose, scale = view.of(name).placement.pose, mpmath.mpf(view.of(name).placement.scale)
        turn, eye = turn_of(pose.rotation), column(camera.position) - column(pose.position)
        whole = turn_of(camera.rotation).T * turn
        for i in range(len(g)):
            sight = scale * column(g.means[i]) - turn.T * eye
            x, y, z = whole * sight
            if not max(near, mpmath.mpf("0.2")) < z <= far:
                continue
            sx, sy = slope(x / z, fx, cx, view.width), slope(y / z, fy, cy, view.height)
            J = mpmath.matrix([[fx / z, 0, -fx * sx / z], [0, fy / z, -fy * sy / z]])
            A = scale * J * whole * turn_of(g.rotations[i]) * mpmath.diag(column(g.scales[i]))
            inverse = mpmath.inverse(A * A.T + mpmath.mpf("0.3") * mpmath.eye(2))
            Y, k = harmonics(sight / mpmath.norm(sight)), g.coefficients[i].astype(float)
            seen = [mpmath.fdot(Y[: len(k)], k[:, channel]) for channel in range(3)]
            colors = [max(0, each + mpmath.mpf("0.5")) for each in seen]
            center = mpmath.matrix([fx * x / z + cx, fy * y / z + cy])
            found.append((z, center, inverse, float(g.opacities[i]), colors))
    return sorted(found, key=lambda each: each[0])


def pixel(flat: list[tuple[Any, ...]], x: int, y: int) -> list[float]:
    """Red, green, blue, alpha and Σ(1/z)αT."""
    sums, left = [mpmath.mpf(0)] * 5, mpmath.mpf(1)
    for z, center, inverse, opacity, colors in flat:
        d = column((x + 0.5, y + 0.5)) - center
        alpha = min(float(np.float32(0.99)), opacity * mpmath.exp(-(d.T * inverse * d)[0] / 2))
        if alpha < 1 / mpmath.mpf(255):
            continue
        if left * (1 - alpha) < mpmath.mpf("1e-4"):
            break
        weights = (*colors, 1, 1 / z)
        sums = [each + left * alpha * weight for each, weight in zip(sums, weights, strict=True)]
        left *= 1 - alpha
    return [float(each) for each in sums]


@pytest.mark.parametrize("name", SCENES)
def test_a_picture_is_what_the_page_says(name: str) -> None:
    view, objects = SCENES[name]
    image = exact(view, objects)
    assert bool(image.color.any()) == bool(objects)
    with mpmath.workdps(60):
        flat = flattened(view, objects)
        for y, x in [divmod(i, WIDTH) for i in range(0, WIDTH * HEIGHT, 97)]:
            found = [*image.color[y, x], image.inverse[y, x]]
            assert found == pytest.approx(pixel(flat, x, y), rel=1e-7, abs=1e-12), (x, y)
