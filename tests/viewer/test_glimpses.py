"""Buffers of 1.0, looked at now and then: with memory that only pretends to be on a GPU."""

import math
import threading

import numpy as np
import pytest
from splatbus_client import reading
from splatbus_client.events import Look
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_viewer.info import describe
from splatbus_viewer.mirror import Mirror
from splatbus_viewer.snapshot import snapshot
from splatbus_wire.init_packet import LegacyBuffers
from splatbus_wire.messages import Hello, Program
from splatbus_wire.semantics import Semantics

from tests.peers.fake_server import HEIGHT, WIDTH, cuda_init_packet, image, init_packet

HANDLE = bytes(64)


class Buffers:
    """What `cuda.legacy.LegacyImages` is, with a new image each time it is looked at."""

    def __init__(self, packet):
        self.generation, self.semantics = packet.generation or 0, Semantics()
        self.size = packet.width, packet.height
        self.looks = 0
        self.closed = False

    def color(self, slot):
        self.looks += 1
        return image(self.looks)[0]

    def depth(self, slot):
        return image(self.looks)[1]

    def on_host(self, name, slot, array):
        return array

    def copied(self, name, slot, array):
        return array.copy()

    def lost(self):
        return None

    def finish(self, slot):
        pass

    def close(self):
        self.closed = True
        return True


@pytest.fixture
def opened(monkeypatch):
    opened = []

    def open_it(packet, capabilities):
        opened.append(Buffers(packet))
        return opened[-1]

    monkeypatch.setattr(reading, "_opened", open_it)
    return opened


def test_a_server_of_1_0_is_looked_at_again_and_again(server, session, opened):
    ipc = server.ipc()
    ipc.receive()
    ipc.send(cuda_init_packet())
    for number in (1, 2, 3):
        with session.next_frame(5) as lease:
            assert lease.seq == number
            np.testing.assert_array_equal(lease.color, image(number)[0])
            np.testing.assert_array_equal(lease.depth, image(number)[1])
            assert (lease.has_camera, lease.objects) == (False, ())
            assert math.isnan(lease.time)
            with pytest.raises(RuntimeError, match=r"speaks 1\.0"):
                _ = lease.camera
    assert session.images[:3] == (0, WIDTH, HEIGHT)
    ipc.close()
    server.ipc()
    assert opened[0].closed


def test_it_is_looked_at_only_while_somebody_reads(server, session, opened):
    ipc = server.ipc()
    ipc.receive()
    ipc.send(cuda_init_packet())
    session.next_frame(5).release()
    assert opened[0].looks == 1


def test_a_mirror_keeps_what_it_saw(server, session, opened):
    ipc = server.ipc()
    ipc.receive()
    ipc.send(cuda_init_packet())
    mirror = Mirror(session)
    mirror.read(5)
    assert mirror.newest.camera is None
    np.testing.assert_array_equal(mirror.newest.color, image(1)[0])


def test_a_snapshot_needs_to_know_the_camera(server, session, opened, tmp_path):
    ipc = server.ipc()
    ipc.receive()
    ipc.send(cuda_init_packet())
    with pytest.raises(TimeoutError, match="does not say what camera"):
        snapshot(session, tmp_path / "out.png", None, 5)


def test_its_images_are_described_as_far_as_they_are_known(server, session, opened):
    ipc, message = server.ipc(), server.message()
    ipc.receive()
    ipc.send(cuda_init_packet())
    message.receive_type("get_viewport_size")
    message.send({"viewport_size": [WIDTH, HEIGHT]})
    player = threading.Thread(
        target=lambda: (
            message.receive_type("get_viewport_size"),
            message.send({"viewport_size": [WIDTH, HEIGHT]}),
        )
    )
    player.start()
    lines = list(describe(session, 10))
    player.join()
    assert f"{WIDTH}x{HEIGHT}, of which 1.0 tells neither camera nor time" in lines[-1]


def test_a_server_of_1_1_without_frames_is_answered_and_looked_at(server, session, opened):
    ipc = server.ipc_1_1("cuda_ipc", "reinit")
    packet = init_packet("", 7) | cuda_init_packet()
    uuid = "GPU-00000000-0000-4000-8000-000000000000"
    packet["memory"] = {"kind": "cuda_ipc", "deviceUuid": uuid, "bytes": 1 << 20}
    packet["memory"]["handle"] = packet["mem_color"]
    del packet["ring"]
    ipc.send(packet)
    assert ipc.receive() == {"type": "opened", "generation": 7}
    with session.next_frame(5) as lease:
        assert not lease.has_camera
    ipc.send(cuda_init_packet(version="1.1", generation=8))  # which is broken


def test_looks_come_at_a_rate():
    machine = IpcProtocol(Hello(("1.0",), Program("test", "1"), ()))
    assert machine.deadline() == math.inf
    assert machine.expire(9.0) == []
    machine.look(0.5)
    assert machine.deadline() == 0.0
    assert machine.expire(10.0) == [Look()]
    assert machine.deadline() == 10.5
    assert machine.expire(10.4) == []
    assert machine.expire(10.6) == [Look()]


@pytest.mark.parametrize(
    ("legacy", "ring", "capabilities", "expected"),
    [
        (None, True, {"frames"}, False),
        (LegacyBuffers(HANDLE, HANDLE, HANDLE), False, {"frames"}, True),
        (LegacyBuffers(HANDLE, HANDLE, HANDLE), True, {"frames"}, False),
        (LegacyBuffers(HANDLE, HANDLE, HANDLE), True, set(), True),
    ],
)
def test_the_buffers_are_looked_at_where_no_frames_are_lent(legacy, ring, capabilities, expected):
    class Packet:
        pass

    packet = Packet()
    packet.legacy, packet.ring = legacy, object() if ring else None
    assert reading._is_legacy(packet, frozenset(capabilities)) is expected
