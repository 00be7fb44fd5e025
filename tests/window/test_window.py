"""The window on a virtual display: what it shows, what hands do, a server that goes and comes."""

import math
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from splatbus_wire.settings import Settings

from tests.window.stage import SIZE, Staged, demo, opened

import glfw  # isort: skip - after the bundle, whose library it takes
from imgui_bundle import imgui  # isort: skip
from splatbus_viewer.window.cameras import turned  # isort: skip
from splatbus_viewer.window.choices import RING, ring_before  # isort: skip
from splatbus_viewer.window.conversation import REST_SECONDS  # isort: skip
from splatbus_viewer.window.figures import Course  # isort: skip
from splatbus_viewer.window.panels.figures import summary  # isort: skip
from splatbus_viewer.window.screen import Screen  # isort: skip

STORED = Path(__file__).parent / "data"
TOLERANCE, SHARE = 24, 0.002
"""Levels of 255 by which a pixel may differ, and how many may by more: edges of another Mesa."""


def pixels(staged: Staged) -> np.ndarray:
    """(H, W, 3) of the image's part of the window, top row first."""
    left, bottom, width, height = staged.window.region()
    top = staged.screen.size[1] - bottom - height
    whole = np.asarray(staged.window.whole(), np.int16)
    return whole[top : top + height, left : left + width]


def loaded(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image, np.int16)


def compare(found: np.ndarray, name: str) -> None:
    """With the stored picture of that name, within the tolerance."""
    path = STORED / f"{name}.png"
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        Image.fromarray(found.astype(np.uint8)).save(path, optimize=True)
        pytest.fail(f"{path.name} was not stored yet: look at it")
    stored = loaded(path)
    assert found.shape == stored.shape
    apart = (np.abs(found - stored).max(axis=-1) > TOLERANCE).mean()
    assert apart <= SHARE, f"{apart:.2%} of the pixels differ"


@pytest.mark.parametrize("mode", ["color", "depth", "normals", "composite"])
def test_each_mode_shows_what_is_stored_of_it(server: Settings, mode: str) -> None:
    with opened(server, (480, 320), mode=mode, grid=1.0, shows_panels=False) as staged:
        staged.rests()
        compare(pixels(staged), mode)


def test_depth_is_not_copied_where_nobody_looks_at_it(server: Settings) -> None:
    with opened(server, (480, 320), mode="color", shows_panels=False) as staged:
        staged.rests()
        taken = staged.window.picture.taken
        assert taken is not None
        assert taken.channels == {"color"}
        assert taken.copied == 16 * 480 * 320
        staged.press(glfw.KEY_2)
        staged.until(lambda: len((staged.window.picture.taken or taken).channels) == 2)


@pytest.mark.parametrize("kind", ["orbit", "fly", "first-person"])
def test_hands_move_the_camera_and_images_follow(server: Settings, kind: str) -> None:
    with opened(server, kind=kind) as staged:
        window = staged.window
        staged.rests()
        before, first = window.choices.eye, pixels(staged)
        staged.drag(120, -40)
        staged.rests()
        camera = window.picture.taken.camera  # type: ignore[union-attr]
        assert camera is not None
        eye = window.choices.eye
        assert camera.pose == eye.pose != before.pose
        if kind == "orbit":
            assert np.allclose(eye.pivot, before.pivot, atol=1e-9)
        else:
            assert eye.pose.position == before.pose.position
        assert (np.abs(pixels(staged) - first).max(axis=-1) > TOLERANCE).mean() > 0.1
        place = eye.pose.position
        staged.hold(glfw.KEY_W, lambda: math.dist(window.choices.eye.pose.position, place) > 0.3)
        staged.rests()
        assert window.picture.taken.camera.pose == window.choices.eye.pose  # type: ignore[union-attr]
        assert window.conversation.images.latency.newest > 0  # type: ignore[operator]


def test_nothing_is_steered_until_somebody_does_and_then_what_was_chosen(server: Settings) -> None:
    with opened(server) as staged:
        window, choices = staged.window, staged.window.choices
        staged.rests()
        left, top, *_ = window.area
        staged.drag(30, 30, (left / 2, top + 300))  # over a panel
        assert not choices.is_steering
        sent = [each.payload for each in window.look.packets.newest if each.way == "sent"]
        assert not [each for each in sent if b'"camera_pose"' in each]
        staged.drag(150, 60)
        staged.rests()
        moved = choices.eye.pose
        staged.press(glfw.KEY_N)
        staged.rests()
        assert choices.eye.pose != moved
        assert window.look.own["camera index"] == 1
        before = pixels(staged)
        choices.ring, choices.held = ring_before(choices.eye), RING
        staged.turns(2)
        assert (np.abs(pixels(staged) - before).max(axis=-1) > TOLERANCE).mean() > 0.02
        choices.is_playing = True
        staged.until(lambda: window.look.own.get("image time", 0.0) > 0.5)


def test_a_window_that_is_minimised_asks_for_no_size_of_its_own(
    server: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    with opened(server, mode="color", shows_panels=False) as staged:
        staged.rests()
        sizes = [
            each for each in staged.window.look.packets.newest if b"set_viewport" in each.payload
        ]
        drawn = staged.window.drawn
        with monkeypatch.context() as patch:
            patch.setattr(Screen, "size", (0, 0))
            staged.window.choices.moved_to(turned(staged.window.choices.eye, "fly", 0.2, 0.0))
            later = time.monotonic() + 3 * REST_SECONDS
            staged.until(
                lambda: time.monotonic() > later and staged.window.conversation.is_answered
            )
            asked = [
                each
                for each in staged.window.look.packets.newest
                if b"set_viewport" in each.payload
            ]
            assert asked == sizes
            assert staged.window.drawn == drawn
        staged.rests()
        assert staged.window.picture.size == SIZE


def test_the_title_of_a_plot_is_short() -> None:
    course = Course("ms")
    for wait in (2.34, 2.34, 1018.1):
        course.add(0.0, wait)
    assert summary(course, "round trip") == "round trip: 2.3, p99 998 ms###round trip"


def test_panels_leave_their_part_and_give_it_back(server: Settings) -> None:
    whole = 1280, 800  # as the command opens it
    with opened(server, whole) as staged:
        staged.rests()
        width, height = staged.window.picture.size
        assert width < 0.8 * whole[0]
        assert height < 0.8 * whole[1]
        for name in ("View", "Scene"):
            assert imgui.internal.find_window_by_name(name).scroll_max.y == 0, "nothing is cut off"
        staged.press(glfw.KEY_TAB)
        staged.until(lambda: staged.window.picture.size == whole)


def test_a_server_that_goes_and_comes_back_is_seen_again(screen: None) -> None:
    with ExitStack() as first:
        where = first.enter_context(demo())
        with opened(where) as staged:
            window, status = staged.window, lambda: staged.window.look.session.status
            staged.rests()
            staged.drag(80, 0)
            staged.rests()
            moved, bright = window.choices.eye.pose, pixels(staged)[0].mean()
            first.close()
            staged.until(lambda: "Start one with: splatbus-server" in (window.look.trouble or ""))
            assert not status().ipc.connected
            assert pixels(staged)[0].mean() < 0.5 * bright, "above the notice, too"
            with demo(where.ipc_port, where.message_port):
                staged.until(lambda: status().ipc.connections == 2 and window.look.trouble is None)
                staged.rests()
                camera = window.picture.taken.camera  # type: ignore[union-attr]
                assert camera is not None
                assert camera.pose == moved


def test_a_held_object_is_moved_by_its_handles(server: Settings) -> None:
    with opened(server) as staged:
        window = staged.window
        staged.rests()
        window.choices.held = "default"
        staged.turns(3)
        middle = (0.2, -0.3, 4.35)  # of the bounds that the server tells
        camera = window.picture.taken.camera  # type: ignore[union-attr]
        assert camera is not None
        x = camera.fx * middle[0] / middle[2] + camera.cx - camera.width / 2
        y = camera.fy * middle[1] / middle[2] + camera.cy - camera.height / 2
        left, top, width, height = window.area
        staged.drag(60, 0, (left + width / 2 + x, top + height / 2 + y))
        staged.rests()
        put = window.choices.objects["default"]
        assert put.pose.position[0] > 0.1
        assert not window.choices.is_steering
        (seen,) = window.picture.taken.objects  # type: ignore[union-attr]
        assert (seen.object, seen.pose) == (put.object, put.pose)


def test_panels_show_figures_of_the_server_only_while_they_are_seen(server: Settings) -> None:
    with opened(server) as staged:
        staged.rests()
        talk = staged.window.conversation
        staged.until(lambda: "render_ms" in talk.telemetries.courses)
        staged.until(lambda: talk.round_trip.newest is not None)
        imgui.set_window_focus("Packets")
        packets = staged.window.look.packets
        staged.until(
            lambda: (
                b'"names":[]'
                in [p.payload for p in packets.newest if b"subscribe_tele" in p.payload][-1]
            )
        )


def test_a_key_takes_a_picture_of_the_image_alone(
    server: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with opened(server) as staged:
        staged.rests()
        for _ in range(2):
            staged.press(glfw.KEY_P)
        shown = pixels(staged)
    for name in ("splatbus-0001.png", "splatbus-0002.png"):
        assert (loaded(tmp_path / name) == shown).all()


def test_the_command_writes_a_picture_and_ends(server: Settings, tmp_path: Path) -> None:
    path = tmp_path / "it.png"
    ports = ["--ipc-port", str(server.ipc_port), "--msg-port", str(server.message_port)]
    line = [sys.executable, "-m", "splatbus_viewer", "window", *ports, "--bare", "--timeout", "100"]
    line += ["--size", "400x300", "--screenshot", str(path)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, f"{path}\n"), done.stderr
    with Image.open(path) as image:
        assert image.size == (400, 300)


def test_the_command_gives_up_and_says_why(screen: None, tmp_path: Path) -> None:
    line = [sys.executable, "-m", "splatbus_viewer", "window", "--ipc-port", "1", "--msg-port", "2"]
    line += ["--screenshot", str(tmp_path / "it.png"), "--timeout", "0.2"]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert "no image came in time" in done.stderr
    assert "Start one with: splatbus-server" in done.stderr


def test_without_a_display_it_says_what_to_do() -> None:
    environment = {"PATH": "/usr/bin:/bin", "DISPLAY": "", "WAYLAND_DISPLAY": ""}
    line = [sys.executable, "-m", "splatbus_viewer", "window"]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, env=environment)
    assert done.returncode == 1
    assert "there is no display" in done.stderr
    assert "splatbus-client view" in done.stderr
