"""A window on a virtual display, in this process, beside a server of its own."""

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
from splatbus_client.session import Session
from splatbus_renderer.demo import BOBBING_TIME, OBJECTS, render_until
from splatbus_wire.settings import Settings

pytest.importorskip("imgui_bundle", reason="the extra [window] is not installed")

from imgui_bundle import imgui  # noqa: E402
from splatbus_viewer.window.app import Window  # noqa: E402
from splatbus_viewer.window.choices import Choices  # noqa: E402
from splatbus_viewer.window.packets import Packets  # noqa: E402
from splatbus_viewer.window.screen import Screen, wake  # noqa: E402

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

    def press(self, key: imgui.Key) -> None:
        """Press a key, and let it go."""
        for down in (True, False):
            imgui.get_io().add_key_event(key, down)
            self._touch()

    def hold(self, key: imgui.Key, until: Callable[[], bool]) -> None:
        """Hold a key until something holds."""
        imgui.get_io().add_key_event(key, True)
        self._touch()
        self.until(until)
        imgui.get_io().add_key_event(key, False)
        self._touch()

    def drag(self, right: float, down: float, button: int = 0) -> None:
        """Drag from the middle of the image, in the units of the desktop."""
        left, top, width, height = self.window.area
        x, y = left + width / 2, top + height / 2
        io = imgui.get_io()
        io.add_mouse_pos_event(x, y)
        self._touch()
        io.add_mouse_button_event(button, True)
        self._touch()
        io.add_mouse_pos_event(x + right, y + down)
        self._touch()
        io.add_mouse_button_event(button, False)
        self._touch()

    def _touch(self) -> None:
        self.screen.touched_at = clock()
        self.turns(2)


@contextmanager
def opened(where: Settings, size: tuple[int, int] = SIZE, **chosen: object) -> Iterator[Staged]:
    """A window of this size, with these choices."""
    packets = Packets(clock)

    def tap(channel: str, what: str, data: bytes) -> None:
        packets.hear(channel, what, data)
        wake()

    screen = Screen(size, "SplatBus")
    try:
        with Session(where, tap=tap) as session:
            choices = Choices(**chosen)  # type: ignore[arg-type]
            yield Staged(Window(screen, session, where, choices, packets), screen)
    finally:
        screen.close()
