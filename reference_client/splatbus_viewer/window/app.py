"""The window of `splatbus-client window`: takes what comes, draws it, tells what the user does."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from imgui_bundle import imgui
from PIL import Image
from splatbus_client.loop import clock
from splatbus_client.session import Session
from splatbus_client.status import why_no_frame
from splatbus_wire.messages import FrameCamera
from splatbus_wire.settings import Settings

from splatbus_viewer.display import range_of
from splatbus_viewer.window import MODES, hands, panels
from splatbus_viewer.window.choices import Choices, assumed_camera
from splatbus_viewer.window.conversation import Conversation
from splatbus_viewer.window.drawing.picture import Picture, Region, fitted
from splatbus_viewer.window.packets import Packets
from splatbus_viewer.window.panels.layout import Area, hold
from splatbus_viewer.window.screen import SETTLING_SECONDS, Screen, wake

_REFRESH_SECONDS = 0.1
"""Plots and lists go on by themselves as often."""
_LONGEST_WAIT = 0.25
_MOVING_SECONDS = 1 / 60
_FIT_SECONDS = 0.5
_BACKGROUND = (0.11, 0.12, 0.13, 1.0)


def show(where: Settings, options: argparse.Namespace) -> int:
    """Show a window until it is closed, or its one screenshot is taken; returns the exit status."""
    choices = Choices(options.mode, options.camera, shows_panels=not options.bare)
    with opened(where, options.size, choices) as window:
        end = clock() + options.timeout
        while not window.screen.is_closing:
            window.turn()
            if options.screenshot is None:
                continue
            if window.is_settled:
                window.whole().save(options.screenshot)
                print(options.screenshot)
                return 0
            if clock() >= end:
                raise TimeoutError(f"no image came in time: {window.look.trouble}")
    return 0


@contextmanager
def opened(where: Settings, size: tuple[int, int], choices: Choices) -> Iterator[Window]:
    """A window of a size in the units of the desktop, and a session that wakes it."""
    packets = Packets(clock)

    def tap(channel: str, what: str, data: bytes) -> None:
        packets.hear(channel, what, data)
        if what == "received":
            wake()

    screen = Screen(size, f"SplatBus: {where.address()}")
    try:
        with Session(where, tap=tap) as session:
            yield Window(screen, session, where, choices, packets)
    finally:
        screen.close()


class Window:
    """One session seen through one window.

    Attributes:
        screen: where it is seen.
        picture: what draws the images.
        look: what the panels look at.
        drawn: images that were drawn, with or without a new one of the server's.
        area: what part of the window the panels leave to images.
    """

    def __init__(
        self, screen: Screen, session: Session, where: Settings, choices: Choices, packets: Packets
    ) -> None:
        self.picture = Picture(screen.context)
        self.choices, self.conversation = choices, Conversation(session)
        self.look = panels.Look(session, choices, self.conversation, packets, self._shoot)
        self.drawn = 0
        self.screen, self._session, self._where = screen, session, where
        self.area: Area = (0.0, 0.0, 1.0, 1.0)
        self._drawn_at = self._fitted_at = 0.0
        self._is_moving = self._shoots = False
        self._generation = 0

    def turn(self) -> None:
        """Take what came and what the user did, and draw if anything is to be seen of it."""
        now = clock()
        self.screen.wait(self._patience(now), now)
        now = clock()
        has_image = self._take()
        taken, is_seen = self.picture.taken, all(self.screen.size)
        self.conversation.follow(
            self.choices,
            taken and taken.camera,
            self.region()[2:] if is_seen else (0, 0),  # minimised, it is of no size
            now,
            wants_telemetry="Figures" in self.look.own.get("visible", ()),
        )
        self.conversation.images.rests(now)
        if is_seen and (has_image or now >= self._due()):
            self._draw(now)
            self.screen.show()
            if has_image:
                assert taken is not None
                images = self.conversation.images
                images.shown(self._generation, taken.seq, taken.camera, taken.copied, clock())

    @property
    def is_settled(self) -> bool:
        """Whether there is an image, of the size that the window has for it or may ask for."""
        fits = self.region()[2:] == self.picture.size
        return self.picture.taken is not None and (fits or self.conversation.keeps_size)

    def region(self) -> Region:
        """Where in the window images go, in pixels from its lower left corner."""
        left, top, width, height = (self.screen.scale * number for number in self.area)
        bottom = self.screen.size[1] - top - height
        return round(left), round(bottom), max(round(width), 1), max(round(height), 1)

    def whole(self) -> Image.Image:
        """Return all of the window as it was drawn last, panels included."""
        self._draw(clock())
        return self._pixels((0, 0, *self.screen.size))

    def _take(self) -> bool:
        try:
            lease = self._session.next_frame(0.0)
        except TimeoutError:
            return False
        with lease:
            self.picture.take(lease)
            is_whole = lease.intact
            self._look_for_pivot()
            self.look.own["objects"] = lease.objects
            if not math.isnan(lease.time):
                self.look.own["image time"] = lease.time
        images = self._session.images
        self._generation = images.generation if images is not None else self._generation
        return is_whole

    def _look_for_pivot(self) -> None:
        """Have the camera move about what is in the middle, until it is moved."""
        taken = self.picture.taken
        if taken and taken.camera and not self.choices.is_steering and "depth" in taken.channels:
            depths = self.picture.probe(taken.camera)
            middle = float(depths[depths.shape[0] // 2, depths.shape[1] // 2])
            if middle > 0.0:
                self.choices.eye = self.choices.eye._replace(distance=middle)

    def _patience(self, now: float) -> float:
        if self._is_moving or self.choices.is_playing:
            return max(0.0, min(self._drawn_at + _MOVING_SECONDS - now, _MOVING_SECONDS))
        return max(0.0, min(self._due() - now, _LONGEST_WAIT))

    def _due(self) -> float:
        """When the interface has to be drawn again though no image comes."""
        touched = self.screen.touched_at
        if self._drawn_at <= touched + SETTLING_SECONDS:
            return self._drawn_at + _MOVING_SECONDS
        return self._drawn_at + (_REFRESH_SECONDS if self.choices.shows_panels else _LONGEST_WAIT)

    def _draw(self, now: float) -> None:
        screen, look, choices = self.screen, self.look, self.choices
        taken, camera = self.picture.taken, None
        if taken is not None:
            camera = taken.camera or assumed_camera(choices.eye.pose, self.picture.size)
        look.seconds = min(now - self._drawn_at, _LONGEST_WAIT)
        look.now, look.camera, look.size = now, camera, self.picture.size
        look.trouble = self._trouble()
        rests = self._drawn_at > self.screen.touched_at + SETTLING_SECONDS and not self._is_moving
        has_interface = choices.shows_panels or look.trouble is not None or not rests
        self._drawn_at = now
        self.drawn += 1
        if has_interface:
            self._describe(look)
        if camera is None or fitted(self.region(), look.size) != (0, 0, *screen.size):
            screen.context.screen.use()
            screen.context.viewport = 0, 0, *screen.size
            screen.context.clear(*_BACKGROUND)
        if camera is not None:
            self._image(camera, now)
        if self._shoots:
            self._save()
        if has_interface:
            screen.end()

    def _describe(self, look: panels.Look) -> None:
        """Describe the interface, and take what hands do, which it is told of."""
        self.screen.begin()
        self._keys()
        self.area = panels.describe(look)
        if look.camera is not None:
            self._hold(look)
        self._is_moving = hands.steer(self.choices, look.seconds)
        self.screen.describe_end()

    def _image(self, camera: FrameCamera, now: float) -> None:
        choices = self.choices
        if choices.mode == "depth" and choices.is_fitting and now >= self._fitted_at + _FIT_SECONDS:
            self._fitted_at, choices.depths = now, range_of(self.picture.probe(camera))
        region = fitted(self.region(), self.picture.size)
        screen = self.screen.context.screen
        self.picture.draw(screen, region, choices.mode, camera, choices.ground, choices.depths)

    def _hold(self, look: panels.Look) -> None:
        scale = self.screen.scale
        left, bottom, width, height = fitted(self.region(), self.picture.size)
        top = self.screen.size[1] - bottom - height
        hold(look, (left / scale, top / scale, width / scale, height / scale))

    def _trouble(self) -> str | None:
        status = self._session.status
        is_there = self._session.images is not None
        if is_there and self.picture.taken is not None:
            return None
        return why_no_frame(status, self._where, announced=is_there)

    def _keys(self) -> None:
        keys, choices = imgui.Key, self.choices
        for key, mode in zip((keys._1, keys._2, keys._3, keys._4), MODES):
            if hands.pressed(key):
                choices.mode = mode
        if hands.pressed(keys.tab):
            choices.shows_panels = not choices.shows_panels
        if hands.pressed(keys.p):
            self._shoots = True
        step = hands.pressed(keys.n) - hands.pressed(keys.b)
        if step:
            index: int = self.look.own.get("camera index", 0) + step
            scene = self.conversation.scene
            self.look.own["camera index"] = (
                index % scene.cameras if scene and scene.cameras else index
            )
            self.conversation.jump(index)

    def _shoot(self) -> None:
        self._shoots = True

    def _save(self) -> None:
        """Save the image alone, as it was just drawn, under the next free name."""
        self._shoots = False
        if self.picture.taken is None:
            return
        numbers = (f"splatbus-{number:04}.png" for number in range(1, 10000))
        path = next(Path(name) for name in numbers if not Path(name).exists())
        self._pixels(fitted(self.region(), self.picture.size)).save(path)
        self.look.saved = str(path)

    def _pixels(self, region: Region) -> Image.Image:
        data: Any = self.screen.context.screen.read(viewport=region, components=3, alignment=1)
        image = Image.frombytes("RGB", region[2:], data)
        return image.transpose(Image.Transpose.FLIP_TOP_BOTTOM)
