"""Where a survey puts the camera, and when two images are alike."""

import numpy as np
import pytest
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.pinhole import camera_of, rigid
from splatbus_conformance.trials.moves.survey import (
    MOVES,
    STEP,
    alike,
    likeness,
    moves,
)
from splatbus_conformance.wire.messages import frame


def photograph(depth: float) -> CapturedFrame:
    message = frame(1, 1, 0, 64, 48)
    message["camera"] |= {"position": [1.0, 2.0, 3.0], "rotation": [0.5, 0.5, 0.5, 0.5]}
    camera = camera_of(message)
    assert camera is not None
    color, depths = np.full((48, 64, 4), 0.5, np.float32), np.full((48, 64), depth, np.float32)
    return CapturedFrame(message, camera, color, depths, {})


def test_the_camera_moves_along_its_own_axes_by_what_it_sees() -> None:
    first = photograph(8.0)
    for (steps, _, _), pose in zip(MOVES, moves(first), strict=True):
        moved = first.camera.pose.sees(np.array(pose.position))
        assert moved == pytest.approx(STEP * 8.0 * np.array(steps))
    assert len({pose.position for pose in moves(first)} | {first.pose.position}) == 1 + len(MOVES)


def test_the_camera_turns_by_a_part_of_what_it_sees() -> None:
    first = photograph(8.0)
    turns = [rigid(*pose).rotation.T @ first.camera.pose.rotation for pose in moves(first)]
    angles = [np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))) for R in turns]
    assert angles[:3] == pytest.approx([0.0] * 3, abs=1e-6)
    assert min(angles[3:]) > 5.0
    assert max(angles) < 20.0


def test_images_are_alike_but_for_rounding() -> None:
    first = photograph(8.0)
    assert alike(first, photograph(8.0 * (1 + 1e-5)))
    assert likeness(first, photograph(8.1)) == 0.0
    half = first.color.copy()
    half[:24] = 0.6
    assert likeness(first, first._replace(color=half)) == 0.5
    assert likeness(first, first._replace(depth=np.zeros((1, 1), np.float32))) == 0.0
