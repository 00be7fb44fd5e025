"""Who wants a picture gets one, or is told why not."""

from unittest.mock import Mock

import numpy as np
import pytest
from PIL import Image
from splatbus_viewer.cli import scene_camera
from splatbus_viewer.snapshot import snapshot
from splatbus_wire.poses import IDENTITY

from tests.peers.fake_server import HEIGHT, WIDTH, frame, image


def test_a_picture_shows_a_frame_from_the_pose_and_none_from_elsewhere(
    server, session, memory, tmp_path
):
    color, depth = image(1)
    color[..., 3] = 1.0
    memory.write(0, color, depth)
    ipc, path = server.ipc_opened(memory), tmp_path / "out.png"
    ipc.send(frame(1))
    pose = IDENTITY._replace(position=(0.0, 0.0, -4.0))
    snapshot(session, path, pose, 5)
    panel = np.asarray(Image.open(path))[27 : 27 + HEIGHT, 11 : 11 + WIDTH]
    assert np.abs(panel - 255 * color[..., :3]).max() <= 0.51
    ipc.send(frame(2))
    with pytest.raises(TimeoutError, match="1 frames came, but none from that pose"):
        snapshot(session, path, IDENTITY, 0.5)
    with pytest.raises(ValueError, match=r"out.txt: .* end in .png, .jpg"):
        snapshot(session, tmp_path / "out.txt", pose, 0.5)


def test_a_camera_that_is_another_is_told(capsys):
    session = Mock(**{"status.message.capabilities": "scene", "scene.return_value.cameras": 3})
    for index in (0, -1):
        scene_camera(session, index, 0.5)
    assert capsys.readouterr().err == "camera -1 is camera 2 of 3, counted from 0\n"
