"""The harness's side of the device: files, handles, and what is left behind."""

import sys

import pytest

if sys.platform != "linux":
    pytest.skip("the stand-in CUDA runtime runs on Linux", allow_module_level=True)

from splatbus_conformance.images.memory.cuda_stand_in.device import (
    HANDLE_BYTES,
    PROGRESS,
    StandInDevice,
)


@pytest.fixture
def device() -> StandInDevice:
    return StandInDevice()


def test_memory_is_poison_until_written_and_after(device: StandInDevice) -> None:
    memory = device.allocate(10)
    memory.write(2, b"abc")
    assert device.read(memory.handle, 0, 10) == b"\xff\xffabc" + 5 * b"\xff"
    memory.poison()
    assert device.read(memory.handle, 0, 10) == 10 * b"\xff"
    memory.free()
    memory.free()
    with pytest.raises(ValueError, match="was freed"):
        device.read(memory.handle, 0, 1)
    device.close()


def test_writing_beyond_memory_is_refused(device: StandInDevice) -> None:
    memory = device.allocate(10)
    for offset in (-1, 8, 1 << 40):
        with pytest.raises(ValueError, match="of 10"):
            memory.write(offset, b"abc")
    device.close()


def test_handles_are_64_bytes_and_differ(device: StandInDevice) -> None:
    handles = {device.allocate(1).handle, device.allocate(1).handle, device.event().handle}
    assert {len(handle) for handle in handles} == {HANDLE_BYTES}
    assert len(handles) == 3
    with pytest.raises(ValueError, match="no handle of memory"):
        device.read(device.event().handle, 0, 1)
    device.close()


def test_an_event_counts_its_records(device: StandInDevice) -> None:
    event = device.event()
    path = next(device.folder.glob("event-*"))
    counts = [PROGRESS.unpack(path.read_bytes())]
    for step in (event.begin, event.complete, event.begin):
        step()
        counts.append(PROGRESS.unpack(path.read_bytes()))
    assert counts == [(0, 0), (1, 0), (1, 1), (2, 1)]
    device.close()


def test_nothing_is_left_when_it_is_closed(device: StandInDevice) -> None:
    device.allocate(1)
    device.event()
    device.close()
    assert not device.folder.exists()
