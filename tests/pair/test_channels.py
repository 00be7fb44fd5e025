"""What nobody wants is neither converted nor written, and what has not changed not rendered."""

from __future__ import annotations

from tests.pair.painting import painter
from tests.pair.rig import serving
from tests.pair.talk import Onlooker, Talker
from tests.peers.raw_client import camera_pose


def at(x: float) -> object:
    return lambda frame: frame["camera"]["position"][0] == x


def test_depth_that_nobody_wants_costs_nothing() -> None:
    with serving(painter()) as (bus, tap), Talker(tap) as moving, Onlooker(tap) as seen:
        seen.send({"type": "subscribe", "channels": ["color"]})
        seen.open()
        for x in range(1, 6):
            moving.send(camera_pose(float(x)))
            seen.see(at(float(x)))
        counts = bus.statistics
        assert counts.colors_converted == counts.frames_published >= 5
        assert counts.depths_converted == 0
        # A new subscription forces an image, of the same scene.
        seen.send({"type": "subscribe", "channels": ["color", "depth"]})
        frame = seen.see(lambda f: True)
        assert frame["camera"]["position"][0] == 5.0
        assert (seen.depth(frame) == frame["time"]).all()
        assert bus.statistics.depths_converted == 1
    tap.assert_conforming()


def test_a_scene_at_rest_publishes_nothing_however_often_it_is_posed() -> None:
    with serving(painter()) as (bus, tap), Talker(tap) as moving, Onlooker(tap) as seen:
        seen.open()
        moving.send(camera_pose(1.0))
        seen.see(at(1.0))
        before = bus.statistics
        for _ in range(100):
            moving.send(camera_pose(1.0))
        moving.said_since()
        assert seen.silent(0.2)
        after = bus.statistics
        assert after.frames_published == before.frames_published
        assert after.views == before.views
        assert after.poses_received == before.poses_received + 100
    tap.assert_conforming()


def test_without_readers_nothing_is_rendered() -> None:
    with serving(painter()) as (bus, tap), Talker(tap) as moving:
        for x in range(20):
            moving.send(camera_pose(float(x)))
        moving.said_since()
        assert bus.statistics.views == 0
    tap.assert_conforming()
