"""A scene at a second of it: files one after the other, and Gaussians that live in time."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_splats.beginning import before, lens_for, reaching
from splatbus_splats.files import ply
from splatbus_splats.files.read import read
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.loading import cameras_near, ids, loaded, scene_of, source
from splatbus_splats.made import made
from splatbus_splats.scene import Clip, Frames, Scene
from splatbus_splats.serving import shown_at
from splatbus_wire.parts import MAX_NAME_CHARS

from tests.splats.shots import some
from tests.splats.times import ALL, drawn, written


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
    table = drawn(200)
    found = read(written(tmp_path / "a.ply", table))
    assert found.motion is not None
    seen = Clip(found.gaussians, found.motion, 2.0).at(2.0 * time)
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
        shown = 0.5 + 0.28209479177387814 * seen.coefficients[i, 0]
        np.testing.assert_allclose(shown, color, atol=1e-6)


def test_with_harmonics_the_constant_one_is_none_of_a_colour(tmp_path: Path) -> None:
    table = drawn(3, names=(*ALL, *(f"f_rest_{i}" for i in range(9))))
    found = read(written(tmp_path / "a.ply", table)).gaussians
    np.testing.assert_array_equal(found.coefficients[:, 0, 1], table["f_dc_1"])


@pytest.mark.parametrize("powers", range(4))
@pytest.mark.parametrize("turns", [False, True])
def test_what_a_file_lacks_does_not_move(tmp_path: Path, powers: int, turns: bool) -> None:
    gone = {f"motion_{i}" for i in range(3 * powers, 9)}
    gone |= set() if turns else {f"omega_{i}" for i in range(4)}
    table = drawn(50)
    for name in gone:
        table[name] = 0
    less = written(tmp_path / "less.ply", table[[name for name in ALL if name not in gone]].copy())
    results = []
    for path in (less, written(tmp_path / "all.ply", table)):
        gaussians, _, motion = read(path)
        assert motion is not None
        results.append(Clip(gaussians, motion, 1.0).at(0.8))
    np.testing.assert_array_equal(results[0].means, results[1].means)
    np.testing.assert_array_equal(results[0].rotations, results[1].rotations)


@pytest.mark.parametrize(
    ("gone", "more", "message"),
    [
        ({"trbf_scale"}, (), "no property trbf_scale"),
        ({"motion_8"}, (), "no property motion_8"),
        ({"motion_1"}, (), "no property motion_1"),
        ({"omega_2"}, (), "no property omega_2"),
        (set(), ("motion_9", "motion_10", "motion_11"), "12 properties motion_*, where there are"),
        (set(), ("f_dc_3", "f_dc_4", "f_dc_5"), "a network that is not in the file"),
    ],
)
def test_what_is_missing_of_a_life_in_time_is_named(
    tmp_path: Path, gone: set[str], more: tuple[str, ...], message: str
) -> None:
    names = tuple(name for name in (*ALL, *more) if name not in gone)
    path = written(tmp_path / "a.ply", np.ones(2, [(name, "<f4") for name in names]))
    with pytest.raises(ValueError, match=f"^{path}: ") as caught:
        read(path)
    assert message in str(caught.value)


def test_what_does_not_live_in_time_as_it_should_is_left_out(tmp_path: Path) -> None:
    table = drawn(6)
    table["trbf_center"][0] = math.nan
    table["trbf_scale"][1] = -math.inf
    table["motion_4"][2] = math.inf
    table["omega_3"][3] = math.nan
    table["trbf_scale"][4] = math.inf
    gaussians, left_out, motion = read(written(tmp_path / "a.ply", table))
    assert left_out == {"time not a number": 2, "motion not finite": 1, "turning not finite": 1}
    np.testing.assert_array_equal(gaussians.means[:, 0], table["x"][4:])
    assert motion is not None
    stays = Clip(gaussians, motion, 1.0).at(0.0).opacities[0]  # the one whose life is infinite
    assert stays == gaussians.opacities[0]


@given(seed=st.integers(0, 10**6))
def test_no_gaussian_leaves_the_bounds_while_it_is_seen(seed: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        gaussians, _, motion = read(written(Path(folder) / "a.ply", drawn(7, seed)))
    assert motion is not None
    clip = Clip(gaussians, motion, 1.0)
    moments = [clip.at(time).means for time in np.linspace(0, 1, 201)]
    means = np.concatenate(moments)
    assert clip.bounds is not None
    low, high = np.array(clip.bounds.min), np.array(clip.bounds.max)
    assert (means >= low - 1e-5).all()
    assert (means <= high + 1e-5).all()
    tight = 0.05 * np.abs(high - low) + 0.02  # steps of time miss the extremes, by less than this
    assert (means.min(axis=0) <= low + tight).all()
    assert (means.max(axis=0) >= high - tight).all()


FILES = tuple(some([(i, 0, 1), (0, i, 2)][: 1 + i % 2]) for i in range(4))


def test_the_newest_file_is_shown_and_it_is_the_same_one() -> None:
    scene = Scene({"default": Frames(FILES, 10.0), "still": Frames(FILES[:1])})
    assert scene.time_range == (0, 0.3)
    assert scene.loop == 0.4
    shown = {-1: 0, 0: 0, 0.05: 0, 0.1: 1, 0.199: 1, 0.2: 2, 0.3: 3, 9: 3}
    for time, place in shown.items():
        assert scene.at(time)["default"] is FILES[place]
        assert scene.at(time)["still"] is FILES[0]
    assert scene.at(None)["default"] is FILES[0]
    assert scene.counts == {"default": 2, "still": 1}
    assert scene.bounds == ((0, 0, 1), (3, 3, 2))


@given(st.integers(1, 2000), st.floats(1e-3, 1e5))
def test_the_time_of_each_file_shows_it(count: int, rate: float) -> None:
    frames = Frames(FILES[:1] * count, rate)
    assert [frames.moment(i / rate) for i in range(count)] == list(range(count))


def test_a_time_that_is_rounded_shows_the_same_file() -> None:
    frames = Frames(FILES[:1] * 600, 30.0)
    summed = np.cumsum([0.0, *[1.0 / 30.0] * 599])
    for times in (summed, np.float32(summed), np.arange(600) * (1.0 / 30.0)):
        assert [frames.moment(float(time)) for time in times] == list(range(600))
    assert frames.moment(1.0 / 30.0 - 1e-4) == 0


def test_how_long_all_looks_the_same(tmp_path: Path) -> None:
    gaussians, _, motion = read(written(tmp_path / "a.ply", drawn(50)))
    assert motion is not None
    walk, still = Frames(FILES, 10.0), Frames(FILES[:1])
    scene = Scene({"default": walk, "still": still})
    for playing, seconds in ((0.0, 0.1), (0.05, 0.05), (0.35, 0.05), (0.41, 0.09)):
        assert scene.lasts(playing) == pytest.approx(seconds)
    assert Scene({"default": still}).lasts(3.0) == math.inf
    clip = Clip(gaussians, motion, 0.2)
    both = Scene({"default": walk, "clip": clip})
    assert both.lasts(0.15) == 0.0
    assert both.lasts(0.25) == pytest.approx(0.05)  # the clip has ended, and waits for the walk


def test_what_does_not_change_has_no_time() -> None:
    scene = Scene({"default": Frames(FILES[:1]), "other": Frames(FILES[1:2])})
    assert scene.time_range is None
    assert shown_at(scene, None, 5.0) is None
    assert scene.moment(3.0) == scene.moment(None)


def test_a_clip_at_the_same_moment_is_the_same_object(tmp_path: Path) -> None:
    gaussians, _, motion = read(written(tmp_path / "a.ply", drawn(50)))
    assert motion is not None
    still = Frames(FILES[:1])
    scene = Scene({"default": Clip(gaussians, motion, 5.0), "still": still})
    first = scene.at(2.0)
    assert scene.at(2.0)["default"] is first["default"]
    assert scene.at(2.5)["default"] is not first["default"]
    assert scene.at(2.5)["still"] is first["still"]
    assert scene.moment(2.0) != scene.moment(2.5)
    assert scene.moment(5.0) == scene.moment(6.0)
    assert scene.time_range == (0, 5)


def test_what_plays_shows_its_last_file_as_long_as_the_others() -> None:
    scene = Scene({"default": Frames(FILES, 10.0)})
    shown = [shown_at(scene, None, seconds) for seconds in (0.0, 0.15, 0.3, 0.39, 0.41)]
    assert shown == pytest.approx([0.0, 0.15, 0.3, 0.3, 0.01])
    assert shown_at(scene, 0.2, 0.0) == 0.2


def test_the_first_is_the_default_and_the_others_are_called_as_their_files() -> None:
    assert ids(["a", "b", "b", "default", "", "b-2"]) == [
        "default", "b", "b-2", "default-2", "object", "b-2-2",
    ]  # fmt: skip
    assert ids(["a"]) == ["default"]
    long = "y" * MAX_NAME_CHARS
    assert ids(["x", long, long]) == ["default", long, f"{long[:-4]}-2"]


@given(st.lists(st.text(max_size=80), min_size=1, max_size=30))
def test_ids_differ_and_fit(stems: list[str]) -> None:
    given_ids = ids(stems)
    assert len(set(given_ids)) == len(stems)
    assert all(1 <= len(name) <= MAX_NAME_CHARS for name in given_ids)
    assert ids(["x", "\udcff"]) == ["default", "?"]


def model(folder: Path, *iterations: str) -> Path:
    for name in iterations:
        (folder / "point_cloud" / name).mkdir(parents=True)
        ply.write(folder / "point_cloud" / name / "point_cloud.ply", made(20, 0))
    return folder


def test_the_last_iteration_of_a_model_is_served(tmp_path: Path) -> None:
    folder = model(tmp_path / "garden", "iteration_7000", "iteration_30000", "iteration_old")
    (folder / "point_cloud" / "iteration_99999").mkdir()
    (folder / "cameras.json").write_text("[]")
    found = source(folder)
    assert found.label == found.stem == "garden"
    assert found.files == [folder / "point_cloud" / "iteration_30000" / "point_cloud.ply"]
    assert cameras_near(found.files[0]) == folder / "cameras.json"


@pytest.mark.parametrize(("depth", "is_found"), [(0, True), (3, True), (4, False)])
def test_cameras_are_looked_for_in_three_folders_above(
    tmp_path: Path, depth: int, is_found: bool
) -> None:
    (tmp_path / "cameras.json").write_text("[]")
    file = tmp_path.joinpath(*"abcd"[:depth]) / "a.ply"
    assert cameras_near(file) == (tmp_path / "cameras.json" if is_found else None)


def test_a_folder_that_is_neither_is_told_what_one_is(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no files .* numbered files .*iteration_N"):
        source(tmp_path)


def test_all_files_are_told_as_they_are_read(tmp_path: Path) -> None:
    folder = tmp_path / "walk"
    folder.mkdir()
    for i in range(3):
        ply.write(folder / f"{i}.ply", made(10 + i, i))
    ply.write(tmp_path / "other.ply", made(5, 0))
    sources = [source(tmp_path / "other.ply"), source(folder)]
    told: list[tuple[str, int, int, float]] = []
    objects = loaded(sources, 2.0, 1.0, lambda path, *rest: told.append((path.name, *rest)))
    assert told == [
        ("other.ply", 1, 4, 0.25), ("0.ply", 2, 4, 0.5), ("1.ply", 3, 4, 0.75), ("2.ply", 4, 4, 1),
    ]  # fmt: skip
    scene = scene_of(objects)
    assert scene.counts == {"default": 5, "walk": 12}
    assert scene.time_range == (0, 1)
    assert scene.parts["walk"].degree == 2


def test_what_lives_in_time_is_no_file_of_a_sequence(tmp_path: Path) -> None:
    for i in range(2):
        written(tmp_path / f"{i}.ply", drawn(3))
    with pytest.raises(ValueError, match=r"0\.ply: .* cannot be one file of a sequence"):
        loaded([source(tmp_path)], 1.0, 1.0)


def box(gaussians: Gaussians) -> np.ndarray:
    low, high = np.percentile(gaussians.means, (10, 90), axis=0)
    return np.array([[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])


@given(
    st.floats(-1e3, 1e3), st.floats(0.5, 1e2), st.floats(0.5, 1e2), st.floats(1e-2, 1e2),
    st.sampled_from([(640, 480), (100, 900), (900, 100)]),
)  # fmt: skip
def test_without_cameras_the_middle_is_in_view(
    at: float, x: float, y: float, z: float, size: tuple[int, int]
) -> None:
    random = np.random.default_rng(1)
    means = at + random.normal(0, 1, (400, 3)) * (x, y, z)
    means[:10] *= 50  # floaters
    gaussians = some(means, 0.01)
    scene = Scene({"default": Frames((gaussians,))})
    pose, lens = before(scene, lens_for(*size, scene.parts.values()), *size)
    assert pose.rotation == (0, 0, 0, 1)
    seen = box(gaussians) - pose.position
    assert (seen[:, 2] > 0.2).all()
    places = seen[:, :2] / seen[:, 2:] * (lens.fx, lens.fy) + (lens.cx, lens.cy)
    assert (places > 0).all()
    assert (places < size).all()
    assert (places.max(axis=0) - places.min(axis=0) > 0.5 * np.array(size)).any()
    assert (gaussians.means[:, 2] - pose.position[2] < lens.far).all()


def test_a_narrow_image_of_a_wide_scene_sees_as_far_as_it_stands_away() -> None:
    means = np.linspace((0, 0, 0), (1000, 0, 0), 50)
    scene = Scene({"default": Frames((some(means),))})
    given_lens = lens_for(10, 1000, scene.parts.values())
    pose, lens = before(scene, given_lens, 10, 1000)
    assert given_lens.far < -pose.position[2] < lens.far


def test_a_camera_that_stands_far_away_sees_the_scene() -> None:
    box_of = some([(0, 0, 0), (1, 1, 1)]).bounds
    lens = lens_for(64, 48, [])
    assert reaching(lens, (0.0, 0.0, -1000.0), box_of).far > 1001.0
    assert reaching(lens, (0.0, 0.0, 0.0), box_of) == lens
    assert reaching(lens, (0.0, 0.0, -1000.0), None) == lens


def test_a_view_of_nothing_begins_at_the_origin() -> None:
    scene = Scene({"default": Frames((some([(1, 2, 3)])[:0],))})
    lens = lens_for(64, 48, scene.parts.values())
    assert before(scene, lens, 64, 48) == (((0, 0, 0), (0, 0, 0, 1)), lens)


def test_a_view_of_one_gaussian_is_before_it() -> None:
    scene = Scene({"default": Frames((some([(1, 2, 3)], 0.0),))})
    pose, _ = before(scene, lens_for(64, 48, []), 64, 48)
    assert pose.position == pytest.approx((1, 2, 2.6))
