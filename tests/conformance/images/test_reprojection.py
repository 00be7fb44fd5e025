"""Which reading two images fit: of images rendered from the closed form, by mistaken cameras.

What is stored or moved otherwise is shown by mutants, with the code of its reading.
"""

import numpy as np
import pytest
from splatbus_conformance.images.known_scene import SceneState, render
from splatbus_conformance.images.pinhole import Camera, ObjectPlacement, Rigid, rigid
from splatbus_conformance.images.reprojection import (
    AS_SPECIFIED,
    EVERY,
    FITS,
    MOMENTS,
    POSES,
    QUATERNIONS,
    SCENES,
    DepthView,
    Misreading,
    ViewPair,
    explain,
    tells,
)

POSES_SEEN = (
    ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
    ((0.3, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
    ((0.0, 0.0, -0.3), (0.105, 0.0, 0.0, 0.995)),
    ((-0.3, -0.3, -0.2), (0.0, 0.105, 0.0, 0.995)),
    ((0.2, -0.4, -0.3), (0.05, 0.02, 0.105, 0.993)),
)
NAMED = Camera(Rigid(), 41.6, 41.6, 32.0, 24.0, 64, 48, 0.01, 100.0)


def view(position, rotation, reading=AS_SPECIFIED, scene: Rigid = Rigid()) -> DepthView:  # noqa: B008
    """An image that names one camera and was rendered by the one that was read."""
    camera = NAMED._replace(pose=rigid(position, rotation))
    blank = DepthView(camera, position, rotation, np.empty((48, 64)))
    seen = camera._replace(pose=reading.pose(blank))
    return blank._replace(depth=render(seen, SceneState(ObjectPlacement(scene))).depth)


@pytest.mark.parametrize("reading", [AS_SPECIFIED, *QUATERNIONS, *POSES[:2], *MOMENTS[2:]])
def test_a_pose_is_told_from_every_other_reading(reading: Misreading) -> None:
    noise = np.random.default_rng(0)
    first, *others = (view(*pose, reading) for pose in POSES_SEEN)
    noisy = [it._replace(depth=it.depth * noise.normal(1.0, 3e-3, (48, 64))) for it in others]
    shares = explain([ViewPair(first, it) for it in noisy], EVERY)
    own = EVERY.index(reading)
    assert all(tells(shares[own], other) for other in np.delete(shares, own))


@pytest.mark.parametrize("reading", [AS_SPECIFIED, *SCENES])
def test_how_the_scene_moved_is_told(reading: Misreading) -> None:
    moved = rigid((0.3, -0.2, 0.1), (0.02, 0.08, -0.03, 0.99))
    before = view(*POSES_SEEN[0])
    after = view(*POSES_SEEN[1], scene=reading.scene(moved))
    shares = explain([ViewPair(before, after, moved)], [reading, AS_SPECIFIED, *SCENES])
    assert shares[0] > FITS
    assert sorted(shares)[-3] < FITS, "but for itself, which is listed twice"


def test_images_in_which_nothing_is_seen_fit_nothing() -> None:
    nothing = view((0.0, -50.0, 0.0), (0.7, 0.0, 0.0, 0.7))
    assert not np.isfinite(nothing.depth).any()
    assert explain([ViewPair(nothing, nothing)], EVERY).max() == 0.0
