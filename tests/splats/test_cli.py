"""Files are served as they are: what a client gets is what the renderer draws of what was read."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import splatbus_client
from splatbus_client import FrameLease, Placement, Pose, Session
from splatbus_server.view import Intrinsics, View, field_of_view
from splatbus_splats.beginning import before, lens_for
from splatbus_splats.cli import main
from splatbus_splats.definition import Image, placed
from splatbus_splats.files import ply
from splatbus_splats.files.read import read
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import made
from splatbus_splats.renderer import rendered
from splatbus_splats.scene import Clip, Frames, Scene

from tests.splats.shots import some, view_of
from tests.splats.times import drawn, written

SECONDS = 60
COMMAND = [sys.executable, "-m", "splatbus_splats"]
ENVIRONMENT = {name: value for name, value in os.environ.items() if "SPLATBUS" not in name}
FREE = ("--ipc-port", "0", "--msg-port", "0")
SIZE = (64, 48)
READY = re.compile(
    r"splatbus-server ready on \S+: IPC port (\d+), message port (\d+), (\d+)x(\d+)\n"
)
CAMERA = {
    "id": 0, "img_name": "a", "width": 1280, "height": 480, "position": [0.5, -0.25, 1],
    "rotation": [[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]], "fx": 500.0, "fy": 450.0,
}  # fmt: skip


class Server(NamedTuple):
    process: subprocess.Popen[str]
    ports: tuple[int, int]
    size: tuple[int, int]


@contextmanager
def serving(*arguments: str | Path, command: list[str] = COMMAND) -> Iterator[Server]:
    with subprocess.Popen(
        [*command, *map(str, arguments), *FREE],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        match = READY.fullmatch(line)
        try:
            assert match, (line, process.stderr and process.stderr.read())
            ports, size = (int(match[1]), int(match[2])), (int(match[3]), int(match[4]))
            yield Server(process, ports, size)
        finally:
            process.kill()
            process.communicate()


@pytest.fixture(autouse=True)
def _signals_stay() -> Iterator[None]:
    """What `main` does with them is for a process of its own."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


def connected(server: Server) -> Session:
    return splatbus_client.connect("127.0.0.1", *server.ports)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("scene")
    scene = made(1501, 2)
    scene.rotations[77] = 0
    ply.write(folder / "room.ply", scene)
    ply.write(folder / "statue.ply", made(700, 0, seed=2))
    return [folder / "room.ply", folder / "statue.ply"]


@pytest.fixture(scope="module")
def server(files: list[Path]) -> Iterator[Server]:
    with serving(files[0], "--size", "64x48", files[1]) as server:
        yield server


@pytest.fixture
def session(server: Server) -> Iterator[Session]:
    with connected(server) as session:
        yield session


def still(*files: Path) -> Scene:
    names = ("default", "statue")
    return Scene({name: Frames((read(each).gaussians,)) for name, each in zip(names, files)})  # noqa: B905


def drawn_of(view: View, objects: Mapping[str, Gaussians]) -> Image:
    return rendered(placed(view, objects), view.intrinsics, view.width, view.height)


def compare(frame: FrameLease, image: Image, least: float = 0.2) -> None:
    np.testing.assert_array_equal(frame.color, np.clip(image.color, 0, 1))
    alpha = image.color[..., 3]
    covered = (alpha >= np.float32(1 / 255)) & (image.inverse > 0)
    assert covered.mean() > least
    right = np.full_like(alpha, np.inf)
    right[covered] = alpha[covered] / image.inverse[covered]
    np.testing.assert_array_equal(frame.depth, right)


@contextmanager
def frame_that(session: Session, fits: Callable[[FrameLease], bool]) -> Iterator[FrameLease]:
    while True:
        with session.next_frame(SECONDS) as frame:
            if fits(frame):
                yield frame
                return


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


def test_it_says_what_it_read_and_ends_when_it_is_told(server: Server, files: list[Path]) -> None:
    server.process.send_signal(signal.SIGINT)
    _, log = server.process.communicate(timeout=SECONDS)
    assert server.process.returncode == 0
    assert "Traceback" not in log
    assert "stopped: Statistics(" in log
    first, second, room, statue, view = log.splitlines()[:5]
    assert first == f"reading {files[0]}, file 1 of 2: 50% read"
    assert second == f"reading {files[1]}, file 2 of 2: 100% read"
    box = read(files[0]).gaussians.bounds
    assert box is not None
    low, high = (", ".join(f"{each:.4g}" for each in corner) for corner in box)
    assert room == (
        f"default (room.ply): 1,500 Gaussians of degree 2, from ({low}) to ({high})"
        "; 1 left out: quaternion zero"
    )
    assert statue.startswith("statue (statue.ply): 700 Gaussians of degree 0, from (")
    assert re.fullmatch(
        r"the view begins at \(.*\) and looks along \+z, with the middle of the scene in view:"
        r" no cameras.json is given or near the file",
        view,
    )


def test_a_view_begins_before_the_middle(tmp_path: Path) -> None:
    ply.write(tmp_path / "a.ply", made(500, 1))
    with (
        serving(tmp_path / "a.ply", "--size", "64x48", "--quiet") as server,
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
        serving(*arguments, "--size", "64x48") as server,
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


def test_cameras_nearby_that_are_others_are_said_and_left(tmp_path: Path) -> None:
    ply.write(tmp_path / "a.ply", made(50, 0))
    (tmp_path / "cameras.json").write_text("{}")
    with serving(tmp_path / "a.ply", "--size", "64x48") as server:
        server.process.send_signal(signal.SIGTERM)
        _, log = server.process.communicate(timeout=SECONDS)
    assert f"near the file is none of 3DGS ({tmp_path / 'cameras.json'}: no list" in log


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
        serving(walk, "--size", "64x48", "--rate", "20") as server,
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


def test_gaussians_in_time_are_shown_when_a_client_asks(tmp_path: Path) -> None:
    path = written(tmp_path / "dance.ply", drawn(300))
    found = read(path)
    assert found.motion is not None
    scene = Scene({"default": Clip(found.gaussians, found.motion, 8.0)})
    with (
        serving(path, "--size", "64x48", "--seconds", "8") as server,
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


WITHOUT_EXTRA = [
    sys.executable,
    "-c",
    "import sys; sys.modules['numba'] = None; sys.modules['llvmlite'] = None\n"
    "from splatbus_splats.cli import main; sys.exit(main())",
]


def test_the_spheres_need_no_extra_and_files_say_which(files: list[Path]) -> None:
    with serving("--size", "32x24", command=WITHOUT_EXTRA) as server:
        assert server.size == (32, 24)
    done = subprocess.run(
        [*WITHOUT_EXTRA, files[0]], capture_output=True, text=True, env=ENVIRONMENT
    )
    assert done.returncode == 1
    assert done.stderr.startswith("splatbus-server: ")
    assert done.stderr.endswith("pip install 'splatbus-protocol[splats]'\n")
    assert "%" not in done.stderr  # said before anything is read


def test_on_a_terminal_one_line_says_how_far_it_is(files: list[Path]) -> None:
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [*COMMAND, *files, *FREE, "--size", "64x48"],
        stdout=subprocess.PIPE,
        stderr=theirs,
        env=ENVIRONMENT,
    )
    os.close(theirs)
    assert process.stdout is not None
    assert process.stdout.readline().startswith(b"splatbus-server ready on ")
    said = os.read(ours, 1 << 16).decode()
    process.kill()
    process.communicate()
    os.close(ours)
    rewritten, _, rest = said.rpartition("\r\x1b[K")
    assert rewritten.count("\n") == 0
    assert f"\rreading {files[1]}, file 2 of 2: 100%\x1b[K" in rewritten
    assert rest.startswith("default (room.ply): 1,500 Gaussians")


def test_it_can_be_stopped_while_it_reads(tmp_path: Path) -> None:
    for i in range(4):
        ply.write(tmp_path / f"{i}.ply", made(60_000, 3))
    with subprocess.Popen(
        [*COMMAND, tmp_path, *FREE], stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    ) as process:
        assert process.stderr is not None
        assert "10% read" in process.stderr.readline()
        process.terminate()
        log = process.stderr.read()
    assert process.returncode == 0
    assert "Traceback" not in log


def test_help_teaches(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    text = capsys.readouterr().out
    assert text.startswith("usage: splatbus-server ")
    for word in (
        "examples:", "what next:", "exit codes:", "--cameras", "--token-file", "--turntable",
        "--rate", "--seconds", "SPLATBUS_TOKEN", "statue.splat", "numbered files", "320x240",
    ):  # fmt: skip
        assert word in text


def mesh(path: Path) -> None:
    path.write_bytes(
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        b"property float z\nend_header\n0 0 0\n"
    )


def compressed(path: Path) -> None:
    path.write_bytes(
        b"ply\nformat binary_little_endian 1.0\nelement chunk 1\nproperty float min_x\n"
        b"element vertex 1\nproperty uint packed_position\nend_header\n" + bytes(8)
    )


def cut(path: Path) -> None:
    ply.write(path, made(10, 0))
    path.write_bytes(path.read_bytes()[:-5])


@pytest.mark.parametrize(
    ("name", "make", "message"),
    [
        ("none.ply", None, "No such file or directory"),
        ("mesh.ply", mesh, "no property f_dc_0, .*: it is a mesh or a cloud of points"),
        ("packed.ply", compressed, "a compressed one, to be exported as a plain .ply first"),
        ("empty.ply", Path.touch, "the file is empty"),
        ("notes.ply", lambda path: path.write_text("Dear diary"), "no PLY file: its first line"),
        ("notes.txt", lambda path: path.write_text("Dear"), "ends in neither .ply nor .splat"),
        ("a.spz", Path.touch, "spz is not read: export the scene as a plain .ply first"),
        ("a.ksplat", Path.touch, "ksplat is not read: export"),
        ("a.sog", Path.touch, "sog is not read: export"),
        ("folder", Path.mkdir, "no files .* has numbered files .*, or a trained model"),
        ("cut.ply", cut, r"the file ends at byte \d+, before the last of 10 rows of vertex"),
        ("cut.splat", lambda path: path.write_bytes(bytes(33)), "at byte 32 is cut short"),
    ],
)
def test_what_is_no_splat_file_is_said(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    make: Callable[[Path], object] | None,
    message: str,
) -> None:
    path = tmp_path / name
    if make is not None:
        make(path)
    assert main([str(path), *FREE]) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"splatbus-server: {path}: ")
    assert error.count("\n") == 1
    assert re.search(message, error)


def test_cameras_that_are_none_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ply.write(tmp_path / "a.ply", made(5, 0))
    cameras = tmp_path / "other.json"
    cameras.write_text(json.dumps([{}]))
    assert main([str(tmp_path / "a.ply"), "--cameras", str(cameras), "--quiet"]) == 1
    assert capsys.readouterr().err == f"splatbus-server: {cameras}: camera 0 has no img_name\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.ply", "--size", "big"], "'big' is not a size"),
        (["a.ply", "--turntable", "20"], "--turntable is for the spheres"),
        (["a.ply", "--rate", "0"], "'0' is not a positive number"),
        (["a.ply", "--seconds", "-1"], "'-1' is not a positive number"),
        (["--rate", "25"], "--rate is for files of Gaussians, and none is given"),
        (["--seconds", "2"], "--seconds is for files of Gaussians, and none is given"),
        (["--cameras", "c.json"], "--cameras is for files of Gaussians, and none is given"),
        (["a.ply"] * 257, "257 files, where there are 256"),
    ],
)
def test_wrong_usage_is_refused(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert message in capsys.readouterr().err


def test_an_address_for_all_needs_a_token(files: list[Path]) -> None:
    command = [*COMMAND, files[1], "--host", "0.0.0.0", "--quiet", *FREE]
    done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT)
    assert done.returncode == 2
    assert "require a token" in done.stderr


def test_a_vast_scene_is_seen_to_its_end() -> None:
    assert lens_for(*SIZE, []) == field_of_view(*SIZE)
    lens = lens_for(*SIZE, [some([(0, 0, 0), (300, 0, 400)])])
    assert lens == Intrinsics(*field_of_view(*SIZE)[:4], far=2000)
