"""Waits of poses for their images."""

import pytest
from splatbus_viewer.latency import Latencies, percentiles
from splatbus_wire.messages import FrameCamera
from splatbus_wire.poses import IDENTITY, Pose

POSE = Pose((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))


def camera(pose=IDENTITY, tag=None):
    return FrameCamera(pose, 1.0, 1.0, 0.5, 0.5, 1, 1, 0.1, 1.0, tag)


def test_a_tag_ends_the_wait_of_its_pose_whatever_the_pose():
    latencies = Latencies()
    for number in range(3):
        latencies.asked_for(f"v-{number}", float(number))
    latencies.shown(camera(tag="v-1"), 1.25)
    latencies.shown(camera(), 5.0)
    latencies.shown(camera(tag="v-1"), 5.0)
    latencies.shown(camera(tag="another viewer's"), 5.0)
    latencies.shown(camera(tag="v-2"), 2.5)
    assert list(latencies.seconds) == [0.25, 0.5]


def test_without_tags_poses_are_compared():
    latencies = Latencies()
    latencies.asked_for(POSE, 1.0)
    latencies.asked_for(POSE, 2.0)
    latencies.shown(camera(IDENTITY), 3.0)
    latencies.shown(camera(POSE), 3.0)
    latencies.shown(camera(POSE), 4.0)
    assert list(latencies.seconds) == [2.0]


def test_what_never_comes_back_is_forgotten():
    latencies = Latencies()
    for number in range(10_000):
        latencies.asked_for(str(number), 0.0)
    assert len(latencies._asked) < 1000
    latencies.shown(camera(tag="9999"), 1.0)
    assert list(latencies.seconds) == [1.0]


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [([0.5], (0.5, 0.5)), ([1.0, 2.0], (1.5, 1.99)), (list(range(101)), (50, 99))],
)
def test_percentiles(seconds, expected):
    assert percentiles(seconds) == pytest.approx(expected)
