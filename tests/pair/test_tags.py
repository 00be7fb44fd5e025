"""A tag comes back with the first image that shows its pose, and measures how long that took."""

from __future__ import annotations

import time

from splatbus_client import Pose

from tests.pair.painting import painter
from tests.pair.rig import MOST_SECONDS, serving
from tests.pair.talk import Onlooker, Talker
from tests.peers.raw_client import camera_pose

TURNS = 50


def test_tags_give_the_latency_of_every_pose_that_was_shown() -> None:
    latencies: dict[str, float] = {}
    with serving(painter()) as (_, tap), tap.session() as session:
        with session.next_frame(MOST_SECONDS):
            pass
        for number in range(TURNS):
            tag, sent = f"7c1f-{number}", time.monotonic()
            session.send_camera(Pose((number + 1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), tag=tag)
            while True:
                with session.next_frame(MOST_SECONDS) as frame:
                    assert frame.camera.tag not in latencies  # once only
                    if frame.camera.tag == tag:
                        assert frame.camera.pose.position[0] == number + 1.0
                        latencies[tag] = time.monotonic() - sent
                        break
    assert len(latencies) == TURNS
    assert min(latencies.values()) > 0.0
    tap.assert_conforming()


def test_every_connection_is_told_once_and_overtaken_poses_never() -> None:
    with serving(painter()) as (_, tap), Talker(tap) as moving:
        with Onlooker(tap) as one, Onlooker(tap) as two:
            for reader in (one, two):
                reader.open()
            tags: dict[Onlooker, list[str]] = {one: [], two: []}
            for number in range(200):
                moving.send(camera_pose(number + 1.0, tag=f"t{number}"))
            for reader, seen in tags.items():

                def last(frame: dict, seen: list[str] = seen) -> bool:
                    if "tag" in frame["camera"]:
                        seen.append(frame["camera"]["tag"])
                        position = frame["camera"]["position"][0]
                        assert seen[-1] == f"t{int(position) - 1}"
                    return frame["camera"]["position"][0] == 200.0

                reader.see(last)
        for seen in tags.values():
            assert seen[-1] == "t199"
            assert len(seen) == len(set(seen))
            assert len(seen) < 200
    tap.assert_conforming()


def test_a_pose_that_changes_nothing_makes_no_image_and_its_tag_waits() -> None:
    with serving(painter()) as (bus, tap), Talker(tap) as moving, Onlooker(tap) as seen:
        seen.send({"type": "subscribe", "channels": ["color"]})
        seen.open()
        moving.send(camera_pose(1.0, tag="a"))
        assert seen.see(lambda f: f["camera"]["position"][0] == 1.0)["camera"]["tag"] == "a"
        published = bus.statistics.frames_published
        moving.send(camera_pose(1.0, tag="b"), camera_pose(1.0, tag="c"))
        assert moving.said_since() == []
        assert seen.silent(0.3)
        assert bus.statistics.frames_published == published
        seen.send({"type": "subscribe", "channels": ["color", "depth"]})
        assert seen.see(lambda f: True)["camera"].get("tag") == "c"  # an image is needed now
    tap.assert_conforming()
