"""The floor of the figures for Gaussians draws the same picture, and every skip is tried."""

from __future__ import annotations

import numpy as np
from splatbus_splats.drawing.skips import EXACT, NOTHING, Skip

from benchmarks.splats import drawn, scenes, skipping
from benchmarks.splats.brute import brute

SIZE = (50, 34)


def test_the_floor_is_the_picture_drawn_at_every_pixel() -> None:
    shot = scenes.front(500, SIZE)
    image = brute(shot.placed(), shot.views[0].intrinsics, *SIZE)
    np.testing.assert_allclose(image.color, drawn.image(shot, EXACT).color, atol=2e-6)
    assert drawn.error(image, drawn.truth(shot)) <= 1 / 255
    assert image.color[..., 3].mean() > 0.5


def test_an_error_is_seen() -> None:
    shot = scenes.front(500, SIZE)
    right, image = drawn.truth(shot), drawn.image(shot, NOTHING)
    image.color[right.rows[7], right.columns[7], 2] += 0.25
    assert abs(drawn.error(image, right) - 0.25) < 1 / 255


def test_every_skip_is_tried_alone_or_with_the_exact_ones() -> None:
    choices = dict(skipping.choices())
    tried = [choices[name] for name in choices if name not in ("none", "exact")]
    assert {each for skip in tried for each in skip} == set(Skip)
    assert choices["none"] == NOTHING
    assert len(set(choices.values())) == len(choices)
