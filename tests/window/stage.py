"""A window on a virtual display, in this process, beside a server of its own."""

import ctypes
import os
import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import pytest
import splatbus_server
from splatbus_client.loop import clock
from splatbus_renderer.demo import BOBBING_TIME, OBJECTS, render_until
from splatbus_wire.settings import Settings

pytest.importorskip("imgui_bundle", reason="the extra [window] is not installed")

from imgui_bundle import imgui

import glfw  # isort: skip
from splatbus_viewer.window import app
from splatbus_viewer.window.app import Window
from splatbus_viewer.window.choices import Choices
from splatbus_viewer.window.screen import Screen

LIMIT_SECONDS = 120.0
SIZE = 960, 640


@contextmanager
def display() -> Iterator[None]:
    """A display that nobody sees, in `DISPLAY`, with OpenGL in software."""
    if not shutil.which("Xvfb"):
        pytest.skip("Xvfb is not installed (Debian: xvfb libgl1-mesa-dri)")
    read, write = os.pipe()
    line = [
        "Xvfb",
        "-displayfd",
        str(write),
        "-screen",
        "0",
        "1920x1200x24",
        "-noreset",
        "-nolisten",
        "tcp",
    ]
    before = os.environ.get("DISPLAY")
    with subprocess.Popen(line, pass_fds=(write,), stderr=subprocess.DEVNULL) as server:
        os.close(write)
        with os.fdopen(read) as told:
            os.environ["DISPLAY"] = f":{told.readline().strip()}"
        try:
            yield
        finally:
            server.terminate()
            os.environ.pop("DISPLAY")
            if before is not None:
                os.environ["DISPLAY"] = before


@contextmanager
def demo(ipc_port: int = 0, message_port: int = 0) -> Iterator[Settings]:
    """The scene of `splatbus-server`."""
    done = threading.Event()
    with splatbus_server.serve(
        *(320, 240),
        objects=OBJECTS,
        time_range=BOBBING_TIME,
        ipc_port=ipc_port,
        message_port=message_port,
    ) as bus:
        thread = threading.Thread(target=render_until, args=(done, bus))
        thread.start()
        try:
            yield Settings("127.0.0.1", bus.address.ipc_port, bus.address.message_port, None)
        finally:
            done.set()
            thread.join()


@dataclass
class Staged:
    """A window, and the hands at it."""

    window: Window
    screen: Screen

    def until(self, holds: Callable[[], bool]) -> None:
        """Let it go on until something holds; the limit is for what never does."""
        end = time.monotonic() + LIMIT_SECONDS
        while not holds():
            assert time.monotonic() < end, "it never came to that"
            self.window.turn()

    def turns(self, count: int) -> None:
        """Let it draw so many times."""
        wanted = self.window.drawn + count
        self.until(lambda: self.window.drawn >= wanted)

    def rests(self) -> None:
        """Let it show what it asked for last: an image in its size, from where it was sent."""
        window = self.window
        self.turns(4)  # panels are laid out, and what was typed has come
        self.until(lambda: window.is_settled and window.conversation.is_answered)
        self.turns(1)

    def press(self, key: int) -> None:
        """Press a key, by GLFW's number, and let it go."""
        for action in (glfw.PRESS, glfw.RELEASE):
            self._key(key, action)

    def hold(self, key: int, until: Callable[[], bool]) -> None:
        """Hold a key until something holds."""
        self._key(key, glfw.PRESS)
        self.until(until)
        self._key(key, glfw.RELEASE)

    def drag(self, right: float, down: float, at: tuple[float, float] | None = None) -> None:
        """Drag from a place, or the middle of the image, in the units of the desktop."""
        left, top, width, height = self.window.area
        x, y = at or (left + width / 2, top + height / 2)
        backend = imgui.backends
        backend.glfw_cursor_enter_callback(self._address, True)
        backend.glfw_cursor_pos_callback(self._address, x, y)
        self._touch()
        backend.glfw_mouse_button_callback(self._address, glfw.MOUSE_BUTTON_LEFT, glfw.PRESS, 0)
        self._touch()
        backend.glfw_cursor_pos_callback(self._address, x + right, y + down)
        self._touch()
        backend.glfw_mouse_button_callback(self._address, glfw.MOUSE_BUTTON_LEFT, glfw.RELEASE, 0)
        self._touch()

    @property
    def _address(self) -> int:
        return ctypes.cast(self.screen._window, ctypes.c_void_p).value or 0

    def _key(self, key: int, action: int) -> None:
        imgui.backends.glfw_key_callback(self._address, key, 0, action, 0)
        self._touch()

    def _touch(self) -> None:
        self.screen.touched_at = clock()
        self.turns(2)


@contextmanager
def opened(where: Settings, size: tuple[int, int] = SIZE, **chosen: object) -> Iterator[Staged]:
    """A window of this size, with these choices."""
    with app.opened(where, size, Choices(**chosen)) as window:  # type: ignore[arg-type]
        yield Staged(window, window.screen)
