"""Lenses, poses and times: every image is what its own frame says, to the pixel."""

from __future__ import annotations

import math

import pytest
from splatbus_client import Intrinsics
from splatbus_viewer.poses import look_at

from tests.pair.known_scene import showing, wrong_pixels
from tests.pair.rig import MOST_SECONDS
from tests.waiting import eventually

LENSES = [
    Intrinsics(800.0, 800.0, 960.0, 540.0, 1920, 1080, 0.01, 100.0),
    Intrinsics(90.0, 120.0, 40.0, 30.0, 96, 54, 0.5, 6.0),
    Intrinsics(300.0, 310.0, 100.0, 300.0, 854, 480, 0.01, 4.5),
]


@pytest.mark.parametrize("degrees", [0.0, 45.0])
def test_every_frame_is_what_it_says_itself(degrees: float) -> None:
    wrong = seen = 0
    with showing(degrees=degrees) as (_, tap), tap.session() as session:
        assert eventually(lambda: session.status.message.version), "welcome"
        for number in range(60):
            angle = number / 10
            eye = (2 * math.sin(angle), -0.5 - angle / 10, 1 - math.cos(angle))
            lens = LENSES[number % 3] if number % 5 else None
            if degrees:
                session.send_time(0.3 * number)
            session.send_camera(look_at(eye, (0.0, 0.0, 4.0)), intrinsics=lens)
            with session.next_frame(MOST_SECONDS) as frame:
                a, b = wrong_pixels(frame, degrees)
            wrong, seen = wrong + a, seen + b
    assert seen > 1000
    assert wrong == 0
    tap.assert_conforming()
