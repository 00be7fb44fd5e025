"""Who wants a picture, and gets none, is told why."""

import pytest
from splatbus_viewer.snapshot import snapshot
from splatbus_wire.poses import IDENTITY, Pose

from tests.peers.fake_server import frame


def test_images_from_elsewhere_are_no_picture_of_a_pose(server, session, memory, tmp_path):
    server.ipc_opened(memory).send(frame(1))
    pose = Pose((9.0, 0.0, 0.0), IDENTITY.rotation)
    with pytest.raises(TimeoutError, match="1 frames came, but none from that pose"):
        snapshot(session, tmp_path / "out.png", pose, 0.5)
