"""Which reading two images fit: of images rendered from the closed form, by mistaken cameras."""

import math

import numpy as np
import pytest
from splatbus_conformance.images.known_scene import SceneState, render
from splatbus_conformance.images.pinhole import (
    Camera,
    ObjectPlacement,
    Rigid,
    rigid,
    rotation_matrix,
)
from splatbus_conformance.images.reprojection import (
    APART,
    AS_SPECIFIED,
    EVERY,
    FITS,
    POSES,
    SCENES,
    DepthView,
    Misreading,
    ViewPair,
    agreement,
    explain,
)

HALF = math.radians(6.0)
MOVES = (
    ((0.3, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
    ((0.0, 0.0, -0.3), (math.sin(HALF), 0.0, 0.0, math.cos(HALF))),
    ((-0.3, -0.3, -0.2), (0.0, math.sin(HALF), 0.0, math.cos(HALF))),
    ((0.2, -0.4, -0.3), (0.05, 0.02, math.sin(HALF), math.cos(HALF))),
)


def camera(pose: Rigid, width: int = 64, height: int = 48) -> Camera:
    focal = height / (2.0 * math.tan(math.radians(30.0)))
    return Camera(pose, focal, focal, width / 2, height / 2, width, height, 0.01, 100.0)


def view(position, rotation, seen: Rigid | None = None, scene: Rigid = Rigid()) -> DepthView:  # noqa: B008
    """An image that names one camera and was rendered by another."""
    named = camera(rigid(position, rotation))
    depth = render(
        named._replace(pose=seen or named.pose), SceneState(ObjectPlacement(scene))
    ).depth
    return DepthView(named, position, rotation, depth)


def pairs(seen=rigid, change=lambda it: it.depth) -> list[ViewPair]:
    start = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    views = [view(p, q, seen(p, q)) for p, q in (start, *MOVES)]
    views = [it._replace(depth=change(it)) for it in views]
    return [ViewPair(views[0], after) for after in views[1:]]


def best(found: list[ViewPair]) -> str:
    shares = explain(found, EVERY)
    assert shares[0] < FITS
    assert shares.max() - shares[0] > APART
    return EVERY[int(shares.argmax())].words


def test_images_that_are_right_fit_what_the_frames_say_and_nothing_else() -> None:
    shares = explain(pairs(), EVERY)
    assert shares[0] > 0.9
    assert shares[1:].max() < shares[0] - APART


def test_single_precision_and_a_little_noise_do_not_matter() -> None:
    rng = np.random.default_rng(0)
    noisy = pairs(change=lambda it: it.depth * (1 + rng.normal(scale=5e-3, size=it.depth.shape)))
    assert explain(noisy, [AS_SPECIFIED])[0] > 0.9


def test_a_pose_taken_for_world_to_camera_is_found() -> None:
    assert "world-to-camera" in best(pairs(lambda p, q: rigid(p, q).inverse()))


def test_a_scalar_read_first_is_found() -> None:
    def scalar_first(p, q):
        w, x, y, z = q
        return rigid(p, (x, y, z, w))

    assert "read as w, x, y, z" in best(pairs(scalar_first))


def test_the_inverse_rotation_is_found() -> None:
    def inverse(p, q):
        return Rigid(rotation_matrix(q).T, np.array(p))

    assert "JPL" in best(pairs(inverse))


def test_a_camera_that_looks_along_minus_z_is_found() -> None:
    turn = np.diag((1.0, -1.0, -1.0))
    assert "OpenGL" in best(pairs(lambda p, q: Rigid(rotation_matrix(q) @ turn, np.array(p))))


def test_rows_top_down_are_found() -> None:
    found = explain(pairs(change=lambda it: it.depth[::-1]), EVERY)
    words = [reading.words for reading, share in zip(EVERY, found, strict=True) if share > FITS]
    assert "rows stored top-down" in words
    assert len(words) == 2, "of an unknown scene, a mirrored world looks the same"


@pytest.mark.parametrize(
    ("words", "change"),
    [
        ("along the ray", lambda it: it.depth * np.linalg.norm(it.camera.rays(), axis=-1)),
        ("inverse depths", lambda it: 1.0 / it.depth),
        ("depths of which 100 make", lambda it: it.depth * 100.0),
        ("right to left", lambda it: it.depth[:, ::-1]),
    ],
)
def test_depths_that_are_something_else_are_found(words: str, change) -> None:
    def stored(it: DepthView):
        with np.errstate(divide="ignore"):
            depth = change(it)
        return np.where(np.isfinite(it.depth) | ("right" in words), depth, np.inf)

    assert words in best(pairs(change=stored))


def test_a_camera_that_never_moved_is_found() -> None:
    assert "the camera before" in best(pairs(lambda p, q: Rigid()))


def test_a_scene_that_moved_is_followed_and_one_that_did_not_is_found_out() -> None:
    moved = rigid((0.3, -0.2, 0.1), (0.02, 0.08, -0.03, 0.99))
    before = view((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    right = view((0.1, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), scene=moved)
    wrong = view((0.1, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    readings = (AS_SPECIFIED, *SCENES)
    assert agreement(ViewPair(before, right, moved), AS_SPECIFIED) > 0.9
    assert explain([ViewPair(before, right, moved)], readings)[1:].max() < FITS
    assert (
        "did not move"
        in readings[explain([ViewPair(before, wrong, moved)], readings).argmax()].words
    )


def test_images_in_which_nothing_is_seen_fit_nothing() -> None:
    nothing = view((0.0, -50.0, 0.0), (0.7, 0.0, 0.0, 0.7))
    assert not np.isfinite(nothing.depth).any()
    assert explain([ViewPair(nothing, nothing)], EVERY).max() == 0.0


def test_no_reading_is_another_one() -> None:
    """Poses in general position tell every two camera readings apart."""
    position, rotation = (0.3, -0.7, 0.2), (0.1, -0.4, 0.2, 0.8)
    seen = view(position, rotation)
    told: list[tuple[Misreading, Rigid]] = [(r, r.pose(seen)) for r in (AS_SPECIFIED, *POSES)]
    for i, (_, a) in enumerate(told):
        for _, b in told[i + 1 :]:
            assert not np.allclose(np.c_[a.rotation, a.position], np.c_[b.rotation, b.position])
