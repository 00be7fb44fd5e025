from __future__ import annotations

import math

import pytest
from splatbus_server.view import Intrinsics, field_of_view, lens_of, without_size
from splatbus_wire.lens import Lens, as_high, fits, scaled

LENS = Lens(1500.0, 1400.0, 900.0, 500.0, 1920, 1080, 0.01, 100.0)


def test_a_lens_scales_to_the_image() -> None:
    """[CAM-5]"""
    assert scaled(LENS, 960, 540) == Lens(750.0, 700.0, 450.0, 250.0, 960, 540, 0.01, 100.0)
    assert scaled(LENS, 1920, 1080) == LENS


def test_a_lens_of_another_shape_does_not_fit() -> None:
    """[CAM-6]"""
    assert fits(LENS, 854, 480)
    assert not fits(LENS, 640, 480)


def test_another_shape_shows_more_or_less_at_the_sides() -> None:
    wide = as_high(LENS, 2160, 540)
    assert math.atan2(540 - wide.cy, wide.fy) == math.atan2(1080 - LENS.cy, LENS.fy)
    assert wide.fx / wide.fy == pytest.approx(LENS.fx / LENS.fy)
    assert (wide.cx - 1080) / 540 == pytest.approx((LENS.cx - 960) / 1080)
    assert as_high(LENS, 960, 540) == pytest.approx(scaled(LENS, 960, 540))
    assert as_high(LENS, 1920, 1080) == LENS


def test_the_default_field_of_view_keeps_its_angle() -> None:
    default = lens_of(field_of_view(320, 240), 320, 240)
    assert without_size(as_high(default, 1000, 480)) == pytest.approx(field_of_view(1000, 480))


def test_the_size_comes_and_goes() -> None:
    plain = Intrinsics(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert without_size(lens_of(plain, 7, 8)) == plain
    assert (lens_of(plain, 7, 8).width, lens_of(plain, 7, 8).height) == (7, 8)
