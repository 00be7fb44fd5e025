"""A SplatBusView on the stub, a server for it, and what has to come of both."""

import json
import os
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import splatbus_server
from splatbus_server import View
from splatbus_wire.conventions import UNITY as AXES
from splatbus_wire.poses import Pose

from tests.waiting import eventually

WIDTH, HEIGHT = 64, 48
IN_UNITY = "0.5 1.25 -4 0.1 0.2 0.3 0.9273618"
"""Position and rotation of a camera."""
State = dict[str, Any]
Ask = Callable[[str], State]


def wire_pose(unity: str, unit: float = 1) -> Pose:
    """Single precision in Unity, as a pose on the wire."""
    x, y, z, *rotation = (float(np.float32(each)) for each in unity.split())
    return AXES.to_wire(Pose((x / unit, y / unit, z / unit), tuple(rotation)))  # type: ignore[arg-type]


@contextmanager
def component(driver: Path, where: dict[str, str], *first: str) -> Iterator[Ask]:
    """A SplatBusView, enabled, and how it is asked one command after the other."""
    pipe = subprocess.PIPE
    with subprocess.Popen(
        ["mono", str(driver)], env=where, stdin=pipe, stdout=pipe, text=True
    ) as process:
        told, heard = process.stdin, process.stdout
        assert told
        assert heard

        def ask(command: str) -> State:
            told.write(command + "\n")
            told.flush()
            answer: State = json.loads(heard.readline())
            return answer

        for command in (
            f"screen {WIDTH} {HEIGHT}",
            "lens 60 0.25 500",
            f"camera {IN_UNITY}",
            *first,
            "enable",
        ):
            ask(command)
        yield ask
        ask("disable")
        told.close()


def stepped(ask: Ask, holds: Callable[[State], bool]) -> State:
    """One refresh after the other, until this holds of the state; that."""
    state: State = {}

    def hold() -> bool:
        state.update(ask("step"))
        return holds(state)

    assert eventually(hold), state
    return state


def planes(view: View) -> tuple[Any, Any]:
    """Colour and depth that are others wherever the camera's pose is."""
    pose = view.poses.camera
    noise = np.random.default_rng(abs(hash((pose.position, pose.rotation))))
    shape = (view.height, view.width)
    color = 0.5 + noise.random((*shape, 4), np.float32) / 2  # covered: no depth is left out
    return color, noise.random(shape, np.float32) + np.float32(1)


def uploaded(view: View) -> list[str]:
    """Digests of what textures of this image hold, whose first row is the bottom one."""
    return [sha256(each[::-1].tobytes()).hexdigest() for each in planes(view)]


@contextmanager
def serving(
    render: Callable[[View], Any], *, on_and_on: bool = False, **settings: Any
) -> Iterator[dict[str, str]]:
    """A server whose images these are; where its clients are to connect."""
    with splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=0, **settings) as bus:
        done = threading.Event()

        def publish() -> None:
            while not done.is_set():
                if view := bus.next_view(0.1, contents_changed=on_and_on):
                    bus.publish(view, *render(view))

        thread = threading.Thread(target=publish)
        thread.start()
        ports = {"IPC": bus.address.ipc_port, "MSG": bus.address.message_port}
        try:
            yield os.environ | {f"SPLATBUS_{name}_PORT": str(port) for name, port in ports.items()}
        finally:
            done.set()
            thread.join()


class Renderer:
    """Draws such planes, and keeps what it was asked for last."""

    def __init__(self) -> None:
        self.views: list[View] = []

    def __call__(self, view: View) -> tuple[Any, Any]:
        self.views.append(view)
        return planes(view)

    @property
    def last(self) -> View:
        return self.views[-1]

    def shows(self, state: State, pose: Pose, near: float = 0.25) -> bool:
        """Whether an image of this pose, through a lens of ours, was uploaded to the bit."""
        shown = [state.get("color"), state.get("depth")]
        return (
            bool(self.views)
            and (self.last.poses.camera, self.last.intrinsics.near) == (pose, near)
            and shown == uploaded(self.last)
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
