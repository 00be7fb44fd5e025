"""A view of the plugin on the stub, and what has to come of where its camera is."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_server import View

from tests.csharp.unity_stub.running import Ask, Renderer, uploaded
from tests.engines.stage import HEIGHT, WIDTH, asked
from tests.engines.stage import Answer as State

NEAR, FAR = 25, 50_000
"""Clipping planes, in centimetres."""
Vector = NDArray[np.float64]


class Eye(NamedTuple):
    """A camera in Unreal: centimetres, and degrees."""

    x: float = -400
    y: float = 50
    z: float = 125
    pitch: float = -20
    yaw: float = 35
    roll: float = 10

    @property
    def command(self) -> str:
        return "camera " + " ".join(map(str, self))

    @property
    def axes(self) -> tuple[Vector, Vector, Vector]:
        """Forward, right and up: yaw turns right, pitch up, roll tilts to the right."""
        (sp, sy, sr), (cp, cy, cr) = (f(np.radians(self[3:])) for f in (np.sin, np.cos))
        right, up = np.array([-sy, cy, 0]), np.array([-sp * cy, -sp * sy, cp])
        return np.array([cp * cy, cp * sy, sp]), cr * right - sr * up, cr * up + sr * right

    def world_to_camera(self, unit: float) -> Vector:
        """As the server has it, unit being the centimetres to one of its scene."""
        forward, right, up = (wire(each) for each in self.axes)
        rotation = np.array([right, -up, forward])
        return np.hstack([rotation, -rotation @ wire(np.array(self[:3]))[:, None] / unit])


def wire(unreal: Vector) -> Vector:
    """A direction of Unreal's world in that of the wire: x right, y down, z forward."""
    x, y, z = unreal
    return np.array([y, -z, x])


class Drawn(Renderer):
    """Draws planes that hang on the pose, and keeps what it was asked for."""

    def are_of(self, state: State, eye: Eye, unit: float = 100, near: float = NEAR) -> bool:
        """Whether an image of this camera was uploaded to the bit, through a lens of ours."""
        return (
            bool(self.views)
            and [state.get("color"), state.get("depth")] == uploaded(self.last)
            and np.allclose(state["lens"], self.last.intrinsics[:4], rtol=1e-6)
            and np.allclose(self.last.world_to_camera[:3], eye.world_to_camera(unit), atol=1e-6)
            and bool(np.isclose(self.last.intrinsics.near, near / unit))
        )


SETTING = (f"screen {WIDTH} {HEIGHT}", f"lens 60 {NEAR}", f"set FarPlane {FAR}", Eye().command)


@contextmanager
def view(driver: Path, where: dict[str, str], *first: str) -> Iterator[Ask]:
    """A view that plays, and how it is asked one command after the other."""
    with asked([str(driver)], where) as ask:
        for command in (*SETTING, *first, "begin"):
            ask(command)
        yield ask
        ask("end")


def check_drawn(state: State, view: View, unit: float) -> None:
    """A point of the world is drawn at the pixel, and at the depth, that the image has it at."""
    m00, m11, m20, m21, _ = state["projection"]
    x, y, z, w = state["rotation"]
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    fx, fy, cx, cy, *_ = view.intrinsics
    for point in np.random.default_rng(3).normal(0, 5, (20, 3)):
        across, down, depth = (view.world_to_camera @ [*point, 1])[:3]
        here = unit * np.array([point[2], point[0], -point[1]])
        forward, right, up = turn.T @ (here - np.array(state["location"]))
        np.testing.assert_allclose(forward, unit * depth, atol=1e-3)
        if abs(depth) < 0.1:
            continue
        column = (1 + (m00 * right + m20 * forward) / forward) / 2 * view.width
        row = (1 - (m11 * up + m21 * forward) / forward) / 2 * view.height
        there: Any = (fx * across / depth + cx, fy * down / depth + cy)
        np.testing.assert_allclose((column, row), there, atol=1e-3)
