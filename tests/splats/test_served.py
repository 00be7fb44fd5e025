"""Files are served as they are: clients get what the renderer draws of what was read."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from splatbus_client import FrameLease, Placement, Pose, Session
from splatbus_server.view import Intrinsics, field_of_view
from splatbus_splats.beginning import before, lens_for
from splatbus_splats.files import ply
from splatbus_splats.files.read import read
from splatbus_splats.made import made
from splatbus_splats.scene import Clip, Frames, Scene

from tests.splats.served import (
    SECONDS,
    SIZE,
    Server,
    compare,
    connected,
    drawn_of,
    frame_that,
    serving,
    still,
    two_files,
)
from tests.splats.shots import some, view_of
from tests.splats.times import drawn, written

pytestmark = pytest.mark.usefixtures("loops")

CAMERA = {
    "id": 0, "img_name": "a", "width": 1280, "height": 480, "position": [0.5, -0.25, 1],
    "rotation": [[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]], "fx": 500.0, "fy": 450.0,
}  # fmt: skip
WHOLE = ("--size", "64x48", "--skips", "exact")
"""Images have all their pixels, whenever cameras move."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return two_files(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def server(files: list[Path]) -> Iterator[Server]:
    with serving(files[0], *WHOLE, files[1]) as server:
        yield server


@pytest.fixture
def session(server: Server) -> Iterator[Session]:
    with connected(server) as session:
        yield session


def test_a_client_sees_the_scene_from_where_it_looks(session: Session, files: list[Path]) -> None:
    scene, pose = still(*files), Pose((0.5, -1.0, 0.25), (-0.1, 0.2, 0.0, 0.975))
    _, lens = before(scene, lens_for(*SIZE, scene.parts.values()), *SIZE)
    places = [Placement(name, Pose((0, 0, 0), (0, 0, 0, 1)), 1.0) for name in scene.parts]
    view = view_of(pose, *places, size=SIZE, intrinsics=lens)
    session.send_camera(pose)
    with frame_that(session, lambda frame: frame.camera.pose == pose) as frame:
        compare(frame, drawn_of(view, scene.at(None)))


def test_a_client_moves_one_object_and_not_the_other(session: Session, files: list[Path]) -> None:
    scene = still(*files)
    start, lens = before(scene, lens_for(*SIZE, scene.parts.values()), *SIZE)
    sent = Placement("statue", Pose((0.25, 0.5, 2.0), (0.0, 0.5, 0.0, 0.75**0.5)), 0.5)
    session.send_camera(start)
    session.send_object(sent.pose, "statue", sent.scale)
    room = Placement("default", Pose((0, 0, 0), (0, 0, 0, 1)), 1.0)
    view = view_of(start, room, sent, size=SIZE, intrinsics=lens)
    fits = lambda frame: frame.placement("statue") == sent and frame.camera.pose == start  # noqa: E731
    with frame_that(session, fits) as frame:
        compare(frame, drawn_of(view, scene.at(None)))


def test_it_tells_what_the_scene_holds(session: Session, files: list[Path]) -> None:
    told = session.scene(SECONDS)
    assert [(each.id, each.name, each.gaussians) for each in told.objects] == [
        ("default", "room.ply", 1500), ("statue", "statue.ply", 700),
    ]  # fmt: skip
    for each, path in zip(told.objects, files, strict=True):
        np.testing.assert_allclose(each.bounds, read(path).gaussians.bounds)
    assert told.time_range is None


def test_a_view_begins_before_the_middle(tmp_path: Path) -> None:
    ply.write(tmp_path / "a.ply", made(500, 1))
    with (
        serving(tmp_path / "a.ply", *WHOLE, "--quiet") as server,
        connected(server) as session,
        session.next_frame(SECONDS) as frame,
    ):
        scene = still(tmp_path / "a.ply")
        start, lens = before(scene, lens_for(*SIZE, scene.parts.values()), *SIZE)
        assert frame.camera.pose == start
        compare(frame, drawn_of(view_of(start, size=SIZE, intrinsics=lens), scene.at(None)))


@pytest.mark.parametrize("place", ["given", "found"])
def test_it_begins_where_the_first_picture_was_taken(tmp_path: Path, place: str) -> None:
    file = tmp_path / "model" / "point_cloud" / "iteration_7" / "point_cloud.ply"
    file.parent.mkdir(parents=True)
    ply.write(file, made(500, 1))
    cameras = tmp_path / "other.json" if place == "given" else tmp_path / "model" / "cameras.json"
    cameras.write_text(json.dumps([CAMERA, CAMERA]))
    arguments = (file, "--cameras", cameras) if place == "given" else (tmp_path / "model",)
    with (
        serving(*arguments, *WHOLE) as server,
        connected(server) as session,
        session.next_frame(SECONDS) as frame,
    ):
        pose = frame.camera.pose
        np.testing.assert_allclose(np.abs(pose.rotation), (0, 0.2**0.5, 0, 0.8**0.5), atol=1e-12)
        assert pose.position == (0.5, -0.25, 1)
        lens = Intrinsics(50.0, 45.0, 32.0, 24.0, 0.01, lens_for(*SIZE, [read(file).gaussians]).far)
        view = view_of(pose, size=SIZE, intrinsics=lens)
        compare(frame, drawn_of(view, still(file).at(None)))
        assert session.scene(SECONDS).cameras == 2
        server.process.send_signal(signal.SIGTERM)
        assert server.process.stderr is not None
        log = server.process.stderr.read()
    where = "the view begins at (0.5, -0.25, 1), where a was taken"
    assert f"{where}: the first of 2 cameras of {cameras}" in log.splitlines()


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("frames") / "walk"
    folder.mkdir()
    for i in range(3):
        ply.write(folder / f"frame_{i + 9}.ply", made(400, 0, seed=i))
    return folder


def moving(walk: Path, rate: float) -> Scene:
    paths = [walk / f"frame_{i + 9}.ply" for i in range(3)]
    return Scene({"default": Frames(tuple(read(path).gaussians for path in paths), rate)})


def shown(frame: FrameLease, scene: Scene, time: float) -> None:
    start, lens = before(scene, lens_for(*SIZE, scene.parts.values()), *SIZE)
    assert frame.camera.pose == start
    compare(frame, drawn_of(view_of(start, size=SIZE, intrinsics=lens), scene.at(time)))


def test_a_sequence_plays_until_a_client_sets_the_time(walk: Path) -> None:
    scene = moving(walk, 20.0)
    with (
        serving(walk, *WHOLE, "--rate", "20") as server,
        connected(server) as session,
    ):
        assert session.scene(SECONDS).time_range == (0, 0.1)
        assert session.scene(SECONDS).objects[0].name == "walk"
        seen = set[object]()
        while len(seen) < 3:  # over and over: every file comes
            with session.next_frame(SECONDS) as frame:
                assert 0 <= frame.time <= 0.1
                shown(frame, scene, frame.time)
                seen.add(scene.moment(frame.time))
        for time in (0.07, 0.1, 0.0):
            session.send_time(time)
            with frame_that(session, lambda frame: frame.time == time) as frame:  # noqa: B023
                shown(frame, scene, time)
        server.process.send_signal(signal.SIGTERM)
        assert server.process.stderr is not None
        assert "default (walk): 3 files in 0.15 s, with up to 400 G" in server.process.stderr.read()


def test_gaussians_in_time_are_shown_when_a_client_asks(tmp_path: Path) -> None:
    path = written(tmp_path / "dance.ply", drawn(300))
    found = read(path)
    assert found.motion is not None
    scene = Scene({"default": Clip(found.gaussians, found.motion, 8.0)})
    with (
        serving(path, *WHOLE, "--seconds", "8") as server,
        connected(server) as session,
    ):
        assert session.scene(SECONDS).time_range == (0, 8)
        times = set[float]()
        while len(times) < 3:
            with session.next_frame(SECONDS) as frame:
                times.add(frame.time)
        for time in (2.0, 7.25):
            session.send_time(time)
            with frame_that(session, lambda frame: frame.time == time) as frame:  # noqa: B023
                shown(frame, scene, time)
        server.process.send_signal(signal.SIGTERM)
        assert server.process.stderr is not None
        assert "default (dance.ply): 8 s, with 300 Gaussians" in server.process.stderr.read()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_without_files_it_serves_the_spheres(number: int) -> None:
    with serving() as server, connected(server) as session:
        assert server.size == (320, 240)
        told = session.scene(SECONDS)
        assert [each.id for each in told.objects] == ["default", "ball"]
        server.process.send_signal(number)
        assert server.process.wait(SECONDS) == 0


def test_a_vast_scene_is_seen_to_its_end() -> None:
    assert lens_for(*SIZE, []) == field_of_view(*SIZE)
    lens = lens_for(*SIZE, [some([(0, 0, 0), (300, 0, 400)])])
    assert lens == Intrinsics(*field_of_view(*SIZE)[:4], far=2000)
