"""A SplatBusView on the stub, a server for it, and what has to come of both."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from splatbus_server import View
from splatbus_wire.conventions import UNITY as AXES
from splatbus_wire.poses import Pose

from tests.engines.stage import HEIGHT, WIDTH, asked, planes
from tests.engines.stage import Answer as State
from tests.waiting import eventually

IN_UNITY = "0.5 1.25 -4 0.1 0.2 0.3 0.9273618"
"""Position and rotation of a camera."""
SETTING = (f"screen {WIDTH} {HEIGHT}", "lens 60 0.25 500", f"camera {IN_UNITY}")
Ask = Callable[[str], State]


def wire_pose(unity: str, unit: float = 1) -> Pose:
    """Single precision in Unity, as a pose on the wire."""
    x, y, z, *rotation = (float(np.float32(each)) for each in unity.split())
    return AXES.to_wire(Pose((x / unit, y / unit, z / unit), tuple(rotation)))  # type: ignore[arg-type]


@contextmanager
def component(driver: Path, where: dict[str, str], *first: str) -> Iterator[Ask]:
    """A SplatBusView, enabled, and how it is asked one command after the other."""
    with asked(["mono", str(driver)], where) as ask:
        for command in (*SETTING, *first, "enable"):
            ask(command)
        yield ask
        ask("disable")


def stepped(ask: Ask, holds: Callable[[State], bool]) -> State:
    """One refresh after the other, until this holds of the state; that."""
    state: State = {}

    def hold() -> bool:
        state.update(ask("step"))
        return holds(state)

    assert eventually(hold), state
    return state


def rendered(view: View) -> tuple[Any, Any]:
    """The planes of this view."""
    return planes(view.poses.camera, view.width, view.height)


def uploaded(view: View) -> list[str]:
    """Digests of what textures of this image hold, whose first row is the bottom one."""
    return [sha256(each[::-1].tobytes()).hexdigest() for each in rendered(view)]


class Renderer:
    """Draws such planes, and keeps what it was asked for last."""

    def __init__(self) -> None:
        self.views: list[View] = []

    def __call__(self, view: View) -> tuple[Any, Any]:
        self.views.append(view)
        return rendered(view)

    @property
    def last(self) -> View:
        return self.views[-1]

    def shows(self, state: State, pose: Pose, near: float = 0.25) -> bool:
        """Whether an image of this pose was uploaded to the bit, through a lens of ours."""
        shown = [state.get("color"), state.get("depth")]
        return (
            bool(self.views)
            and (self.last.poses.camera, self.last.intrinsics.near) == (pose, near)
            and shown == uploaded(self.last)
            and np.allclose(state["_SplatBusLens"], self.last.intrinsics[:4], rtol=1e-6)
        )


def check_matrices(state: State, view: View, unit: float) -> None:
    """A point of the world is drawn at the pixel, and at the depth, that the image has it at."""
    matrix = np.reshape(state["projection"], (4, 4)) @ np.reshape(state["view"], (4, 4))
    fx, fy, cx, cy, *_ = view.intrinsics
    for point in np.random.default_rng(3).normal(0, 5, (20, 3)):
        x, y, z = (view.world_to_camera @ [*point, 1])[:3]
        across, up, _, w = matrix @ [*(unit * np.array(AXES.position_from_wire(tuple(point)))), 1]
        assert w == pytest.approx(unit * z, rel=1e-4, abs=1e-4)
        if abs(z) < 0.1:
            continue
        column, row = (1 + across / w) / 2 * view.width, (1 - up / w) / 2 * view.height
        assert (column, row) == pytest.approx(
            (fx * x / z + cx, fy * y / z + cy), rel=1e-3, abs=1e-3
        )
