"""The client against the reference server, two processes, and the scene in closed form."""

import re
import subprocess
import sys

import numpy as np
import pytest
import splatbus_client
from PIL import Image
from splatbus_client import Pose
from splatbus_renderer import scene
from splatbus_viewer.cli import main
from splatbus_viewer.poses import look_at

from tests.closed_form import exact_pixels

WIDTH, HEIGHT = 96, 72
TOP_LEFT = (11, 27)  # of the colour panel
POSES = [
    Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
    look_at((-3.0, -2.5, 0.0), (0.0, 0.0, 4.0)),
]


@pytest.fixture(scope="module")
def server():
    """Where a reference server runs: host and ports."""
    module = [sys.executable, "-m", "splatbus_renderer.cli"]
    size = f"{WIDTH}x{HEIGHT}"
    with subprocess.Popen(
        [*module, "--ipc-port", "0", "--msg-port", "0", "--size", size, "--quiet"],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        ready = process.stdout.readline()
        yield re.search(r"on (\S+): IPC port (\d+), message port (\d+)", ready).groups()
        process.terminate()


@pytest.fixture
def session(server):
    host, ipc_port, message_port = server
    with splatbus_client.connect(host, int(ipc_port), int(message_port)) as session:
        yield session


def camera_at(session, pose):
    session.send_camera(pose)
    while True:
        with session.next_frame(30) as frame:
            if frame.camera.pose == pose:
                return frame.camera


def test_a_picture_shows_what_a_frame_holds(server, session, tmp_path, monkeypatch):
    camera = camera_at(session, POSES[1])
    camera_at(session, POSES[0])
    session.close()  # who steers first keeps the camera [POS-11]
    for name, value in zip(("HOST", "IPC_PORT", "MSG_PORT"), server, strict=True):
        monkeypatch.setenv(f"SPLATBUS_{name}", value)
    path = tmp_path / "out.png"
    assert main(["snapshot", str(path), "--look-at", "-3,-2.5,0,0,0,4"]) == 0
    left, top = TOP_LEFT
    panel = np.asarray(Image.open(path))[top : top + HEIGHT, left : left + WIDTH].astype(int)
    for row, column, rgba, _ in exact_pixels(scene.default_scene(), camera, 300, seed=0):
        if rgba[3]:
            difference = panel[row, column] - 255 * np.array(rgba[:3])
            assert np.abs(difference).max() <= 0.51
        else:
            assert np.ptp(panel[row, column]) == 0, "squares where nothing is"
