"""A session against a server that the test plays, over real sockets and real shared memory."""

import numpy as np
import pytest
from splatbus_client import Pose

from tests.client.fake_server import (
    HEIGHT,
    WIDTH,
    frame,
    init_packet,
)

POSE = Pose((1.0, -2.0, 5.0), (-0.1, 0.2, -0.3, 0.9273618495495703))


def image(seed):
    """Top-down colour and depth that no other seed has."""
    values = np.random.default_rng(seed).random((HEIGHT, WIDTH, 5), np.float32)
    return values[..., :4], values[..., 4] + 1


def test_a_frame_is_read_top_down_and_released(server, session, memory):
    color, depth = image(1)
    memory.write(2, color, depth)
    ipc = server.ipc_1_1()
    ipc.send(init_packet(memory.name))
    assert ipc.receive() == {"type": "opened", "generation": 1}
    ipc.send(frame(7, slot=2))
    with session.next_frame(5) as lease:
        np.testing.assert_array_equal(lease.color, color)
        np.testing.assert_array_equal(lease.depth, depth)
        assert lease.camera.pose.position == (0.0, 0.0, -4.0)
        assert lease.intact
        assert not lease.color.flags.writeable
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 7}
    assert not lease.intact
    with pytest.raises(RuntimeError, match="IMG-14"):
        _ = lease.color


def test_poses_are_sent_in_the_order_of_the_axes_with_timestamps(server, session):
    message = server.message_1_1()
    session.send_camera(POSE)
    session.send_object(POSE)
    camera, cloud = message.receive(), message.receive()
    assert list(camera) == ["type", "timestamp", "position", "rotation"]
    assert list(camera["position"]) == ["x", "y", "z"]
    assert list(camera["rotation"]) == ["x", "y", "z", "w"]
    assert camera["rotation"]["w"] == 0.9273618495495703
    assert (camera["type"], cloud["type"]) == ("camera_pose", "point_cloud_pose")
    assert camera["timestamp"] <= cloud["timestamp"]
