"""What checks on servers reckon with: shapes, lenses, clocks, objects. Mutants show the rest."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.checks.v1_0.frm import BAD_HEADERS, EXTREME, PLACES, in_utf_8, kind_of
from splatbus_conformance.checks.v1_1.cam.lenses import (
    LARGEST,
    bad_lenses,
    fitting,
    other_shapes,
)
from splatbus_conformance.checks.v1_1.obj import broken_object_poses
from splatbus_conformance.images.known_scene import SceneState
from splatbus_conformance.images.pinhole import STILL, ObjectPlacement, told_of
from splatbus_conformance.rules.v1_1.cam import lens as judged_lens
from splatbus_conformance.rules.v1_1.obj import object_pose as judged_object_pose
from splatbus_conformance.trials.moves.clocks import ClockReading, expect_one_offset
from splatbus_conformance.trials.moves.exchanges.exchange import ASKED
from splatbus_conformance.trials.moves.image_session import AT_REST, placed
from splatbus_conformance.trials.moves.lenses import in_force, same_shape, scaled
from splatbus_conformance.trials.testee.server_probe import ServerFacts
from splatbus_conformance.trials.trial import Violation
from splatbus_conformance.wire.message_kinds import CAPABILITIES
from splatbus_conformance.wire.messages import frame

SIDES = st.integers(1, LARGEST)
LENS = {
    "fx": 1500.0,
    "fy": 1400.0,
    "cx": 960.0,
    "cy": 540.0,
    "width": 1920,
    "height": 1080,
    "near": 0.01,
    "far": 100.0,
}


# Packets


def test_each_extreme_length_is_of_a_kind_of_its_own() -> None:
    kinds = {kind_of(it) for it in BAD_HEADERS if it.length in EXTREME and not it.later}
    assert set(EXTREME) < kinds


def test_a_header_with_all_that_it_announces_is_a_kind_of_its_own() -> None:
    whole = [it for it in BAD_HEADERS if it.follows == "as much as it announces"]
    others = {kind_of(it) for it in BAD_HEADERS if it not in whole}
    assert whole
    assert not others & {kind_of(it) for it in whole}


def test_streams_are_cut_inside_of_characters_of_every_length_and_of_escapes() -> None:
    stream = b"".join(map(in_utf_8, ASKED))
    inside = [*PLACES["inside characters"](stream), *PLACES["inside escapes"](stream)]
    assert {0xC3, 0xE6, 0xF0, ord("\\")} <= {stream[at - 1] for at in inside}


# Shapes and lenses


def test_the_rounded_size_of_the_specification_has_the_shape_of_the_whole_one() -> None:
    assert same_shape(854, 480, (1920, 1080))
    assert not same_shape(854, 480, (1080, 1920))


def test_a_shape_is_another_from_the_very_number_that_the_specification_gives() -> None:
    """|h·64 − w·48| < max(w, h, 64, 48): of width 64 it is 64 that is too far."""
    assert same_shape(64, 48, (64, 48))
    assert not same_shape(64, 49, (64, 48))
    assert same_shape(128, 97, (64, 48))
    assert not same_shape(128, 98, (64, 48))


@given(st.integers(1, 4096), SIDES, SIDES)
def test_heights_that_fit_are_a_range_around_the_middle(width: int, across: int, down: int) -> None:
    size = across, down
    found = fitting(width, size)
    for height in found:
        assert same_shape(width, height, size)
    if found:
        for beyond in (min(found) - 1, max(found) + 1):
            assert not (1 <= beyond <= LARGEST and same_shape(width, beyond, size))


@given(st.integers(1, 2000), st.integers(1, 2000))
def test_other_shapes_are_others(across: int, down: int) -> None:
    assert not any(same_shape(*it, (across, down)) for it in other_shapes((across, down)))


def test_shapes_that_are_just_off_are_among_them() -> None:
    assert {(640, 470), (640, 490)} <= set(other_shapes((64, 48)))


def test_a_lens_is_scaled_axis_by_axis_and_its_planes_are_left_alone() -> None:
    told = scaled(LENS, (960, 270))
    assert told == {
        "fx": 750.0,
        "fy": 350.0,
        "cx": 480.0,
        "cy": 135.0,
        "near": 0.01,
        "far": 100.0,
    }


@pytest.mark.parametrize("name", ["fx", "fy", "cx", "cy", "near", "far"])
def test_a_number_may_be_off_by_single_precision_and_by_no_more(name: str) -> None:
    wanted = scaled(LENS, (1920, 1080))
    single = {each: float(np.float32(value)) for each, value in wanted.items()}
    assert not in_force({"camera": single}, wanted)
    off = {"camera": wanted | {name: wanted[name] * (1 + 1e-6)}}
    assert in_force(off, wanted).startswith(f"{name} is ")
    assert in_force({"camera": wanted | {name: math.nan}}, wanted)


def test_every_bad_lens_breaks_the_rule_and_the_good_one_does_not() -> None:
    assert not any(it.breach for it in judged_lens({"intrinsics": LENS}, "camera_pose"))
    for bad in bad_lenses(LENS):
        assert any(it.breach for it in judged_lens({"intrinsics": bad}, "camera_pose")), bad


# Clocks


def read_at(moment: float, server: float, trip: float = 0.002) -> ClockReading:
    return ClockReading(moment, server, moment + trip, f"a pong at {moment}")


class Judge(SimpleNamespace):
    """A trial that only judges."""

    def violated(self, code: str, what: str) -> Any:
        raise Violation(code, what)


def test_readings_of_one_clock_have_an_offset_in_common() -> None:
    expect_one_offset(Judge(), [read_at(t, t + 1000.001) for t in (0.0, 1.0, 7.0)])  # type: ignore[arg-type]


@pytest.mark.parametrize("late", [0.05, -0.05, 1.7e9])
def test_a_reading_before_its_ping_or_after_its_pong_is_found(late: float) -> None:
    readings = [read_at(0.0, 1000.001), read_at(1.0, 1001.001 + late)]
    with pytest.raises(Violation, match="was not read in between"):
        expect_one_offset(Judge(), readings)  # type: ignore[arg-type]


# Objects


def test_every_broken_pose_of_an_object_breaks_the_rule_and_the_good_one_does_not() -> None:
    good = placed("default", AT_REST, 0.5)
    assert not any(it.breach for it in judged_object_pose(good))
    for what, message, _ in broken_object_poses(good):
        assert any(it.breach for it in judged_object_pose(message)), what


def test_a_frame_tells_of_an_object_or_not() -> None:
    chair = {"object": "chair", "position": [0.0] * 3, "rotation": [0.0, 0.0, 0.0, 1.0]}
    assert told_of(frame(1, 1, 0) | {"objects": [chair]}, "chair") == chair
    for without in ({}, {"objects": []}, {"objects": None}, {"objects": [5, "chair"]}):
        assert told_of(frame(1, 1, 0) | without, "chair") is None


# What is known of the server


def facts(*granted: str, scene: Any = None) -> ServerFacts:
    welcome = {"type": "welcome", "capabilities": list(granted)}
    return ServerFacts(welcome={"ipc": None, "msg": welcome}, scene=scene)


def test_a_capability_counts_on_whichever_channel_it_was_granted() -> None:
    known = facts("objects", "ping")
    assert known.lacks("capability:objects") is None
    assert known.lacks("capability:time") == "the server does not grant the capability time"
    assert set(known.capabilities("msg")) <= set(CAPABILITIES["msg"])
    assert known.capabilities("ipc") == []


@pytest.mark.parametrize(
    "scene", [None, {}, {"objects": None, "timeRange": None}, {"objects": [5]}]
)
def test_of_a_scene_that_is_not_told_the_default_object_alone_is_known(scene: Any) -> None:
    known = facts(scene=scene)
    assert known.objects() == ["default"]
    assert known.time_range() is None
    assert known.setting(frame(1, 1, 0) | {"time": 3.0}) == SceneState()


def test_a_scene_with_a_ball_that_moves_is_set_as_it_is_told() -> None:
    objects = [{"id": "default"}, {"id": "ball"}]
    known = facts(scene={"objects": objects, "timeRange": [0.0, 4.0]})
    half = ObjectPlacement(scale=0.5)
    assert known.setting(frame(1, 1, 0) | {"time": 3.0}, half) == SceneState(half, STILL, 3.0)
    assert known.setting(frame(1, 1, 0) | {"time": "now"}).time == 0.0
