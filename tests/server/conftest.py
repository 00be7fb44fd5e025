from __future__ import annotations

import math
import threading
from collections.abc import Iterator

import numpy as np
import pytest
import splatbus_server
from splatbus_server import logs

from tests.server.stage import Stage

CAMERAS = [
    splatbus_server.Pose((float(index), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for index in range(3)
]
SIZE = (16, 8)


def paint(bus: splatbus_server.Bus, stop: threading.Event) -> None:
    """Renders colour |x| mod 1 and depth |x| + 1, where x is the camera's."""
    while not stop.is_set():
        view = bus.next_view(0.05)
        if view is not None:
            x = abs(view.poses.camera.position[0])
            color = np.full((view.height, view.width, 3), x % 1.0, np.float32)
            depth = np.full((view.height, view.width), x + 1.0, np.float32)
            bus.publish(view, color, depth if view.wants_depth else None)


@pytest.fixture
def bus() -> Iterator[splatbus_server.Bus]:
    """A server that renders, on ports of its own."""
    stop = threading.Event()
    with splatbus_server.serve(*SIZE, cameras=CAMERAS, ipc_port=0, message_port=0) as serving:
        renderer = threading.Thread(target=paint, args=(serving, stop))
        renderer.start()
        yield serving
        stop.set()
        renderer.join(10)
    assert not renderer.is_alive()


@pytest.fixture(autouse=True)
def whole_log(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many lines of a kind there are."""
    monkeypatch.setattr(logs, "LINES_A_SECOND", math.inf)


@pytest.fixture
def stage() -> Stage:
    """A session without sockets."""
    return Stage()
