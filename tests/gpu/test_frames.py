"""Frames from a server to clients in other processes, over real CUDA handles."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import splatbus_server

from tests.gpu import require_gpu

require_gpu()

from splatbus_server.cuda.driver import Device  # noqa: E402

from tests.gpu.images import BOTH, OnDevice  # noqa: E402
from tests.peers.raw_client import RawClient, hello  # noqa: E402

SIZE = (64, 48)
ROOT = Path(__file__).parents[2]


class Renderer:
    """Serves an image whose corners differ; each view has a number, which is its time."""

    def __init__(self, **options: Any) -> None:
        self.bus = splatbus_server.serve(
            *SIZE, memory="cuda_ipc", ipc_port=0, message_port=0, **options
        )
        self.wanted: list[frozenset[str]] = []
        self._device = Device(options.get("device", 0))
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        with self._device.current():
            while not self._stop.is_set():
                view = self.bus.next_view(0.05, contents_changed=True)
                if view is not None:
                    self.wanted.append(view.wants)
                    color, depth = picture(view.width, view.height)
                    self.bus.publish(
                        view, OnDevice(color), OnDevice(depth), time=float(len(self.wanted))
                    )

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_: Any) -> None:
        self._stop.set()
        self._thread.join()
        self.bus.close()


def picture(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Red grows to the right, green downwards; depth is 1 to 2, and empty in the last corner."""
    down, right = np.mgrid[0 : 1 : height * 1j, 0 : 1 : width * 1j]
    color = np.stack([right, down, np.full_like(right, 0.5), np.ones_like(right)], -1)
    depth = 1.0 + right
    depth[-1, -1] = 0.0
    return color.astype(np.float32), depth.astype(np.float32)


CORNERS = {
    "color": [[0, 0, 0.5, 1], [1, 0, 0.5, 1], [0, 1, 0.5, 1], [1, 1, 0.5, 1]],
    "depth": [1.0, 2.0, 1.0, math.inf],
}


@contextmanager
def reader(what: str, bus: Any, **environment: str) -> Iterator[subprocess.Popen[str]]:
    ports = map(str, bus.address[1:])
    command = [sys.executable, "-m", "tests.gpu.reader", what, *ports]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, text=True, env=os.environ | environment
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def answer(what: str, bus: Any, **environment: str) -> Any:
    with reader(what, bus, **environment) as process:
        assert process.stdout
        return json.loads(process.stdout.readline() or "null")


def test_another_process_reads_the_frame_on_its_host():
    with Renderer() as renderer:
        found = answer("host", renderer.bus)
    assert {name: found[name] for name in CORNERS} == CORNERS
    assert found["intact"]
    assert found["time"] > 0


def test_another_process_reads_the_frame_where_it_lies():
    pytest.importorskip("torch")
    pytest.importorskip("cupy")
    with Renderer() as renderer:
        found = answer("device", renderer.bus)
    assert found == CORNERS | {"same": True}


def test_release_waits_for_reads_on_the_gpu():
    pytest.importorskip("torch")
    with Renderer() as renderer:
        assert answer("slow", renderer.bus) == {"before": False, "after": True}


def test_a_client_of_1_0_reads_the_legacy_slot():
    with Renderer() as renderer:
        found = answer("legacy", renderer.bus)
        assert found == CORNERS | {"same": True}
        assert any("legacy" in wants for wants in renderer.wanted)


def test_no_legacy_slot_is_written_while_nobody_looks_at_it():
    with Renderer() as renderer, reader("resized", renderer.bus):
        deadline = time.monotonic() + 20
        while renderer.wanted[-1:] != [BOTH] and time.monotonic() < deadline:
            time.sleep(0.01)
        assert renderer.wanted[-1] == BOTH


def test_another_size_is_read_and_the_old_memory_freed():
    with Renderer() as renderer, reader("resized", renderer.bus) as process:
        assert process.stdout
        assert json.loads(process.stdout.readline()) == [48, 64, 4]
        renderer.bus.resize(32, 16)
        assert json.loads(process.stdout.readline()) == [16, 32, 4]
        assert json.loads(process.stdout.readline()) == [[48, 64, 4], [16, 32, 4]]
        assert not renderer.bus._exchange.replaced


def test_a_client_asks_for_another_size():
    """[VPT-2, VPT-5, VPT-7]: memory of a GPU is had in another thread than the render loop."""
    request = {"type": "set_viewport", "width": 32, "height": 16, "id": 1}
    with (
        Renderer() as renderer,
        reader("resized", renderer.bus) as process,
        RawClient(renderer.bus.address.message_port) as client,
    ):
        assert process.stdout
        assert json.loads(process.stdout.readline()) == [48, 64, 4]
        client.ask(hello("viewport"))
        reply = client.ask(request)
        assert reply == {"type": "viewport_size", "id": 1, "viewport_size": [32, 16]}
        assert json.loads(process.stdout.readline()) == [16, 32, 4]
        assert json.loads(process.stdout.readline()) == [[48, 64, 4], [16, 32, 4]]
        assert not renderer.bus._exchange.replaced
        error = client.ask(request | {"width": 32_768, "height": 32_768})
        assert error is not None
        assert error["code"] == "unsupported"
        assert client.viewport() == [32, 16]


def test_the_device_is_found_by_its_uuid_whatever_its_number_is_here():
    try:
        Device(1)
    except OSError:
        pytest.skip("needs two GPUs")
    with Renderer(device=1) as renderer:
        found = answer("host", renderer.bus, CUDA_VISIBLE_DEVICES="1,0")
        assert found["color"] == CORNERS["color"]
        found = answer("host", renderer.bus, CUDA_VISIBLE_DEVICES="1")
        assert found["color"] == CORNERS["color"]


def test_two_clients_read_at_a_time():
    with Renderer() as renderer, reader("host", renderer.bus) as one:
        found = answer("host", renderer.bus)
        assert one.stdout
        assert json.loads(one.stdout.readline())["color"] == found["color"] == CORNERS["color"]
