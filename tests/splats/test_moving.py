"""Fewer pixels while the camera moves, and all of them once it rests: in made-up time."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from splatbus_server.view import View
from splatbus_splats import serving
from splatbus_splats.drawing.definition import placed
from splatbus_splats.drawing.processor import Processor
from splatbus_splats.drawing.renderer import rendered
from splatbus_splats.drawing.skips import EXACT, USUAL, Skip
from splatbus_splats.made import made
from splatbus_splats.scene import Frames, Scene
from splatbus_wire.poses import Pose

from tests.splats.shots import HEIGHT, WIDTH, view_of

pytestmark = pytest.mark.usefixtures("loops")

ROOT = Path(__file__).parents[2]
SCENE = made(2000)
FRAME = 1.0 / 60.0


class FakeBus:
    """Gives views at their moments, and takes images.

    Attributes:
        now: seconds.
        images: what was published: when, and colour.
    """

    def __init__(self, moments: dict[float, View], until: float) -> None:
        self.now, self.images = 0.0, list[tuple[float, View, Any]]()
        self.stop = threading.Event()
        self._moments, self._until = sorted(moments.items()), until
        self._view: View | None = None

    def next_view(self, timeout: float, contents_changed: bool = False) -> View | None:
        if self._moments and self._moments[0][0] <= self.now + timeout:
            moment, self._view = self._moments.pop(0)
            self.now = max(self.now, moment)
            return self._view
        if contents_changed:
            return self._view
        self.now += timeout
        if self.now > self._until:
            self.stop.set()
        return None

    def publish(self, view: View, color: Any, *_: Any, **__: Any) -> None:
        self.images.append((self.now, view, color.copy()))
        self.now += 0.02

    def telemetry(self, **_: Any) -> None:
        pass

    def monotonic(self) -> float:
        return self.now


def served(
    monkeypatch: pytest.MonkeyPatch, moments: dict[float, View], skips: Skip = USUAL
) -> Iterator[tuple[float, bool]]:
    """When images came, and whether with all pixels."""
    bus = FakeBus(moments, max(moments) + 2.0)
    monkeypatch.setattr(serving.time, "monotonic", bus.monotonic)
    monkeypatch.setattr(bus.stop, "wait", lambda seconds: False)
    with Processor(1, skips) as processor:
        serving.render_until(bus.stop, bus, Scene({"default": Frames((SCENE,))}), processor)
    for now, view, color in bus.images:
        objects = placed(view, {"default": SCENE})
        whole = rendered(objects, view.intrinsics, WIDTH, HEIGHT)
        yield now, bool(np.array_equal(color, whole.color))


def looks(count: int, begin: float = 1.0, step: float = FRAME) -> dict[float, View]:
    turn = (0.0, 0.0, 0.0, 1.0)
    return {begin + i * step: view_of(Pose((0.05 * i, 0.0, 0.0), turn)) for i in range(count)}


def test_a_camera_on_its_way_is_drawn_with_fewer_pixels_and_at_rest_with_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    images = list(served(monkeypatch, looks(6)))
    assert [whole for _, whole in images] == [True, *[False] * 5, True]
    assert images[-1][0] - images[-2][0] == pytest.approx(0.02 + serving.REST_SECONDS, abs=0.03)


def test_a_camera_that_jumps_is_drawn_with_all_pixels_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    moments = looks(5, step=3 * serving.REST_SECONDS)
    assert [whole for _, whole in served(monkeypatch, moments)] == [True] * 5


def test_where_only_an_object_moves_all_pixels_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    moments = {1.0 + i * FRAME: view_of(intrinsics=view_of().intrinsics) for i in range(5)}
    assert [whole for _, whole in served(monkeypatch, moments)] == [True] * 5


def test_without_the_skip_all_pixels_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    assert [whole for _, whole in served(monkeypatch, looks(5), EXACT)] == [True] * 5


PREPARED = """
from splatbus_splats.drawing.kernels import blend, listing, project
from splatbus_splats.drawing.processor import Processor
from tests.splats.shots import view_of
from tests.splats.test_moving import SCENE, FakeBus

loops = [each for module in (blend, listing, project) for each in vars(module).values()]
def count():
    return sum(len(getattr(each, "signatures", ())) for each in loops)

with Processor(2) as drawing:
    drawing.prepare([SCENE])
    before = count()
    for is_moving in (True, False):
        drawing.show(FakeBus({}, 0.0), view_of(), {"default": SCENE}, None, is_moving=is_moving)
print(before, count())
"""


def test_what_is_prepared_compiles_nothing_any_more() -> None:
    """In a process of its own, where nothing else has compiled what it needs."""
    command = [sys.executable, "-c", PREPARED]
    told = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    before, after = map(int, told.split())
    assert before == after > 0
