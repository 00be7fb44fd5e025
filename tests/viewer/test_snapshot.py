"""Who wants a picture, and gets none, is told why."""

from unittest.mock import Mock

import pytest
from splatbus_viewer.cli import scene_camera
from splatbus_viewer.snapshot import snapshot
from splatbus_wire.poses import IDENTITY, Pose

from tests.peers.fake_server import frame


def test_images_from_elsewhere_are_no_picture_of_a_pose(server, session, memory, tmp_path):
    server.ipc_opened(memory).send(frame(1))
    pose = Pose((9.0, 0.0, 0.0), IDENTITY.rotation)
    with pytest.raises(TimeoutError, match="1 frames came, but none from that pose"):
        snapshot(session, tmp_path / "out.png", pose, 0.5)
    with pytest.raises(ValueError, match=r"out.txt: .* end in .png, .jpg"):
        snapshot(session, tmp_path / "out.txt", pose, 0.5)


def test_a_camera_that_is_another_is_told(capsys):
    session = Mock(**{"status.message.capabilities": "scene", "scene.return_value.cameras": 3})
    for index in (0, -1):
        scene_camera(session, index, 0.5)
    assert capsys.readouterr().err == "camera -1 is camera 2 of 3, counted from 0\n"
