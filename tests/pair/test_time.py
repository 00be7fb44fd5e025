"""A scene that moves by itself stands still where a client sets its time."""

from __future__ import annotations

from splatbus_client import Pose

from tests.pair.known_scene import showing, wrong_pixels
from tests.pair.rig import MOST_SECONDS, eventually
from tests.pair.talk import Onlooker, Talker
from tests.peers.raw_client import camera_pose

DEGREES = 45.0


def test_the_time_that_is_set_is_the_time_that_is_shown() -> None:
    with showing(degrees=DEGREES) as (_, tap), tap.session() as session:
        eventually(lambda: session.status.message.version, "welcome")
        session.send_camera(Pose((0.0, -0.5, -1.0), (0.0, 0.0, 0.0, 1.0)))
        for wanted, shown in ((1.25, 1.25), (6.0, 6.0), (-3.0, 0.0), (99.0, 8.0)):
            session.send_time(wanted)
            while True:
                with session.next_frame(MOST_SECONDS) as frame:
                    if frame.time == shown:
                        assert wrong_pixels(frame, DEGREES)[0] == 0
                        break
    tap.assert_conforming()


def test_it_plays_until_then_stands_still_and_plays_again_when_its_client_has_gone() -> None:
    with showing(degrees=DEGREES) as (bus, tap), Onlooker(tap) as seen:
        seen.open()
        times = [seen.see(lambda f: True)["time"] for _ in range(5)]
        assert len(set(times)) == 5  # it plays
        with Talker(tap) as client:
            client.send({"type": "set_time", "time": 2.5})
            seen.see(lambda f: f["time"] == 2.5)
            before = bus.statistics.frames_published
            client.send({"type": "set_time", "time": 2.5}, camera_pose(0.0))
            client.said_since()
            assert seen.silent(0.3)
            assert bus.statistics.frames_published <= before + 1  # one may have been under way
        seen.see(lambda f: f["time"] != 2.5)
    tap.assert_conforming()


def test_a_scene_at_rest_grants_no_time() -> None:
    with showing() as (_, tap), Talker(tap) as client:
        assert "time" not in client.granted
        client.send({"type": "set_time", "time": 1.0})
        [error] = client.said_since()
        assert error["code"] == "unsupported"
