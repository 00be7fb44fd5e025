"""What 1.1 adds, with the reference server in another process and the scene in closed form."""

import itertools
import json
import re
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
import splatbus_client
from splatbus_client import Intrinsics, Pose, ServerRefusedError
from splatbus_client.clock import best
from splatbus_renderer import scene
from splatbus_viewer.cli import main
from splatbus_wire.messages import Histogram, Placement, Scalar, Text

from tests.closed_form import exact_pixels, matrix

WIDTH, HEIGHT = 96, 72
AHEAD = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
_POSES = itertools.count(1)
LENS = Intrinsics(120.0, 110.0, 90.0, 75.0, 2 * WIDTH, 2 * HEIGHT, 0.05, 50.0)


@contextmanager
def serving(*options):
    """Where a reference server runs: host and ports."""
    module = [sys.executable, "-m", "splatbus_renderer.cli"]
    with subprocess.Popen(
        [*module, "--ipc-port", "0", "--msg-port", "0", "--quiet", *options],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        ready = process.stdout.readline()
        found = re.search(r"on (\S+): IPC port (\d+), message port (\d+)", ready)
        yield found[1], int(found[2]), int(found[3])
        process.terminate()


@pytest.fixture(scope="module")
def server():
    with serving("--size", f"{WIDTH}x{HEIGHT}") as where:
        yield where


@pytest.fixture
def session(server):
    with splatbus_client.connect(*server) as session:
        for name in ("default", "ball"):
            session.send_object(AHEAD, name)
        session.send_camera(elsewhere(), tag="at rest")
        first_with(session, "at rest").release()
        yield session


def elsewhere():
    """A pose of which no image was made yet: one that changes nothing asks for none [IMG-10]."""
    return Pose((0.003 * next(_POSES), 0.0, 0.0), AHEAD.rotation)


def first_with(session, tag):
    """The first frame that shows what was sent with a tag, for the caller to give back."""
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        frame = session.next_frame(30)
        if frame.camera.tag == tag:
            return frame
        frame.release()
    raise TimeoutError(tag)


def scene_of(frame, degrees_per_second=0.0):
    """The closed-form scene with its objects where the frame says they were, at its time."""
    whole = scene.default_scene()
    spheres = list(whole.spheres)
    if not degrees_per_second:
        x, y, z = spheres[1].center
        bob = 0.25 * (1 - np.cos(np.pi * frame.time / 2))
        spheres[1] = replace(spheres[1], center=(x, y - bob, z))
    turn = rotation_about_y(np.radians(degrees_per_second * frame.time))
    ball = scene.Scene((spheres.pop(2),), None, whole.light, posed(frame.placement("ball"), turn))
    rest = posed(frame.placement(), turn)
    return replace(whole, spheres=tuple(spheres), pose=rest, beside=(ball,))


def posed(placement, turn):
    turned = scene.multiply(matrix(placement.pose.rotation), turn)
    return scene.ObjectPose(placement.pose.position, turned, placement.scale)


def rotation_about_y(angle):
    return matrix((0.0, np.sin(angle / 2), 0.0, np.cos(angle / 2)))


def check_pixels(frame, count=40, degrees_per_second=0.0):
    """Hold a frame against the scene as its own camera sees it, where no edge is near."""
    shown = scene_of(frame, degrees_per_second)
    for row, column, color, depth in exact_pixels(shown, frame.camera, count, frame.seq):
        np.testing.assert_allclose(frame.color[row, column], color, atol=2e-5)
        np.testing.assert_allclose(frame.depth[row, column], depth, rtol=2e-5)


def test_a_lens_is_scaled_to_the_images_and_stays_in_force(session):
    session.send_camera(elsewhere(), tag="lens", intrinsics=LENS)
    with first_with(session, "lens") as frame:
        camera = frame.camera
        assert (camera.fx, camera.fy, camera.cx, camera.cy) == (60.0, 55.0, 45.0, 37.5)
        assert (camera.near, camera.far) == (0.05, 50.0)
        check_pixels(frame)
    session.send_camera(elsewhere(), tag="moved")
    with first_with(session, "moved") as frame:
        assert frame.camera.fx == 60.0
        check_pixels(frame)
    assert session.camera(0, 10).intrinsics.width == WIDTH


def test_a_lens_of_another_shape_is_refused_and_its_pose_with_it(session):
    session.send_camera(elsewhere(), tag="square", intrinsics=LENS._replace(width=100, height=100))
    session.send_camera(elsewhere(), tag="after")
    with first_with(session, "after") as frame:
        assert frame.camera.fx != LENS.fx * WIDTH / 100
    assert "invalid_message" in session.status.message.problem


def test_moving_objects_are_where_their_frame_says(session):
    """What a bound mesh needs [OBJ-7]: the newest poses that were sent would not do."""
    stopped, lagging, moved = threading.Event(), 0, 0
    newest = {"ball": Placement("ball", AHEAD), "default": Placement("default", AHEAD)}

    def move():
        for step in itertools.count():
            if stopped.wait(0.002):
                return
            pose = Pose((0.3 * np.sin(step / 9), 0.0, 0.01 * (step % 50)), (0.0, 0.1, 0.0, 0.995))
            for name, scale in (("default", 0.8 + 0.01 * (step % 30)), ("ball", 1.2)):
                newest[name] = Placement(name, pose, scale)
                session.send_object(pose, name, scale)

    mover = threading.Thread(target=move)
    mover.start()
    try:
        for _ in range(25):
            with session.next_frame(10) as frame:
                lagging += frame.placement() != newest["default"]
                moved += frame.placement("ball").scale == 1.2
                check_pixels(frame)
    finally:
        stopped.set()
        mover.join()
    assert moved > 15
    assert lagging > 10


def test_three_clients_follow_changes_of_size_and_read_whole_images(server, session):
    sizes, problems, stopped = set(), [], threading.Event()

    def read():
        with splatbus_client.connect(*server) as other:
            try:
                while not stopped.is_set():
                    with other.next_frame(10) as frame:
                        sizes.add(frame.color.shape)
                        check_pixels(frame, 20)
            except TimeoutError:
                pass
            except AssertionError as problem:
                problems.append(problem)

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    wanted = [(64, 48), (80, 60), (32, 24), (WIDTH, HEIGHT)]
    for number, size in enumerate(wanted):
        session.send_camera(elsewhere(), tag=f"size-{number}")
        while True:
            try:
                assert session.set_viewport(*size, 10) == size
                break
            except ServerRefusedError as refused:
                if refused.error.code != "busy":  # former memory is still in use
                    raise
                time.sleep(0.1)
        deadline = time.monotonic() + 20
        while (size[1], size[0], 4) not in sizes and time.monotonic() < deadline:
            time.sleep(0.01)
    stopped.set()
    session.send_camera(elsewhere())
    for reader in readers:
        reader.join(20)
    assert not problems
    assert {(size[1], size[0], 4) for size in wanted} <= sizes
    assert (session.images.width, session.images.height) == (WIDTH, HEIGHT)


def test_control_passes_on_and_comes_back_with_a_tag(server, session):
    session.send_camera(elsewhere(), tag="first")
    first_with(session, "first").release()
    with splatbus_client.connect(*server) as other:
        other.send_camera(elsewhere(), tag="second")
        other.ping(10)
        deadline = time.monotonic() + 10
        while other.status.no_effect is None and time.monotonic() < deadline:
            time.sleep(0.01)
        assert "another client has control" in other.status.no_effect
        with pytest.raises(ServerRefusedError, match="busy"):
            other.set_viewport(64, 48, 10)
        session.close()
        first_with(other, "second").release()
        assert other.status.no_effect is None


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the processes' clocks differ")
def test_the_clock_is_known_to_within_the_round_trip(session):
    tick = best(session.ping(10) for _ in range(20))
    assert abs(tick.ahead) <= tick.error + 1e-9
    session.send_camera(elsewhere(), tag="new")
    with first_with(session, "new") as frame:
        assert tick.here(frame.rendered_at) <= time.perf_counter() + tick.error


def test_figures_of_all_kinds_come(session):
    session.subscribe_telemetry()
    session.send_camera(elsewhere())
    kinds = set()
    deadline = time.monotonic() + 20
    while kinds != {Scalar, Histogram, Text} and time.monotonic() < deadline:
        kinds |= {type(series) for series in session.next_telemetry(10).series}
    assert kinds == {Scalar, Histogram, Text}
    session.subscribe_telemetry(["stage"])
    session.ping(10)
    while True:
        if [series.name for series in session.next_telemetry(10).series] == ["stage"]:
            break


def test_the_commands_tell_of_it(server, monkeypatch, capsys):
    for name, value in zip(("HOST", "IPC_PORT", "MSG_PORT"), server, strict=True):
        monkeypatch.setenv(f"SPLATBUS_{name}", str(value))
    assert main(["telemetry", "--json", "--seconds", "1", "stage"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert {series["name"] for line in lines for series in line["series"]} == {"stage"}
    assert main(["info"]) == 0
    out = capsys.readouterr().out
    assert "ball (blue sphere): 1 Gaussians" in out
    assert "give or take" in out


@pytest.mark.parametrize("degrees_per_second", [0.0, 90.0])
def test_time_is_set_and_the_scene_moves_with_it(degrees_per_second):
    turning = ["--turntable", str(degrees_per_second)] if degrees_per_second else []
    with (
        serving("--size", f"{WIDTH}x{HEIGHT}", *turning) as where,
        splatbus_client.connect(*where) as session,
    ):
        first, last = session.scene(10).time_range
        for seconds, shown in [(1.0, 1.0), (0.25, 0.25), (last + 9, last), (first - 9, first)]:
            session.send_time(seconds)
            deadline = time.monotonic() + 10
            while time.monotonic() < deadline:
                with session.next_frame(10) as frame:
                    check_pixels(frame, degrees_per_second=degrees_per_second)
                    if frame.time == shown:
                        break
            else:
                pytest.fail(f"no image at {shown}")
