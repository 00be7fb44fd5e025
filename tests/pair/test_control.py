"""Who moves the scene: the first, then whoever is left; the others are told once."""

from __future__ import annotations

from splatbus_server import SceneObject

from tests.pair.painting import painter
from tests.pair.rig import serving
from tests.pair.talk import Onlooker, Talker, object_pose
from tests.peers.raw_client import RawClient, camera_pose

LENS = {"fx": 40.0, "fy": 40.0, "cx": 16.0, "cy": 12.0, "width": 32, "height": 24}
LENS |= {"near": 0.5, "far": 7.0}
SCENE = {"objects": [SceneObject("default", "", 0), SceneObject("chair", "", 0)]}
SCENE |= {"time_range": (0.0, 10.0)}


def at(x: float) -> object:
    return lambda frame: frame["camera"]["position"][0] == x


def busy(messages: list[dict]) -> int:
    return sum(m.get("code") == "busy" for m in messages)


def test_the_first_to_pose_has_control_and_the_others_are_told_once() -> None:
    with serving(painter()) as (_, tap), Onlooker(tap) as seen:
        seen.open()
        with Talker(tap) as first, Talker(tap) as second, RawClient(tap.ports["msg"]) as old:
            first.send(camera_pose(1.0))
            assert seen.see(at(1.0))
            for x in (2.0, 3.0, 4.0):
                second.send(camera_pose(x), object_pose("default", x))
                old.send(camera_pose(-x))
            assert busy(second.said_since()) == 1
            assert busy(first.said_since()) == 0
            assert old.viewport() == [32, 24]  # 1.0: not a word of it
            first.send(camera_pose(1.5))
            frame = seen.see(lambda f: f["camera"]["position"][0] != 1.0)
            assert frame["camera"]["position"][0] == 1.5
    tap.assert_conforming()


def test_control_passes_on_with_the_newest_of_each_kind() -> None:
    with serving(painter(), **SCENE) as (_, tap), Onlooker(tap) as seen:
        seen.open()
        with Talker(tap) as second:
            with Talker(tap) as first:
                first.send(camera_pose(1.0, intrinsics=LENS), {"type": "set_time", "time": 9.0})
                first.send(object_pose("chair", 5.0, scale=2.0))
                assert seen.see(lambda f: at(1.0)(f) and f.get("objects"))["camera"]["far"] == 7.0
                second.send(camera_pose(2.0), camera_pose(3.0), object_pose("chair", 6.0))
                assert busy(second.said_since()) == 1
            frame = seen.see(at(3.0))
            assert frame["camera"]["far"] != 7.0  # intrinsics go with their connection
            assert [o["position"][0] for o in frame["objects"]] == [6.0]
            assert [o["scale"] for o in frame["objects"]] == [1.0]
            with Talker(tap) as third:
                third.send(camera_pose(8.0))
                assert busy(third.said_since()) == 1
            second.send(camera_pose(3.5))
            assert seen.see(at(3.5))
    tap.assert_conforming()


def test_who_lost_its_place_is_told_again_after_it_had_control() -> None:
    with serving(painter()) as (_, tap), Talker(tap) as second:
        with Talker(tap) as first:
            first.send(camera_pose(1.0))
            first.said_since()
            second.send(camera_pose(2.0))
            assert busy(second.said_since()) == 1
        with Onlooker(tap) as seen:
            seen.open()
            assert seen.see(at(2.0))
        second.send(camera_pose(2.5))
        assert busy(second.said_since()) == 0
    tap.assert_conforming()


def test_what_is_refused_takes_no_control() -> None:
    with serving(painter()) as (_, tap), Onlooker(tap) as seen:
        seen.open()
        with Talker(tap) as clumsy, Talker(tap) as other:
            clumsy.send(object_pose("nobody"))
            clumsy.send(camera_pose(4.0, intrinsics=LENS | {"width": 24}))
            codes = [m["code"] for m in clumsy.said_since()]
            assert codes == ["unknown_object", "invalid_message"]
            other.send(camera_pose(1.0))
            assert busy(other.said_since()) == 0
            assert (
                seen.see(lambda f: f["camera"]["position"][0] != 0.0)["camera"]["position"][0]
                == 1.0
            )
    tap.assert_conforming()
