"""The viewer without a window, as a process: what it sends, and how it ends."""

import io
import math
import re
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest
from splatbus_client import Status
from splatbus_client.channel import ChannelStatus
from splatbus_viewer.view import ORBIT_SECONDS, _Frames, _Report, orbit
from splatbus_wire.rotations import rotation_matrix

from tests.peers.fake_server import (
    CAMERA,
    CAMERA_REPLY,
    HEIGHT,
    POSE,
    WIDTH,
    frame,
    init_packet,
)

pytestmark = pytest.mark.usefixtures("where")


@contextmanager
def viewer(*arguments):
    process = subprocess.Popen(
        [sys.executable, "-m", "splatbus_viewer", "view", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def asked_for_camera(message):
    """The messages up to the question where the camera is, which is answered."""
    seen = [message.receive()]
    while seen[-1]["type"] != "get_camera_pose":
        seen.append(message.receive())
    message.send({"type": "camera", "id": seen[-1]["id"]} | CAMERA_REPLY)
    return seen


def test_an_orbit_begins_at_its_center_stays_in_the_image_plane_and_comes_back():
    ahead = rotation_matrix(POSE.rotation)[2::3]
    assert orbit(POSE, 0.0) == POSE
    for second in range(1, 8):
        moved = orbit(POSE, second * ORBIT_SECONDS / 8)
        offset = [a - b for a, b in zip(moved.position, POSE.position, strict=True)]
        assert math.hypot(*offset) > 0.1
        assert sum(a * b for a, b in zip(ahead, offset, strict=True)) == pytest.approx(0, abs=1e-12)
        assert moved.rotation == POSE.rotation
    assert orbit(POSE, ORBIT_SECONDS).position == pytest.approx(POSE.position)


def test_a_tag_that_comes_back_is_a_latency(server, memory):
    with viewer("--rate", "100") as process:
        ipc, message = server.ipc_1_1(), server.message_1_1()
        asked_for_camera(message)
        ipc.send(init_packet(memory.name))
        ipc.receive_type("opened")
        while (tag := message.receive_type("camera_pose").get("tag")) is None:
            pass
        for seq, back in [(1, "another-1"), (2, tag), (3, tag)]:
            ipc.send(frame(seq, camera=CAMERA | {"tag": back}))
            ipc.receive_type("release")
        process.send_signal(signal.SIGTERM)
        out, _ = process.communicate(timeout=30)
    assert re.search(r"3 frames, .* latency [\d.]+ ms \(p99 [\d.]+\)", out.splitlines()[-1])


def test_a_size_is_asked_for_on_each_connection_and_its_refusal_told(server):
    with viewer("--size", "64x48", "--seconds", "30") as process:
        for _ in range(2):
            message = server.message_1_1()
            asked_for_camera(message)
            while (request := message.receive())["type"] != "set_viewport":
                if request["type"] == "get_viewport_size":
                    size = {"type": "viewport_size", "viewport_size": [WIDTH, HEIGHT]}
                    message.send(size | {"id": request["id"]})
            assert (request["width"], request["height"]) == (64, 48)
            error = {"type": "error", "code": "unsupported", "message": "no", "id": request["id"]}
            message.send(error)
            message.receive_type("camera_pose")
            message.close()
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=30)
    assert "the images keep their size: the server answered unsupported: no" in err


def test_poses_wait_for_the_images_of_the_former(server, memory):
    with viewer("--rate", "200"):
        ipc, message = server.ipc_1_1(), server.message_1_1()
        asked_for_camera(message)
        ipc.send(init_packet(memory.name))
        ipc.receive_type("opened")
        ipc.send(frame(0))
        ipc.receive_type("release")
        message.receive_type("camera_pose")
        for seq in (1, 2):
            times = [message.receive_type("camera_pose")["timestamp"] for _ in range(3)]
            ipc.send(frame(seq))
            ipc.receive_type("release")
        assert times[2] - times[1] > 0.2, "without an image, patience and then another pose"


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_ends_it_in_order(server, name):
    with viewer() as process:
        ipc, message = server.ipc(), server.message()
        message.receive()
        process.send_signal(getattr(signal, name))
        assert process.wait(30) == 0
        assert ipc.ended()


def test_it_ends_after_its_seconds_and_says_what_to_do_where_no_server_runs(server):
    server.stop()
    with viewer("--seconds", "0.5") as process:
        out, err = process.communicate(timeout=30)
    assert process.returncode == 0
    assert "start one with: splatbus-server" in err
    assert err.count("cannot connect") == 2, "once a channel, however often it is tried"
    assert "not connected" in out


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(("out", "lines"), [(io.StringIO(), 2), (Terminal(), 1)])
def test_a_status_is_written_seldom_and_on_a_terminal_in_place(out, lines):
    report, frames = _Report(out), _Frames()
    connected = ChannelStatus(True, 1, "1.1")
    busy = Status(connected, connected, None, "another client has control")
    for status in [Status(ChannelStatus(), ChannelStatus(), None)] * 50 + [busy] * 50:
        report.update(status, frames, (320, 240))
    assert out.getvalue().count("frames") == lines
    assert out.isatty() or out.getvalue().endswith("message 1.1; another client has control\n")
    assert ("\n" in out.getvalue()) != out.isatty()
