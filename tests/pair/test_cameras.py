"""Lenses and poses: every image is what its own camera says, to the pixel."""

from __future__ import annotations

import math

import pytest
from splatbus_client import Intrinsics, Pose
from splatbus_viewer.poses import look_at

from tests.pair.known_scene import showing, wrong_pixels
from tests.pair.rig import MOST_SECONDS, eventually
from tests.pair.talk import Onlooker, Talker
from tests.peers.raw_client import camera_pose

LENSES = [
    Intrinsics(800.0, 800.0, 960.0, 540.0, 1920, 1080, 0.01, 100.0),
    Intrinsics(90.0, 120.0, 40.0, 30.0, 96, 54, 0.5, 6.0),
    Intrinsics(300.0, 310.0, 100.0, 300.0, 854, 480, 0.01, 4.5),
    Intrinsics(200.0, 200.0, 150.0, 100.0, 300, 200, 3.2, 100.0),
]


def test_every_frame_is_what_its_own_camera_says() -> None:
    wrong = seen = 0
    with showing() as (_, tap), tap.session() as session:
        eventually(lambda: session.status.message.version, "welcome")
        for number in range(60):
            angle = number / 10
            eye = (2 * math.sin(angle), -0.5 - angle / 10, 1 - math.cos(angle))
            lens = LENSES[number % 3] if number % 5 else None
            session.send_camera(look_at(eye, (0.0, 0.0, 4.0)), intrinsics=lens)
            with session.next_frame(MOST_SECONDS) as frame:
                a, b = wrong_pixels(frame)
            wrong, seen = wrong + a, seen + b
    assert seen > 1000
    assert wrong == 0
    tap.assert_conforming()


@pytest.mark.parametrize("lens", LENSES[:3])
def test_a_lens_is_scaled_to_the_images_and_stays(lens: Intrinsics) -> None:
    with showing() as (_, tap), Talker(tap) as client, Onlooker(tap) as seen:
        seen.open()
        client.send(camera_pose(0.25, intrinsics=lens._asdict()))
        camera = seen.see(lambda f: f["camera"]["position"][0] == 0.25)["camera"]
        across, down = 96 / lens.width, 54 / lens.height
        assert camera["fx"] == pytest.approx(lens.fx * across, rel=1e-15)
        assert camera["fy"] == pytest.approx(lens.fy * down, rel=1e-15)
        assert camera["cx"] == pytest.approx(lens.cx * across, rel=1e-15)
        assert camera["cy"] == pytest.approx(lens.cy * down, rel=1e-15)
        assert (camera["near"], camera["far"]) == (lens.near, lens.far)
        client.send(camera_pose(0.5))
        again = seen.see(lambda f: f["camera"]["position"][0] == 0.5)["camera"]
        assert again | {"position": 0} == camera | {"position": 0}
        client.send({"type": "set_viewport", "width": 192, "height": 108, "id": 1})
        assert client.until("viewport_size")[0]["viewport_size"] == [192, 108]
        while "meta" not in (message := seen.receive() or {}):
            seen.release(message)
        seen.send({"type": "opened", "generation": 2}, {"type": "closed", "generation": 1})
        twice = seen.see(lambda f: f["generation"] == 2)["camera"]
        assert twice["fx"] == pytest.approx(2 * camera["fx"], rel=1e-15)
        assert twice["cy"] == pytest.approx(2 * camera["cy"], rel=1e-15)
    tap.assert_conforming()


def test_another_shape_is_refused_and_nothing_of_it_applied() -> None:
    with showing() as (_, tap), Talker(tap) as client, Onlooker(tap) as seen:
        seen.open()
        client.send(camera_pose(0.5, intrinsics=LENSES[3]._asdict(), tag="no"))
        [error] = client.said_since()
        assert (error["code"], error["pointer"]) == ("invalid_message", "/intrinsics")
        client.send(camera_pose(0.25))
        frame = seen.see(lambda f: f["camera"]["position"][0] != 0.0)
        assert frame["camera"]["position"][0] == 0.25
        assert frame["camera"]["near"] == 0.01
    tap.assert_conforming()


def test_the_scenes_cameras_come_with_the_servers_lens() -> None:
    cameras = [Pose((float(i), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for i in range(3)]
    with showing(cameras=cameras) as (_, tap), Talker(tap) as client, Onlooker(tap) as seen:
        seen.open()
        reply = client.ask({"type": "get_camera_pose", "cam_idx": 4, "id": 9}) or {}
        client.send({"type": "camera_pose", "position": {"x": 1.0, "y": 0.0, "z": 0.0}, **IDENTITY})
        frame = seen.see(lambda f: f["camera"]["position"][0] == 1.0)
        assert reply["position"] == [1.0, 0.0, 0.0]
        lens = {name: frame["camera"][name] for name in Intrinsics._fields}
        assert reply["intrinsics"] == lens
    tap.assert_conforming()


IDENTITY = {"rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
