"""The bounds that `reference_server/NUMERICS.md` states, in versions that take seconds."""

import mmap
import sys

import numpy as np
import pytest
from splatbus_server.exchange import BOTH
from splatbus_server.memory import Memory, _slots
from splatbus_wire.init_packet import host_ring
from splatbus_wire.semantics import Semantics

from benchmarks.stressing import big_images, depths, drift, far, pose_sets

U32 = 2.0**-24


@pytest.fixture(scope="module")
def at_a_million():
    return {row["way"]: row for row in far.measure([1e6], 300)}


def test_a_camera_a_million_units_away_sees_as_one_at_home(at_a_million):
    for way in ("camera-relative", "camera-relative, two floats a number"):
        assert at_a_million[way]["worst_px"] < 5e-4
    assert at_a_million["camera-relative"]["worst_centre"] <= 3e-15 * 1e6  # ACC-5


@pytest.mark.parametrize("distance", [1.0, 1e6])
def test_the_worst_that_a_search_finds_is_a_two_thousandth_of_a_pixel(distance):
    assert far.relative_at_its_worst(distance, 200, 1000)["px"] < 5e-4


def test_a_pose_chosen_to_be_bad_throws_the_deployed_camera_far_off():
    assert far.deployed_at_its_worst(1e6, 500)["centre"] > 404


def test_origin_helps_every_renderer(at_a_million):
    for way in ("deployed: general inverses, float32", "view matrix rounded once"):
        assert at_a_million[way]["worst_px"] > 5
    for way in ("deployed, with `origin`", "view matrix rounded once, with `origin`"):
        assert at_a_million[way]["worst_px"] < 0.1
    assert at_a_million["one matrix a tile"]["worst_px"] < 0.05


def test_float32_points_are_no_better_than_their_grid(at_a_million):
    assert at_a_million["camera-relative, float32 points"]["worst_px"] > 1


@pytest.mark.parametrize("same_step", [False, True])
@pytest.mark.parametrize("kind", ["quaternion", "matrix"])
def test_ten_thousand_steps_in_double_precision(kind, same_step):
    mended = "renormalised" if kind == "quaternion" else "made orthogonal"
    plain = drift.composed(f"{kind}, float64", 10_000, same_step)[-1]
    better = drift.composed(f"{kind}, float64, {mended}", 10_000, same_step)[-1]
    assert plain["steps"] == better["steps"] == 10_000
    assert plain["angle"] < 1e-11
    assert better["angle"] < 1e-11
    assert better["off_rotation"] < 1e-15


@pytest.mark.parametrize("kind", ["quaternion", "matrix"])
def test_ten_thousand_steps_in_single_precision(kind):
    mended = "renormalised" if kind == "quaternion" else "made orthogonal"
    plain = drift.composed(f"{kind}, float32", 10_000, True)[-1]
    better = drift.composed(f"{kind}, float32, {mended}", 10_000, True)[-1]
    assert plain["off_rotation"] > 10 * better["off_rotation"]
    assert better["off_rotation"] <= 8 * U32
    assert better["angle"] < 0.01


@pytest.mark.parametrize("alpha", [1.0, 0.5, 1 / 255])
def test_depth_from_a_millionth_to_a_thousand_million(alpha):
    """Two roundings of the renderer's, one division [ACC-8]."""
    rows = [row for row in depths.by_depth(alpha + 1e-9) if row["way"] == "A/d"]
    assert rows[0]["depth"] == pytest.approx(1e-6)
    assert rows[-1]["depth"] == pytest.approx(1e9)
    assert max(row["relative_error"] for row in rows) <= 4 * U32


def test_where_the_deployed_depth_breaks_down():
    rows = [row for row in depths.by_depth(1.0) if row["way"].startswith("deployed")]
    assert all(row["relative_error"] > 0.99 for row in rows if row["depth"] > 1.1e6)
    assert all(row["relative_error"] < 1e-6 for row in rows if row["depth"] < 0.9e6)


def test_faint_pixels():
    """A sum keeps its digits however faint it is, a complement loses them [ACC-9]."""
    rows = depths.by_alpha()
    assert max(row["sum_error"] for row in rows) <= 16 * U32
    faint = [row for row in rows if row["alpha"] < 1e-6]
    assert max(row["complement_error"] for row in faint) > 0.01
    for row in rows:
        covered = row["alpha"] >= 1 / 255
        assert (row["depth"] == "empty") is not covered
        assert not covered or row["depth"] == pytest.approx(4.0, rel=1e-6)
        assert not covered or row["straight_colour_error_255"] < 0.02


def test_every_pixel_of_every_slot_is_found_by_the_init_packet():
    memory = Memory(64, 48, 2, Semantics())
    try:
        for slot in range(memory.ring.slots):
            color, depth = big_images.pattern(64, 48, slot)
            memory.writer(color, depth, None, "linear", None)(slot, BOTH)
        if sys.platform == "linux":
            assert big_images.wrong_pixels(memory, 100) == 0
            memory.color(1)[3, 5, 2] = 0.9
            assert big_images.wrong_pixels(memory, 64 * 48 * 4) > 0
    finally:
        memory.close()


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere untouched memory may be reserved")
def test_slots_beyond_two_and_four_thousand_million_bytes():
    """8K, eight slots: colour goes beyond 2³¹, depth beyond 2³² bytes."""
    width, height, slots = 7680, 4320, 8
    ring, size = host_ring(width, height, slots)
    assert size > 2**32
    with mmap.mmap(-1, size) as memory:
        everything = np.frombuffer(memory, np.float32)
        colors = _slots(everything, ring.color_offset, ring.color_stride, slots, (height, width, 4))
        depth = _slots(everything, ring.depth_offset, ring.depth_stride, slots, (height, width))
        assert len(colors) == len(depth) == slots
        colors[-1][-1, -1, -1] = 0.25
        depth[-1][-1, -1] = 7.0
        end_of_colors = ring.color_offset + slots * ring.color_stride
        end_of_depths = ring.depth_offset + (slots - 1) * ring.depth_stride + 4 * width * height
        found = [
            np.frombuffer(memory[end - 4 : end], "<f4")[0] for end in (end_of_colors, end_of_depths)
        ]
        del everything, colors, depth
    assert found == [0.25, 7.0]
    assert big_images.first_beyond(2**31, width, height, slots) == {"color": 4, "depth": 0}


def test_a_size_for_which_an_index_is_too_small_is_named():
    rows = {row["size"]: row for row in big_images.largest_offsets()}
    assert rows["1080p"]["fits_int32"]
    assert rows["4K"]["fits_int32"]
    assert rows["4K"]["pixel_index_exact_in_float32"]
    assert not rows["8K"]["fits_int32"]
    assert rows["8K"]["fits_uint32"]
    assert not rows["8K"]["pixel_index_exact_in_float32"]
    assert not rows["16K"]["fits_uint32"]


BUDGETS = {"R": 8, "RtR": 16, "t": 8, "centre": 3e-15 * 2**53}


@pytest.mark.parametrize("name", pose_sets.TAKEN)
def test_the_budgets_hold_on_every_stress_set(name):
    """[ACC-2, ACC-3, ACC-4, ACC-5]"""
    found = pose_sets.worst(pose_sets.TAKEN[name], 20, 20)
    for kind, budget in BUDGETS.items():
        assert found[kind]["u"] <= budget, found[kind]


def test_what_is_no_number_or_no_rotation_is_refused_by_name():
    """[POS-3, JSN-4]"""
    answers = pose_sets.decided()
    for name, answer in answers.items():
        if "of norm" in name:
            assert answer == "invalid_rotation [POS-3]"
        elif "NaN" in name or "infinity" in name or "1e400" in name:
            assert answer == "invalid_number [JSN-4]"
        else:
            assert answer == "taken", name
