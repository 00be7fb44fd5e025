"""The harness's GPU, by a driver that only pretends; a true one is in tests/gpu."""

import base64

import numpy as np
import pytest
from splatbus_conformance.cases.malformed.init_packets import changed
from splatbus_conformance.images import painted
from splatbus_conformance.images.memory.cuda_stand_in.ring import DeviceRing
from splatbus_conformance.images.memory.device import STAND_IN, why_no_device
from splatbus_conformance.images.memory.device_reading import open_on_device
from splatbus_conformance.images.memory.gpu import device as real
from splatbus_conformance.images.memory.gpu.device import GpuDevice, find
from splatbus_conformance.images.memory.gpu.driver import CudaError, Driver
from splatbus_conformance.images.memory.reading import CannotOpen
from splatbus_conformance.images.painted import coordinates

from tests.conformance.images.fake_cuda import FakeCuda


@pytest.fixture
def cuda() -> FakeCuda:
    return FakeCuda()


@pytest.fixture
def device(cuda: FakeCuda) -> GpuDevice:
    return GpuDevice(Driver(cuda))


@pytest.fixture
def neighbour(cuda: FakeCuda) -> GpuDevice:
    return GpuDevice(Driver(cuda.neighbour()))


def test_memory_is_poisoned_until_it_is_written_and_its_neighbour_reads_it(device, neighbour):
    memory = device.allocate(100)
    assert neighbour.read(memory.handle, 0, 100) == b"\xff" * 100
    memory.write(10, b"splats")
    assert neighbour.read(memory.handle, 8, 10) == b"\xff\xffsplats\xff\xff"
    with pytest.raises(ValueError, match="6 bytes at 95 of 100"):
        memory.write(95, b"splats")


def test_an_allocation_has_no_neighbour_in_what_its_handle_opens(device, cuda):
    device.allocate(100)
    (memory,) = cuda.memory.values()
    assert len(memory) == real.BLOCK_BYTES


def test_what_is_read_twice_is_opened_once_until_it_is_forgotten(device, neighbour):
    handle = device.allocate(8).handle
    for _ in range(2):
        neighbour.read(handle, 0, 8)
        neighbour.read(handle, 4, 4)
        neighbour.forget(handle)
    neighbour.forget(handle)


def test_freed_memory_is_no_memory(device, cuda):
    memory = device.allocate(8)
    memory.free()
    memory.free()
    assert not cuda.memory
    with pytest.raises(ValueError, match="cuIpcOpenMemHandle_v2: CUDA_ERROR_1"):
        GpuDevice(Driver(cuda.neighbour())).read(memory.handle, 0, 8)


def test_reads_end_where_the_memory_does(device, neighbour):
    handle = device.allocate(8).handle
    with pytest.raises(ValueError, match="ends before byte"):
        neighbour.read(handle, real.BLOCK_BYTES - 4, 8)


def test_who_reads_waits_for_the_event(device, neighbour, monkeypatch):
    monkeypatch.setattr(real, "EVENT_SECONDS", 0.05)
    memory, event = device.allocate(4), device.event()
    assert neighbour.read(memory.handle, 0, 4, event.handle)  # never recorded: nobody waits
    event.begin()
    with pytest.raises(ValueError, match="pending"):
        neighbour.read(memory.handle, 0, 4, event.handle)
    memory.write(0, b"done")
    event.complete()
    assert neighbour.read(memory.handle, 0, 4, event.handle) == b"done"
    event.begin()
    with pytest.raises(ValueError, match="pending"):
        neighbour.read(memory.handle, 0, 4, event.handle)


def test_nothing_is_freed_while_work_is_pending(device, cuda):
    memory, event = device.allocate(4), device.event()
    event.begin()
    memory.free()
    assert not cuda.freed_while_pending
    other = device.event()
    device.allocate(4)
    other.begin()
    device.close()
    device.close()
    assert not cuda.freed_while_pending
    assert [cuda.memory, cuda.events, cuda.streams, cuda.hosts, cuda.contexts] == [{}] * 4 + [[]]


def test_devices_are_known_by_their_uuid():
    device = GpuDevice(Driver(FakeCuda(2)))
    other = device.named("GPU-01010101-0101-0101-0101-010101010101")
    assert (other.ordinal, device.named(device.uuid)) == (1, device)
    with pytest.raises(ValueError, match=r"is GPU-x, and the harness sees GPU-0.*, GPU-01"):
        device.named("GPU-x")


def test_a_refused_call_is_named(device):
    with pytest.raises(CudaError, match="cuDeviceGet: CUDA_ERROR_101"):
        GpuDevice(device.driver, 3)


def test_there_is_no_device_without_a_driver(monkeypatch):
    def missing():
        raise OSError("libcuda.so.1: cannot open shared object file")

    monkeypatch.setattr(real, "load", missing)
    assert find() is None
    for devices, found in ((0, False), (1, True)):
        monkeypatch.setattr(real, "load", lambda devices=devices: FakeCuda(devices))
        assert (find() is not None) is found


def test_a_ring_is_opened_and_read_slot_by_slot(device, neighbour):
    ring = DeviceRing(device, 6, 4, 3)
    image = coordinates(7, 6, 4)
    painted.write(ring.memory, image, 2, ring.layout)
    opened = open_on_device(ring.init_packet(5), neighbour)
    assert opened.generation == 5
    np.testing.assert_array_equal(opened.color(2), image.color)
    np.testing.assert_array_equal(opened.depth(2), image.depth)
    assert np.isnan(opened.color(1)).all()
    opened.close()
    opened.close()


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"memory/deviceUuid": "GPU-1"}, "the harness sees"),
        ({"memory/handle": base64.b64encode(bytes(64)).decode()}, "cuIpcOpenMemHandle"),
        ({"memory/bytes": 1 << 30}, "ends before byte"),
        ({"ring/events": []}, "3 slots, and 0 events"),
        ({"ring/events": [base64.b64encode(bytes(64)).decode()] * 3}, "cuIpcOpenEventHandle"),
        ({"ring/events": 3}, "no handles"),
        ({"generation": 0}, "generation"),
    ],
)
def test_what_cannot_be_opened_is_said(device, neighbour, changes, why):
    packet = DeviceRing(device, 6, 4, 3).init_packet(1)
    with pytest.raises(CannotOpen, match=why):
        open_on_device(changed(packet, changes), neighbour)


def test_a_check_needs_a_device_that_the_testee_comes_to():
    assert why_no_device("GPU-1", "unseen") is None
    assert why_no_device(STAND_IN, "unseen") == "unseen"
    assert why_no_device(STAND_IN, None) is None
    assert "--stand-in-cuda" in str(why_no_device("", "unseen"))
