"""The command as a person and as a client meet it."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import splatbus_client
from splatbus_client import Placement
from splatbus_server.view import Intrinsics, field_of_view
from splatbus_splats import cli
from splatbus_splats.beginning import reaching
from splatbus_splats.cli import main, parser
from splatbus_splats.files import container, packed, ply
from splatbus_splats.loading import loaded, scene_of, source
from splatbus_wire.poses import IDENTITY, Pose

from tests.splats.served import COMMAND, ENVIRONMENT, FREE, SECONDS, serving
from tests.splats.shots import cloud, drawn, view_of
from tests.splats.times import drawn as in_time

pytestmark = pytest.mark.usefixtures("loops")

WITHOUT_EXTRA = (
    sys.executable,
    "-c",
    "import sys; sys.modules['numba'] = None; sys.modules['llvmlite'] = None\n"
    "from splatbus_splats.cli import main; sys.exit(main())",
)
CAMERA = {
    "id": 0, "img_name": "a", "width": 1280, "height": 480, "position": [0.5, -0.25, 1],
    "rotation": [[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]], "fx": 500.0, "fy": 450.0,
}  # fmt: skip
SIZE = (64, 48)


@pytest.fixture(autouse=True)
def _signals_stay() -> Iterator[None]:
    """What `main` does with them is for a process of its own."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A model with its cameras, a statue, a dance, and numbered files."""
    folder = tmp_path_factory.mktemp("scene")
    room = replace(cloud(1501, 2), rotations=cloud(1501).rotations.copy())
    room.rotations[77] = 0
    trained = folder / "room" / "point_cloud" / "iteration_7"
    trained.mkdir(parents=True)
    ply.write(trained / "point_cloud.ply", room)
    (folder / "room" / "cameras.json").write_text(json.dumps([CAMERA, CAMERA]))
    ply.write(folder / "statue.ply", cloud(700, 0, seed=2))
    container.write(folder / "dance.ply", in_time(300))
    (folder / "walk").mkdir()
    for i in range(3):
        ply.write(folder / "walk" / f"frame_{i + 9}.ply", cloud(400, 0, seed=i))
    return [folder / name for name in ("room", "statue.ply", "dance.ply", "walk")]


def test_clients_see_what_the_renderer_draws_of_what_was_read(files: list[Path]) -> None:
    scene = scene_of(loaded([source(each) for each in files], 20.0, 8.0))
    lens = Intrinsics(50.0, 45.0, 32.0, 24.0, 0.01, field_of_view(*SIZE).far)
    options = ("--up", "z", "--size", "64x48", "--skips", "exact", "--rate", "20", "--seconds", "8")
    with (
        serving(*files, *options) as server,
        splatbus_client.connect("127.0.0.1", *server.ports) as session,
    ):
        told = session.scene(SECONDS)
        assert [(each.id, each.name, each.gaussians) for each in told.objects] == [
            ("default", "room", 1500), ("statue", "statue.ply", 700),
            ("dance", "dance.ply", 300), ("walk", "walk", 400),
        ]  # fmt: skip
        for each in told.objects:
            np.testing.assert_allclose(each.bounds, scene.parts[each.id].bounds)
        assert (told.time_range, told.cameras) == ((0, 8), 2)
        with session.next_frame(SECONDS) as frame:
            assert frame.camera.pose.position == (0.5, -0.25, 1)
            turn = np.abs(frame.camera.pose.rotation)
            np.testing.assert_allclose(turn, (0, 0.2**0.5, 0, 0.8**0.5), atol=1e-12)
        pose = Pose((0.5, -1.0, 0.25), (-0.1, 0.2, 0.0, 0.975))
        moved = Placement("statue", Pose((0.25, 0.5, 2.0), (0.0, 0.5, 0.0, 0.75**0.5)), 0.5)
        session.send_camera(pose)
        session.send_object(moved.pose, "statue", moved.scale)
        session.send_time(1.07)
        while True:
            with session.next_frame(SECONDS) as frame:
                placed = frame.placement("statue") == moved
                if frame.camera.pose == pose and placed and frame.time == 1.07:
                    color, depth = frame.color.copy(), frame.depth.copy()
                    break
        server.process.send_signal(signal.SIGTERM)
        _, log = server.process.communicate(timeout=SECONDS)
    assert server.process.returncode == 0
    places = [Placement(name, IDENTITY, 1.0) for name in scene.parts if name != "statue"]
    lens = reaching(lens, (0.5, -0.25, 1), scene.bounds)
    view = view_of(pose, *places, moved, size=SIZE, intrinsics=lens)
    right = drawn(view, scene.at(1.07))
    np.testing.assert_array_equal(color, np.clip(right.color, 0, 1))
    covered = right.color[..., 3] >= np.float32(1 / 255)
    assert covered.mean() > 0.2
    with np.errstate(all="ignore"):
        exact = np.where(covered, right.color[..., 3] / right.inverse, np.inf)
    np.testing.assert_array_equal(depth, exact)
    lines = log.splitlines()
    assert lines[0].startswith(f"reading {files[0] / 'point_cloud'}")
    assert [line.split(", ")[1] for line in lines[:6]] == [
        "file 1 of 6: 10% read", "file 2 of 6: 30% read", "file 3 of 6: 50% read",
        "file 4 of 6: 60% read", "file 5 of 6: 80% read", "file 6 of 6: 100% read",
    ]  # fmt: skip
    assert " --rate is not" not in log
    for part in (
        "default (room): 1,500 Gaussians of degree 2, from (", "; 1 left out: quaternion zero\n",
        "dance (dance.ply): 8 s, with 300 Gaussians", "stopped: Statistics(",
        "walk (walk): 3 files in 0.15 s, with up to 400 Gaussians",
        "the view begins at (0.5, -0.25, 1), where a was taken: the first of 2 cameras of "
        f"{files[0] / 'cameras.json'}\n",
        "splatbus-server: --up is not used: the view begins at a camera of",
        "\npreparing to draw: the first time",
    ):  # fmt: skip
        assert part in log
    assert "Traceback" not in log


def test_cameras_nearby_that_are_others_are_said_and_left(tmp_path: Path) -> None:
    ply.write(tmp_path / "a.ply", cloud(50, 0))
    (tmp_path / "cameras.json").write_text("{}")
    with serving(tmp_path / "a.ply", "--rate", "5", "--seconds", "2") as server:
        assert server.size == (640, 480)
        server.process.send_signal(signal.SIGINT)
        _, log = server.process.communicate(timeout=SECONDS)
    assert server.process.returncode == 0
    assert re.findall("--(.*) is not used: no", log) == ["rate", "seconds"]
    assert f"the one near the file is not used ({tmp_path / 'cameras.json'}: no list" in log
    assert re.search(r"view begins at \(.*\), with -y upwards and the middle of the", log)


def test_the_spheres_need_no_extra_and_files_say_which(files: list[Path]) -> None:
    with serving("--size", "32x24", command=WITHOUT_EXTRA) as server:
        assert server.size == (32, 24)
    done = ended(files[1], command=WITHOUT_EXTRA)
    assert done.returncode == 1
    assert done.stderr.startswith("splatbus-server: ")
    assert done.stderr.endswith("pip install 'splatbus-protocol[splats]'\n")
    assert "%" not in done.stderr  # said before anything is read


def ended(
    *words: str | Path, command: tuple[str, ...] = COMMAND
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*command, *words, *FREE], capture_output=True, text=True, env=ENVIRONMENT
    )


def test_it_can_be_stopped_while_it_reads(tmp_path: Path) -> None:
    for i in range(4):
        ply.write(tmp_path / f"{i}.ply", cloud(60_000, 3))
    with subprocess.Popen(
        [*COMMAND, tmp_path, *FREE], stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    ) as process:
        assert process.stderr is not None
        assert "10% read" in process.stderr.readline()
        process.terminate()
        log = process.stderr.read()
    assert process.returncode == 0
    assert "Traceback" not in log


@pytest.mark.parametrize(
    ("wrong", "status"), [(("--cameras", "no"), 1), (("--token-file", "no"), 2), (("no",), 1)]
)
def test_what_can_be_wrong_without_it_is_said_before_anything_is_read(
    files: list[Path], wrong: tuple[str, ...], status: int
) -> None:
    done = ended(files[1], *wrong)
    assert done.returncode == status
    assert re.fullmatch(r"splatbus-server: .*no\b.*: No such file or directory\n", done.stderr)


@pytest.mark.parametrize(
    ("cameras", "message"),
    [
        (None, "there is nothing to show: default (a.ply): 0 Gaussians of degree 0;"
               " 50 left out: position not finite"),
        ("[{}]", "cameras.json: camera 0: width is missing"),
    ],
)  # fmt: skip
def test_what_cannot_be_shown_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], cameras: str | None, message: str
) -> None:
    scene = cloud(50, 0)
    scene.means[:] = np.nan
    ply.write(tmp_path / "a.ply", scene)
    words = [str(tmp_path / "a.ply"), "--quiet", *FREE]
    if cameras is not None:
        (tmp_path / "cameras.json").write_text(cameras)
        words += ["--cameras", str(tmp_path / "cameras.json")]
    assert main(words) == 1
    assert re.fullmatch(f"splatbus-server: .*{re.escape(message)}\n", capsys.readouterr().err)


def test_a_packed_file_is_unpacked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.spz").write_bytes(b"Gaussians")
    unpack = Mock(side_effect=lambda _, __, plain: ply.write(plain, cloud(9)))
    monkeypatch.setattr(packed, "unpack", unpack)
    monkeypatch.setattr(cli, "scene_of", Mock(side_effect=ValueError("all is read")))
    assert main([str(tmp_path / "a.spz"), *FREE]) == 1
    unpack.assert_called_once()


NONE_GIVEN = "is for files of Gaussians, and none is given"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.ply", "--turntable", "20"], "--turntable is for the spheres"),
        (["a.ply", "--skips", "dim"], "argument --skips: 'dim': give names of none, exact, usual"),
        (["a.ply", "--look-at", "0,0,0,0,0,1"], "is an option of splatbus-client snapshot"),
        (["--rate", "25"], f"--rate {NONE_GIVEN}"),
        (["--seconds", "2"], f"--seconds {NONE_GIVEN}"),
        (["--cameras", "c.json"], f"--cameras {NONE_GIVEN}"),
        (["--skips", "none"], f"--skips {NONE_GIVEN}"),
        (["--cpu"], f"--cpu {NONE_GIVEN}"),
        (["a.ply"] * 257, "257 files, where there are 256"),
    ],
)
def test_wrong_usage_is_refused(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert message in capsys.readouterr().err


def test_what_stands_in_the_way_of_serving_is_said(
    files: list[Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An address that is taken is no matter of the GPU; memory that it does not share is."""
    words, taken = [str(files[1]), "--quiet"], socket.create_server(("127.0.0.1", 0))
    assert main([*words, "--host", "0.0.0.0", *FREE]) == 2
    assert "require a token" in capsys.readouterr().err
    monkeypatch.setattr(cli.gpu, "why_not", lambda: None)
    with taken:
        port = f"{taken.getsockname()[1]}"
        assert main([*words, "--ipc-port", port, "--msg-port", "0"]) == 1
    assert "another program listens there" in capsys.readouterr().err
    monkeypatch.setattr(cli, "serve", Mock(side_effect=[OSError("no such memory"), "a bus"]))
    options = parser().parse_args([str(files[1]), "--skips", "usual"])
    assert cli._served(options, None, scene_of({}), 32, 24)[0] == "a bus"
    assert "drawn on the processor (no such memory)" in capsys.readouterr().err
    full = type("OutOfMemoryError", (RuntimeError,), {})
    monkeypatch.setattr(cli, "_serve", Mock(side_effect=full("CUDA out of memory")))
    assert main(words) == 1
    assert "memory of the GPU is full: --cpu" in capsys.readouterr().err
