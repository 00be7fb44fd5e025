"""The picture: three panels, each pixel where and what it should be."""

import numpy as np
import pytest
from splatbus_viewer.display import Shown
from splatbus_viewer.picture import three_panels

from tests.viewer.test_mesh import CAMERA

WIDTH, HEIGHT = CAMERA.width, CAMERA.height
GAP, LINE = 11, 16


def image(alpha=1.0):
    """A slope: red above, green below; nothing in the leftmost fifth."""
    color = np.zeros((HEIGHT, WIDTH, 4), np.float32)
    color[:40, :, 0] = color[40:, :, 1] = 0.6
    color[..., 3] = alpha
    depth = np.linspace(2.0, 6.0, WIDTH, dtype=np.float32) * np.ones((HEIGHT, 1), np.float32)
    color[:, :24], depth[:, :24] = 0.0, np.inf
    return Shown(color, depth, CAMERA)


def panels(shown):
    picture = np.asarray(three_panels(shown, "caption"))
    rows = slice(GAP + LINE, GAP + LINE + HEIGHT)
    starts = [GAP + i * (WIDTH + GAP) for i in range(3)]
    return [picture[rows, start : start + WIDTH].astype(int) for start in starts]


def test_the_colour_panel_holds_each_pixel_rounded():
    color, _, _ = panels(image())
    assert color[10, 60].tolist() == [153, 0, 0]
    assert color[70, 60].tolist() == [0, 153, 0]


def test_what_is_half_transparent_lets_the_squares_through():
    color, _, _ = panels(image(alpha=0.5))
    empty = color[10, :24, 0]
    assert set(empty) == {219, 240}
    assert set(color[10, 60:80, 0]) == {round(0.5 * 153 + 0.5 * 219), round(0.5 * 153 + 0.5 * 240)}


def test_nearer_is_brighter_and_nothing_is_grey():
    _, depth, _ = panels(image())
    brightness = depth[40].sum(axis=-1)
    assert brightness[30] > brightness[60] > brightness[115]
    empty = depth[:, :24]
    assert (np.ptp(empty, axis=-1) == 0).all()
    assert (np.ptp(depth[:, 24:], axis=-1) > 40).all(), "no depth looks like nothing"


@pytest.mark.parametrize("depth", [np.inf, 3.0])
def test_an_image_of_nothing_or_of_one_depth_has_a_picture_too(depth):
    shown = image()._replace(depth=np.full((HEIGHT, WIDTH), depth, np.float32))
    assert three_panels(shown, "").size[0] == 3 * WIDTH + 4 * GAP
