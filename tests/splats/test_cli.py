"""A file is served as it is: what a client gets is what the renderer draws of what was read."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import splatbus_client
from splatbus_client import Placement, Pose, Session
from splatbus_server.view import Intrinsics, View, field_of_view
from splatbus_splats.cli import main
from splatbus_splats.definition import Image, placed
from splatbus_splats.files import ply
from splatbus_splats.files.read import read
from splatbus_splats.made import made
from splatbus_splats.renderer import rendered
from splatbus_splats.serving import lens_for

from tests.splats.shots import some, view_of

SECONDS = 60
COMMAND = [sys.executable, "-m", "splatbus_splats"]
ENVIRONMENT = {name: value for name, value in os.environ.items() if "SPLATBUS" not in name}
SIZE = (64, 48)
TOLD = """\
scene.ply: 100%% read
scene.ply: 1,500 Gaussians of degree 2, from (%.4g, %.4g, %.4g) to (%.4g, %.4g, %.4g)\
; 1 left out: quaternion zero
"""


class Server(NamedTuple):
    process: subprocess.Popen[str]
    file: Path
    ports: tuple[int, int]


@contextmanager
def serving(file: Path, *options: str) -> Iterator[Server]:
    command = [*COMMAND, str(file), "--ipc-port", "0", "--msg-port", "0", "--size", "64x48"]
    with subprocess.Popen(
        [*command, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        match = re.fullmatch(
            r"splatbus_splats ready on \S+: IPC port (\d+), message port (\d+), 64x48\n", line
        )
        try:
            assert match, line
            yield Server(process, file, (int(match[1]), int(match[2])))
        finally:
            process.kill()
            process.communicate()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    file = tmp_path_factory.mktemp("scene") / "scene.ply"
    scene = made(1501, 2)
    scene.rotations[77] = 0
    ply.write(file, scene)
    with serving(file) as server:
        yield server


@pytest.fixture
def session(server: Server) -> Iterator[Session]:
    with splatbus_client.connect("127.0.0.1", *server.ports) as session:
        yield session


def expected(server: Server, view: View) -> Image:
    objects = placed(view, {"default": read(server.file).gaussians})
    return rendered(objects, view.intrinsics, view.width, view.height)


def compare(color: np.ndarray, depth: np.ndarray, image: Image) -> None:
    np.testing.assert_array_equal(color, np.clip(image.color, 0, 1))
    alpha = image.color[..., 3]
    covered = (alpha >= np.float32(1 / 255)) & (image.inverse > 0)
    assert covered.mean() > 0.3
    right = np.full_like(alpha, np.inf)
    right[covered] = alpha[covered] / image.inverse[covered]
    np.testing.assert_array_equal(depth, right)


def test_a_client_sees_the_scene_from_where_it_looks(server: Server, session: Session) -> None:
    pose = Pose((0.5, -1.0, 0.25), (-0.1, 0.2, 0.0, 0.975))
    session.send_camera(pose)
    while True:
        with session.next_frame(SECONDS) as frame:
            if frame.camera.pose == pose:
                color, depth = frame.color.copy(), frame.depth.copy()
                break
    lens = lens_for(*SIZE, [read(server.file).gaussians])
    compare(color, depth, expected(server, view_of(pose, size=SIZE, intrinsics=lens)))


def test_a_client_moves_and_scales_the_scene(server: Server, session: Session) -> None:
    sent = Placement("default", Pose((0.25, 0.5, 2.0), (0.0, 0.5, 0.0, 0.75**0.5)), 0.5)
    session.send_object(sent.pose, scale=sent.scale)
    while True:
        with session.next_frame(SECONDS) as frame:
            if frame.placement() == sent:
                color, depth, pose = frame.color.copy(), frame.depth.copy(), frame.camera.pose
                break
    lens = lens_for(*SIZE, [read(server.file).gaussians])
    compare(color, depth, expected(server, view_of(pose, sent, size=SIZE, intrinsics=lens)))


def test_it_tells_what_the_scene_holds(server: Server, session: Session) -> None:
    gaussians = read(server.file).gaussians
    (described,) = session.scene(SECONDS).objects
    assert (described.id, described.name, described.gaussians) == ("default", "scene.ply", 1500)
    np.testing.assert_allclose(described.bounds, gaussians.bounds)


def test_it_says_what_it_read_and_ends_when_it_is_told(server: Server) -> None:
    server.process.send_signal(signal.SIGINT)
    _, log = server.process.communicate(timeout=SECONDS)
    assert server.process.returncode == 0
    bounds = read(server.file).gaussians.bounds
    assert bounds is not None
    assert log.startswith(TOLD % (*bounds.min, *bounds.max))
    assert "Traceback" not in log


def test_it_begins_where_the_first_picture_was_taken(tmp_path: Path) -> None:
    ply.write(tmp_path / "a.ply", made(500, 1))
    camera = {
        "id": 0, "img_name": "a", "width": 1280, "height": 480, "position": [0.5, -0.25, 1],
        "rotation": [[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]], "fx": 500.0, "fy": 450.0,
    }  # fmt: skip
    (tmp_path / "cameras.json").write_text(json.dumps([camera, camera]))
    options = ("--cameras", str(tmp_path / "cameras.json"))
    with (
        serving(tmp_path / "a.ply", *options) as server,
        splatbus_client.connect("127.0.0.1", *server.ports) as session,
        session.next_frame(SECONDS) as frame,
    ):
        pose = frame.camera.pose
        np.testing.assert_allclose(np.abs(pose.rotation), (0, 0.2**0.5, 0, 0.8**0.5), atol=1e-12)
        assert pose.position == (0.5, -0.25, 1)
        lens = Intrinsics(50.0, 45.0, 32.0, 24.0, 0.01, 100.0)
        view = view_of(pose, size=SIZE, intrinsics=lens)
        compare(frame.color, frame.depth, expected(server, view))
        assert session.scene(SECONDS).cameras == 2


def test_help_teaches(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    text = capsys.readouterr().out
    for word in ("examples:", "what next:", "exit codes:", "--cameras", "--token-file"):
        assert word in text


def test_what_is_no_splat_file_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mesh.splat"
    file.write_bytes(bytes(33))
    for path, message in ((file, "byte 32 is cut short"), (tmp_path / "none.ply", "none.ply")):
        assert main([str(path)]) == 1
        error = capsys.readouterr().err
        assert str(path) in error
        assert message in error


def test_cameras_that_are_none_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ply.write(tmp_path / "a.ply", made(5, 0))
    cameras = tmp_path / "cameras.json"
    cameras.write_text(json.dumps([{}]))
    assert main([str(tmp_path / "a.ply"), "--cameras", str(cameras), "--quiet"]) == 1
    assert f"{cameras}: camera 0 has no img_name" in capsys.readouterr().err


def test_a_size_that_is_none_is_refused() -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["a.ply", "--size", "big"])


def test_a_vast_scene_is_seen_to_its_end() -> None:
    assert lens_for(*SIZE, []) == field_of_view(*SIZE)
    lens = lens_for(*SIZE, [some([(0, 0, 0), (300, 0, 400)])])
    assert lens == Intrinsics(*field_of_view(*SIZE)[:4], far=2000)
