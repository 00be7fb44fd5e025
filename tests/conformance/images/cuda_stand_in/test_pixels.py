"""A client of CUDA memory, unmodified, over real sockets: what it reads, pixel by pixel."""

import sys
from pathlib import Path

import numpy as np
import pytest
from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage, PlaneOffsets
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.trials.testee.process import Launched
from splatbus_conformance.wire.sockets import Peer

from tests.conformance.images.cuda_stand_in.library import stand_in

MINIATURE = Path(__file__).parents[2] / "miniatures" / "cuda_client.py"
PIXEL_FLOATS = {"Color": 4, "Depth": 1}


def as_shown(image: DeviceImage, what: str) -> bytes:
    """A plane as it was drawn, the top row first."""
    rows = np.frombuffer(image.drawn[what], "<f4").reshape(image.height, -1)
    return rows[::-1].tobytes()


def was_read(image: DeviceImage, folder: Path) -> bool:
    size = f"{image.width}x{image.height}"
    paths = {what: folder / f"{size}.{what.lower()}" for what in PIXEL_FLOATS}
    return all(p.exists() and p.read_bytes() == as_shown(image, w) for w, p in paths.items())


def heard(role: ScriptedServer) -> set[str]:
    return {it["type"] for each in role.dealings.values() for it in each.heard}


@pytest.mark.parametrize(
    ("width", "height", "layout"),
    [
        (64, 48, PlaneOffsets(0, 16 * 64 * 48, apart=False)),
        (5, 3, PlaneOffsets(1024, 0, apart=False)),
        (33, 20, PlaneOffsets(None, 4)),
    ],
)
def test_the_miniature_reads_every_pixel(
    width: int, height: int, layout: PlaneOffsets, tmp_path: Path
) -> None:
    with stand_in() as it, HostMemory(1) as memory:
        image = DeviceImage(it.device, width, height, layout)
        role = ScriptedServer(memory, width, height)
        role.speaks, role.device_packet = "1.0", image.init_packet()
        peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
        peer.on_open, peer.on_message = role.on_open, role.on_message
        peer.listen("ipc")
        peer.listen("msg")
        ports = {f"SPLATBUS_{c.upper()}_PORT": str(port) for c, port in peer.ports.items()}
        command = f'"{sys.executable}" "{MINIATURE}" "{tmp_path}"'
        testee = Launched(command, ports | it.environment())
        try:
            image.event.begin()
            testee.ensure_running()
            assert peer.until(lambda: image.opened(it.calls()), 10), testee.output()
            for number in (1, 2):
                image.draw(number)
                image.event.complete()
                assert peer.until(lambda: was_read(image, tmp_path), 10), testee.output()
                assert image.is_read_whole(it.calls(), "Color")
                assert image.is_read_whole(it.calls(), "Depth")
                image.event.begin()
            kinds = {"camera_pose", "get_viewport_size", "get_camera_pose"}
            assert peer.until(lambda: kinds <= heard(role), 10), testee.output()
        finally:
            testee.close()
            peer.close()
