"""A scene at a second of it: files one after the other, and Gaussians that live in time."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_server.view import field_of_view
from splatbus_splats.beginning import before, reaching
from splatbus_splats.drawing.harmonics import CONSTANT
from splatbus_splats.files import container, ply
from splatbus_splats.files.read import read
from splatbus_splats.gaussians import along_curve, curve
from splatbus_splats.loading import cameras_near, ids, loaded, scene_of, source
from splatbus_splats.scene import Clip, Frames, Scene
from splatbus_splats.serving import shown_at
from splatbus_wire.messages import Box
from splatbus_wire.parts import MAX_NAME_CHARS
from splatbus_wire.poses import IDENTITY
from splatbus_wire.rotations import rotation_matrix

from tests.splats.shots import cloud, some
from tests.splats.times import ALL, clip, drawn


def scalar(row: np.void, time: float) -> tuple[list[float], list[float], float]:
    """Mean, quaternion w, x, y, z and opacity of a vertex, by the formulas of the paper."""
    dt = time - float(row["trbf_center"])
    opacity = 1 / (1 + math.exp(-row["opacity"]))
    opacity *= math.exp(-((dt / math.exp(row["trbf_scale"])) ** 2))
    mean = [
        row[axis]
        + sum(float(row[f"motion_{3 * power + i}"]) * dt ** (power + 1) for power in range(3))
        for i, axis in enumerate("xyz")
    ]
    turn = [float(row[f"rot_{i}"]) + float(row[f"omega_{i}"]) * dt for i in range(4)]
    norm = math.hypot(*turn)
    return mean, [each / norm for each in turn], opacity


@pytest.mark.parametrize("time", [0.0, 0.3, 1.0])
def test_gaussians_in_time_are_where_the_paper_has_them(tmp_path: Path, time: float) -> None:
    table, seen = drawn(200), clip(tmp_path, 200, 2.0).at(2.0 * time)
    expected = [scalar(row, time) for row in table]
    places = [i for i, (_, _, opacity) in enumerate(expected) if opacity >= 1 / 255]
    assert 50 < len(places) < 200
    assert len(seen) == len(places)
    for i, place in enumerate(places):
        mean, (w, x, y, z), opacity = expected[place]
        np.testing.assert_allclose(seen.means[i], mean, atol=2e-6)
        np.testing.assert_allclose(seen.rotations[i], (x, y, z, w), atol=2e-6)
        np.testing.assert_allclose(seen.opacities[i], opacity, rtol=2e-5)
        color = [table[f"f_dc_{channel}"][place] for channel in range(3)]
        np.testing.assert_allclose(0.5 + CONSTANT * seen.coefficients[i, 0], color, atol=1e-6)


def test_with_harmonics_the_constant_one_is_none_of_a_colour(tmp_path: Path) -> None:
    names = (*ALL, *(f"f_rest_{i}" for i in range(9)))
    container.write(tmp_path / "a.ply", np.ones(3, [(name, "<f4") for name in names]))
    assert (read(tmp_path / "a.ply").gaussians.coefficients[:, 0] == 1.0).all()


@pytest.mark.parametrize("powers", range(4))
@pytest.mark.parametrize("turns", [False, True])
def test_what_a_file_lacks_does_not_move(tmp_path: Path, powers: int, turns: bool) -> None:
    gone = {f"motion_{i}" for i in range(3 * powers, 9)}
    gone |= set() if turns else {f"omega_{i}" for i in range(4)}
    table = drawn(50)
    for name in gone:
        table[name] = 0
    results = []
    for names in (ALL, [name for name in ALL if name not in gone]):
        container.write(tmp_path / "a.ply", table[[*names]])
        gaussians, _, motion, *_ = read(tmp_path / "a.ply")
        assert motion is not None
        results.append(Clip(gaussians, motion, 1.0).at(0.8))
    np.testing.assert_array_equal(results[0].means, results[1].means)
    np.testing.assert_array_equal(results[0].rotations, results[1].rotations)


def test_what_does_not_live_in_time_as_it_should_is_left_out(tmp_path: Path) -> None:
    table = drawn(6)
    table["trbf_center"][0] = math.nan
    table["trbf_scale"][1] = -math.inf
    table["motion_4"][2] = math.inf
    table["omega_3"][3] = math.nan
    table["trbf_scale"][4] = math.inf
    container.write(tmp_path / "a.ply", table)
    gaussians, left_out, motion, *_ = read(tmp_path / "a.ply")
    assert left_out == {"time not a number": 2, "motion not finite": 1, "turning not finite": 1}
    np.testing.assert_array_equal(gaussians.means[:, 0], table["x"][4:])
    assert motion is not None
    stays = Clip(gaussians, motion, 1.0).at(0.0).opacities[0]  # the one whose life is infinite
    assert stays == gaussians.opacities[0]


@given(seed=st.integers(0, 10**6))
def test_no_gaussian_leaves_the_bounds_while_it_is_seen(seed: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        dance = clip(Path(folder), 7, 1.0, seed)
    means = np.concatenate([dance.at(time).means for time in np.linspace(0, 1, 201)])
    assert dance.bounds is not None
    low, high = np.array(dance.bounds.min), np.array(dance.bounds.max)
    assert (means >= low - 1e-5).all()
    assert (means <= high + 1e-5).all()
    tight = 0.05 * np.abs(high - low) + 0.02  # steps of time miss the extremes, by less than this
    assert (means.min(axis=0) <= low + tight).all()
    assert (means.max(axis=0) >= high - tight).all()


FILES = tuple(some([(i, 0, 1), (0, i, 2)][: 1 + i % 2]) for i in range(4))
WALK, STILL = Frames(FILES, 10.0), Frames(FILES[:1])


def test_the_newest_file_is_shown_and_it_is_the_same_one() -> None:
    scene = Scene({"default": WALK, "still": STILL})
    assert scene.time_range == (0, 0.3)
    assert scene.loop == 0.4
    assert scene.bounds == ((0, 0, 1), (3, 3, 2))
    for time, place in {-1: 0, 0: 0, 0.05: 0, 0.1: 1, 0.199: 1, 0.2: 2, 0.3: 3, 9: 3}.items():
        assert scene.at(time)["default"] is FILES[place]
        assert scene.at(time)["still"] is FILES[0]
    assert scene.at(None)["default"] is FILES[0]


@given(st.integers(1, 2000), st.floats(1e-3, 1e5))
def test_the_time_of_each_file_shows_it_however_it_is_rounded(count: int, rate: float) -> None:
    frames = Frames(FILES[:1] * count, rate)
    times = np.arange(count) / rate
    for each in (times, np.float32(times), np.cumsum([0.0, *[1 / rate] * (count - 1)])):
        assert [frames.moment(float(time)) for time in each] == list(range(count))
    assert frames.moment(0.99 / rate) == 0


def test_how_long_all_looks_the_same(tmp_path: Path) -> None:
    scene = Scene({"default": WALK, "still": STILL})
    for playing, seconds in ((0.0, 0.1), (0.05, 0.05), (0.35, 0.05), (0.41, 0.09)):
        assert scene.lasts(playing) == pytest.approx(seconds)
    both = Scene({"default": WALK, "clip": clip(tmp_path, 50, 0.2)})
    assert both.lasts(0.15) == 0.0
    assert both.lasts(0.25) == pytest.approx(0.05)  # the clip has ended, and waits for the walk
    rests = Scene({"default": STILL})
    assert rests.lasts(3.0) == math.inf
    assert rests.time_range is None
    assert shown_at(rests, None, 5.0) is None
    assert rests.moment(3.0) == rests.moment(None)


def test_a_clip_at_the_same_moment_is_the_same_object(tmp_path: Path) -> None:
    scene = Scene({"default": clip(tmp_path, 50, 5.0)})
    assert scene.time_range == (0, scene.loop) == (0, 5)
    first = scene.at(2.0)["default"]
    assert scene.at(2.0)["default"] is first
    assert scene.at(2.5)["default"] is not first
    assert scene.moment(2.0) != scene.moment(2.5)
    assert scene.moment(5.0) == scene.moment(6.0)


def test_what_plays_shows_its_last_file_as_long_as_the_others() -> None:
    scene = Scene({"default": WALK})
    shown = [shown_at(scene, None, seconds) for seconds in (0.0, 0.15, 0.3, 0.39, 0.41)]
    assert shown == pytest.approx([0.0, 0.15, 0.3, 0.3, 0.01])
    assert shown_at(scene, 0.2, 0.0) == 0.2


def test_the_first_is_the_default_and_the_others_are_called_as_their_files() -> None:
    assert ids(["a", "b", "b", "default", "", "b-2", "\udcff"]) == [
        "default", "b", "b-2", "default-2", "object", "b-2-2", "?",
    ]  # fmt: skip
    long = "y" * MAX_NAME_CHARS
    assert ids(["x", long, long]) == ["default", long, f"{long[:-4]}-2"]


def test_the_last_iteration_of_a_model_is_served_with_its_cameras(tmp_path: Path) -> None:
    folder = tmp_path / "garden"
    for name in ("iteration_7000", "iteration_30000", "iteration_old"):
        (folder / "point_cloud" / name).mkdir(parents=True)
        ply.write(folder / "point_cloud" / name / "point_cloud.ply", cloud(20, 0))
    (folder / "point_cloud" / "iteration_99999").mkdir()
    (folder / "cameras.json").write_text("[]")
    found = source(folder)
    assert found.label == found.stem == "garden"
    assert found.files == [folder / "point_cloud" / "iteration_30000" / "point_cloud.ply"]
    assert cameras_near(found.files[0]) == folder / "cameras.json"
    deep = folder / "point_cloud" / "b" / "c"
    assert cameras_near(deep / "a.ply") == folder / "cameras.json"
    assert cameras_near(deep / "d" / "a.ply") is None
    with pytest.raises(ValueError, match=r"no file of .* numbered files .*iteration_N"):
        source(tmp_path)


def test_all_files_are_told_as_they_are_read(tmp_path: Path) -> None:
    folder = tmp_path / "walk"
    folder.mkdir()
    for i in range(3):
        ply.write(folder / f"{i}.ply", cloud(10 + i, i))
    ply.write(tmp_path / "other.ply", cloud(5, 0))
    sources = [source(tmp_path / "other.ply"), source(folder)]
    told: list[tuple[str, int, int, float]] = []
    scene = scene_of(loaded(sources, 2.0, 1.0, lambda path, *rest: told.append((path.name, *rest))))
    assert told == [
        ("other.ply", 1, 4, 0.25), ("0.ply", 2, 4, 0.5), ("1.ply", 3, 4, 0.75), ("2.ply", 4, 4, 1),
    ]  # fmt: skip
    assert {name: each.most for name, each in scene.parts.items()} == {"default": 5, "walk": 12}
    assert scene.time_range == (0, 1)
    assert scene.parts["walk"].degree == 2
    container.write(folder / "1.ply", drawn(3))
    with pytest.raises(ValueError, match=r"1\.ply: .* cannot be one file of a sequence"):
        loaded(sources, 1.0, 1.0)


def test_neighbours_follow_each_other_and_what_belongs_together_stays_together() -> None:
    scene = cloud(20_000, 1)
    order, ordered = curve(scene.means), along_curve(scene)
    for name in ("means", "rotations", "scales", "opacities", "coefficients"):
        np.testing.assert_array_equal(getattr(ordered, name), getattr(scene, name)[order])
    assert len(set(order.tolist())) == len(scene)
    steps = np.linalg.norm(np.diff(ordered.means, axis=0), axis=1)
    formerly = np.linalg.norm(np.diff(scene.means, axis=0), axis=1)
    assert np.median(steps) < 0.05 * np.median(formerly)


def test_cells_follow_each_other_by_x_then_y_then_z() -> None:
    corners = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float32)
    np.testing.assert_array_equal(curve(np.ascontiguousarray(corners[::-1]))[::-1], np.arange(8))
    far = np.zeros((100, 3), np.float32)  # which do no harm; others stay as they came
    far[50], far[51] = 3e38, -3e38
    assert curve(far).tolist() == [51, *range(50), *range(52, 100), 50]
    assert not len(curve(far[:0]))


@given(
    st.floats(-1e3, 1e3), st.tuples(*[st.floats(0.5, 1e2)] * 3),
    st.sampled_from([(640, 480), (100, 900), (900, 100)]),
)  # fmt: skip
def test_without_cameras_the_middle_is_in_view(
    at: float, extents: tuple[float, float, float], size: tuple[int, int]
) -> None:
    means = at + np.random.default_rng(1).normal(0, 1, (400, 3)) * extents
    means[:10] *= 50  # floaters
    gaussians = some(means, 0.01)
    scene = Scene({"default": Frames((gaussians,))})
    pose, lens = before(scene, *size)
    assert pose.rotation == IDENTITY.rotation
    corners = np.percentile(gaussians.means, (10, 90), axis=0)
    box = np.stack(np.meshgrid(*corners.T), axis=-1).reshape(-1, 3)
    seen = box - pose.position
    assert (seen[:, 2] > 0.2).all()
    places = seen[:, :2] / seen[:, 2:] * (lens.fx, lens.fy) + (lens.cx, lens.cy)
    assert (places > 0).all()
    assert (places < size).all()
    assert (places.max(axis=0) - places.min(axis=0) > 0.5 * np.array(size)).any()
    assert (gaussians.means[:, 2] - pose.position[2] < lens.far).all()


def test_a_view_of_one_gaussian_is_before_it_and_of_none_at_the_origin() -> None:
    lens, one = field_of_view(64, 48), some([(1, 2, 3)], 0.0)
    for each, place in ((one, (1, 2, 2.6)), (one[:0], (0, 0, 0))):
        pose, found = before(Scene({"default": Frames((each,))}), 64, 48)
        assert pose.position == pytest.approx(place)
        assert found == lens


@pytest.mark.parametrize(
    ("up", "place", "ahead"),
    [
        ("z", (1, 1.6, 3), (0, 1, 0)),
        ("y", (1, 2, 3.4), (0, 0, -1)),
        ("-x", (1, 2, 3.4), (0, 0, -1)),
    ],
)
def test_a_view_has_upwards_what_is_asked_for(
    up: str, place: tuple[float, ...], ahead: tuple[float, ...]
) -> None:
    one = some([(1, 2, 3)], 0.0)
    pose, _ = before(Scene({"default": Frames((one,))}), 64, 48, up)
    assert pose.position == pytest.approx(place)
    right, down, forward = np.reshape(rotation_matrix(pose.rotation), (3, 3)).T
    assert forward == pytest.approx(ahead)
    assert down["xyz".index(up[-1])] == pytest.approx(1 if up[0] == "-" else -1)
    assert np.cross(right, down) == pytest.approx(forward)


def test_a_lens_sees_as_far_as_the_scene_goes() -> None:
    box, lens = Box((0.0, 0.0, 0.0), (300.0, 0.0, 400.0)), field_of_view(64, 48)
    assert reaching(lens, (300.0, 0.0, 400.0), box) == lens._replace(far=2000.0)
    assert reaching(lens, (0.0, 0.0, -1000.0), box).far == pytest.approx(2 * math.hypot(300, 1400))
    assert reaching(lens, (0.0, 0.0, 0.0), Box((0, 0, 0), (1, 1, 1))) == lens
    assert reaching(lens, (0.0, 0.0, -1000.0), None) == lens
