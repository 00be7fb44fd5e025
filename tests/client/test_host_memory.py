"""Shared memory: opened for reading only, measured before it is touched, never removed."""

import os
import subprocess
import sys

import numpy as np
import pytest
from splatbus_client.host_memory import CannotOpenError, HostImages
from splatbus_wire.init_packet import parse_init_packet

from tests.peers.fake_server import HEIGHT, SIZE, WIDTH, cuda_init_packet, init_packet

RING = init_packet()["ring"]
linux = pytest.mark.skipif(sys.platform != "linux", reason="named objects of /dev/shm")


def open_images(name, size=SIZE, **members):
    return HostImages(parse_init_packet(init_packet(name, size=size, **members)))


def test_each_slot_has_its_own_image_top_row_first(memory):
    for slot in range(RING["slots"]):
        color = np.full((HEIGHT, WIDTH, 4), slot, np.float32)
        color[0, -1] = 10 + slot
        memory.write(slot, color, color[..., 0] + 0.5)
    images = open_images(memory.name)
    for slot in range(RING["slots"]):
        assert images.color(slot)[0, -1, 0] == 10 + slot
        assert images.color(slot)[1, 0, 0] == slot
        assert images.depth(slot)[0, -1] == 10.5 + slot
    assert images.close()


def test_arrays_are_views_of_what_the_server_writes(memory):
    images = open_images(memory.name)
    color = images.color(1)
    assert not color.any()
    memory.write(1, np.ones((HEIGHT, WIDTH, 4)), np.ones((HEIGHT, WIDTH)))
    assert color.all()
    assert not color.flags.writeable


def test_memory_is_not_unmapped_under_an_array(memory):
    images = open_images(memory.name)
    depth = images.depth(0)
    assert not images.close()
    assert not depth.any()
    del depth
    assert images.close()


def test_memory_may_be_longer_than_announced(memory):
    os.truncate(memory.path, 1 << 16)
    assert open_images(memory.name).close()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"size": SIZE + 1}, "MEM-6"),
        ({"ring": RING | {"slots": 4}}, "MEM-10"),
        ({"ring": RING | {"depthOffset": 2**52}}, "MEM-10"),
        ({"ring": RING | {"depthOffset": 16}}, "MEM-9"),
    ],
)
def test_memory_that_does_not_fit_is_refused(memory, change, message):
    with pytest.raises(CannotOpenError, match=message):
        open_images(memory.name, **change)


def test_memory_that_is_missing_is_refused_by_name():
    with pytest.raises(CannotOpenError, match="client-test-none"):
        open_images("client-test-none")


@linux
def test_what_is_no_memory_is_refused_without_waiting(memory):
    memory.remove()
    os.mkfifo(memory.path)
    with pytest.raises(CannotOpenError, match="no regular file"):
        open_images(memory.name)


@linux
def test_a_link_is_not_followed(memory, tmp_path):
    memory.remove()
    target = tmp_path / "secret"
    target.write_bytes(bytes(SIZE))
    memory.path.symlink_to(target)
    with pytest.raises(CannotOpenError):
        open_images(memory.name)


def test_cuda_memory_is_refused():
    with pytest.raises(CannotOpenError, match="no CUDA support"):
        HostImages(parse_init_packet(cuda_init_packet()))


@linux
@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_memory_outlives_a_reader_that_exits(memory, platform):
    program = f"""if True:
        import sys
        sys.platform = {platform!r}
        from splatbus_client.host_memory import HostImages
        from splatbus_wire.init_packet import parse_init_packet
        images = HostImages(parse_init_packet({init_packet(memory.name)!r}))
        sys.exit(int(images.color(0).sum()))
    """
    assert subprocess.run([sys.executable, "-c", program], check=False, timeout=60).returncode == 0
    assert memory.path.stat().st_size == SIZE
