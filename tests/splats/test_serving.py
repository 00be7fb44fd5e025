"""When images are drawn, and how: in made-up time, by whatever draws; and by the processor."""

from __future__ import annotations

import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from splatbus_server.view import View
from splatbus_splats import serving
from splatbus_splats.drawing.processor import Processor
from splatbus_splats.drawing.skips import EXACT, USUAL, Skip
from splatbus_splats.scene import Frames, Scene
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

from tests.splats.shots import UNTURNED, alike, cloud, drawn, some, view_of

STILL = Scene({"default": Frames((some((0, 0, 4)),))})
WALK = Scene({"default": Frames(tuple(some((i, 0, 4)) for i in range(3)), 10.0)})
FRAME, DRAWING = 1.0 / 60.0, 0.02


class Stage:
    """Gives views at their moments, and draws: of each image when, of what time, and how."""

    milliseconds = 1e3 * DRAWING

    def __init__(self, moments: dict[float, View], seconds: float = 2.0) -> None:
        self.now, self.images = 0.0, list[tuple[float, float | None, bool]]()
        self.stop, self.told = threading.Event(), list[dict[str, Any]]()
        self._moments, self._until = sorted(moments.items()), max(moments) + seconds
        self._view: View | None = None

    def next_view(self, timeout: float, contents_changed: bool = False) -> View | None:
        assert timeout > 0.0
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

    def show(self, bus: Any, view: View, objects: Any, time: Any, *, is_moving: bool) -> bool:
        assert bus is self
        assert objects["default"] in [each.at(time or 0.0) for each in self.scene.parts.values()]
        self.images.append((self.now, time, is_moving))
        self.now += DRAWING
        return is_moving

    def telemetry(self, **readings: Any) -> None:
        self.told.append(readings)

    def monotonic(self) -> float:
        return self.now

    def run(self, monkeypatch: pytest.MonkeyPatch, scene: Scene = STILL) -> None:
        self.scene = scene
        monkeypatch.setattr(serving.time, "monotonic", self.monotonic)
        monkeypatch.setattr(self.stop, "wait", lambda seconds: False)
        serving.render_until(self.stop, self, scene, self)


def looks(count: int, step: float = FRAME) -> dict[float, View]:
    return {1.0 + i * step: view_of(Pose((0.05 * i, 0.0, 0.0), UNTURNED)) for i in range(count)}


def moved(count: int) -> dict[float, View]:
    places = [Placement("default", Pose((0.1 * i, 0.0, 0.0), UNTURNED)) for i in range(count)]
    return {1.0 + i * FRAME: view_of(IDENTITY, each) for i, each in enumerate(places)}


@pytest.mark.parametrize(
    ("moments", "rough"),
    [
        (looks(6), [False, *[True] * 5, False]),
        (looks(5, 3 * serving.REST_SECONDS), [False] * 5),
        (moved(5), [False] * 5),
    ],
    ids=["on its way, and at rest", "that jumps", "an object alone moves"],
)
def test_a_camera_is_drawn_with_fewer_pixels_while_it_moves(
    monkeypatch: pytest.MonkeyPatch, moments: dict[float, View], rough: list[bool]
) -> None:
    stage = Stage(moments)
    stage.run(monkeypatch)
    assert [is_moving for _, _, is_moving in stage.images] == rough
    if rough[1]:
        rests = stage.images[-1][0] - stage.images[-2][0]
        assert rests == pytest.approx(DRAWING + serving.REST_SECONDS, abs=0.03)
    assert {each["stage"] for each in stage.told} == {"idle", "rendering"}
    assert stage.told[-1]["render_ms"] == (pytest.approx(1e3 * DRAWING, abs=1.0), "ms")


def test_a_scene_plays_over_and_over_until_a_client_sets_the_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    held = replace(view_of(), poses=view_of().poses._replace(time=0.15))
    stage = Stage({0.0: view_of(), 1.0: held, 1.5: view_of(Pose((1, 0, 0), UNTURNED))}, 0.0)
    stage.run(monkeypatch, WALK)
    plays = [(now, time) for now, time, _ in stage.images if now < 1.0]
    assert [WALK.moment(time)[0] for _, time in plays][:9] == [0, 1, 2] * 3
    for now, time in plays:
        assert time == pytest.approx(min(now % 0.3, 0.2), abs=DRAWING)
    assert [time for now, time, _ in stage.images if now >= 1.0][:1] == [0.15]
    assert len([now for now, _, _ in stage.images if 1.0 <= now < 1.5]) == 1


@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize(("skips", "is_rough"), [(USUAL, True), (EXACT, False)])
def test_the_processor_publishes_what_the_renderer_draws(skips: Skip, is_rough: bool) -> None:
    view, scene = view_of(), {"default": cloud(500)}
    given: dict[str, Any] = {}

    class Bus:
        def publish(self, *arrays: Any, **others: Any) -> None:
            given.update(others, arrays=arrays)

    with Processor(1, skips) as processor:
        bus: Any = Bus()
        assert processor.show(bus, view, scene, 1.5, is_moving=True) is is_rough
        assert np.array_equal(given["arrays"][1], drawn(view, scene).color) is not is_rough
        assert processor.show(bus, view, scene, 1.5, is_moving=False) is False
        assert processor.milliseconds > 0.0
        color, inverse = given.pop("arrays")[1:]
        assert given == {"depth_kind": "inverse", "time": 1.5}
        alike(drawn(view, scene)._replace(color=color, inverse=inverse), drawn(view, scene))
        flat = replace(view, wants=frozenset({"color"}))
        processor.show(bus, flat, scene, None, is_moving=False)
        assert given["arrays"][2] is None


PREPARED = """
from unittest.mock import Mock
from splatbus_splats.drawing.kernels import blend, listing, project
from splatbus_splats.drawing.processor import Processor
from tests.splats.shots import cloud, view_of

loops = [each for module in (blend, listing, project) for each in vars(module).values()]
def count():
    return sum(len(getattr(each, "signatures", ())) for each in loops)

with Processor(2) as drawing:
    drawing.prepare([cloud(2000)])
    before = count()
    for is_moving in (True, False):
        drawing.show(Mock(), view_of(), {"default": cloud(2000)}, None, is_moving=is_moving)
print(before, count())
"""


@pytest.mark.usefixtures("loops")
def test_what_is_prepared_compiles_nothing_any_more() -> None:
    """In a process of its own, where nothing else has compiled what it needs."""
    command, root = [sys.executable, "-c", PREPARED], Path(__file__).parents[2]
    told = subprocess.run(command, capture_output=True, text=True, check=True, cwd=root).stdout
    before, after = map(int, told.split())
    assert before == after > 0
