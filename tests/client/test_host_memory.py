"""Shared memory: opened for reading only, measured before it is touched, never removed."""

import mmap
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from splatbus_client import mapping
from splatbus_client.host_memory import CannotOpenError, HostImages
from splatbus_client.mapping import MemoryLostError
from splatbus_wire.init_packet import parse_init_packet

from tests.peers.fake_server import (
    HEIGHT,
    META,
    SIZE,
    WIDTH,
    image,
    init_packet,
)

RING = init_packet()["ring"]
LARGE = {
    "size": 20 << 18,
    "meta": META | {"w": 512, "h": 512, "pitchColor": 16 << 9, "pitchDepth": 4 << 9},
    "ring": {
        "slots": 1,
        "colorOffset": 0,
        "colorStride": 16 << 18,
        "depthOffset": 16 << 18,
        "depthStride": 4 << 18,
    },
}
linux = pytest.mark.skipif(sys.platform != "linux", reason="named objects of /dev/shm")


def open_images(name, size=SIZE, **members):
    return HostImages(parse_init_packet(init_packet(name, size=size, **members)))


def test_arrays_are_views_of_what_the_server_writes_and_keep_it_mapped(memory):
    images = open_images(memory.name)
    color = images.color(1)
    assert not color.any()
    memory.write(1, np.ones((HEIGHT, WIDTH, 4)), np.ones((HEIGHT, WIDTH)))
    assert color.all()
    assert not color.flags.writeable
    assert not images.close()
    assert color.all()
    del color
    assert images.close()


@linux
def test_what_is_no_memory_is_refused_without_waiting_and_no_link_followed(memory, tmp_path):
    target = tmp_path / "secret"
    target.write_bytes(memory.path.read_bytes())
    memory.remove()
    memory.path.symlink_to(target)
    with pytest.raises(CannotOpenError):
        open_images(memory.name)
    memory.remove()
    with pytest.raises(CannotOpenError, match=f"no shared memory {memory.name}: .* one machine"):
        open_images(memory.name)
    os.mkfifo(memory.path)
    with pytest.raises(CannotOpenError, match="no regular file"):
        open_images(memory.name)
    with pytest.raises(CannotOpenError, match="semaphore"):
        open_images("sem.none")


@pytest.mark.parametrize(("ours", "opens"), [(0, True), (1, True), (2, False)])
def test_memory_of_another_user_is_opened_by_root_alone(memory, monkeypatch, ours, opens):
    user = memory.path.stat().st_uid
    monkeypatch.setattr(os, "geteuid", lambda: [0, user, user + 1][ours])
    if opens:
        assert open_images(memory.name).close()
    else:
        with pytest.raises(
            CannotOpenError,
            match=f"user {user}, and this is .*MEM-4.: client and server have to be one user",
        ):
            open_images(memory.name)


@linux
@pytest.mark.parametrize(
    ("change", "extent", "at_once"),
    [
        ({}, SIZE, True),
        ({"depthOffset": 2 * SIZE}, 2 * SIZE + SIZE // 5, False),
        ({"colorOffset": 2 * SIZE, "depthOffset": 0}, 2 * SIZE + 4 * SIZE // 5, False),
        ({"depthStride": 2 * SIZE}, SIZE * 4 // 5 + 4 * SIZE + SIZE // 15, False),
    ],
)
def test_no_more_is_mapped_than_holds_images_and_made_present_only_where_it_is_dense(
    memory, monkeypatch, change, extent, at_once
):
    size = 1 << 20
    memory.path.write_bytes(bytes(size))
    mapped = []

    class Noted(mapping.ReadableMap):
        def __new__(cls, descriptor, length, flags, protection):
            mapped.append((length, bool(flags & mmap.MAP_POPULATE)))
            return super().__new__(cls, descriptor, length, flags, protection)

    monkeypatch.setattr(mapping, "ReadableMap", Noted)
    images = open_images(memory.name, size=size, ring=RING | change)
    assert mapped == [(extent, at_once)]
    assert not images.color(RING["slots"] - 1).any()
    assert not images.depth(RING["slots"] - 1).any()
    assert images.close()


@linux
def test_pages_that_nobody_has_made_are_not_made_for_a_reader(memory):
    os.truncate(memory.path, LARGE["size"])
    images = open_images(memory.name, **LARGE)
    assert not images.copied("color", 0, images.color(0)).any()
    assert memory.path.stat().st_blocks == 0
    assert images.close()


def test_a_copy_is_the_image_and_outlives_its_memory(memory):
    color, depth = image(1)
    memory.write(2, color, depth)
    images = open_images(memory.name)
    copies = images.copied("color", 2, images.color(2)), images.copied("depth", 2, images.depth(2))
    assert images.close()
    np.testing.assert_array_equal(copies[0], color)
    np.testing.assert_array_equal(copies[1], depth)
    copies[0][:] = 0


@linux
@pytest.mark.parametrize("size", [0, 1, SIZE - 1])
def test_memory_that_was_cut_short_is_an_error_and_no_signal(memory, size):
    images = open_images(memory.name)
    assert images.lost() is None
    os.truncate(memory.path, size)
    assert f"cut to {size} bytes" in images.lost()
    with pytest.raises(MemoryLostError, match="MEM-5"):
        images.copied("depth", 2, images.depth(2))
    assert images.close()


def descriptors_of(memory):
    return sum(path.resolve() == memory.path for path in Path("/proc/self/fd").iterdir())


@linux
def test_no_descriptor_is_left(memory):
    images = open_images(memory.name)
    assert descriptors_of(memory)
    assert images.close()
    assert not descriptors_of(memory)
    images = open_images(memory.name)
    del images
    assert not descriptors_of(memory)


@linux
def test_memory_that_is_cut_again_and_again_while_it_is_copied_kills_nobody(memory):
    program = f"""if True:
        import os, sys, threading
        from splatbus_client.host_memory import HostImages
        from splatbus_client.mapping import MemoryLostError
        from splatbus_wire.init_packet import parse_init_packet
        images = HostImages(parse_init_packet({init_packet(memory.name, **LARGE)!r}))
        whole, lost, done = 0, 0, threading.Event()
        def cut():
            while not done.is_set():
                os.truncate({str(memory.path)!r}, 0)
                os.truncate({str(memory.path)!r}, {LARGE["size"]})
        thread = threading.Thread(target=cut)
        thread.start()
        while not (whole and lost):
            try:
                images.copied("color", 0, images.color(0))
                whole += 1
            except MemoryLostError:
                lost += 1
        done.set()
        thread.join()
    """
    os.truncate(memory.path, LARGE["size"])
    assert subprocess.run([sys.executable, "-c", program], check=False, timeout=60).returncode == 0


@linux
def test_memory_outlives_a_reader_that_exits_on_a_system_without_dev_shm(memory):
    program = f"""if True:
        import sys
        sys.platform = "darwin"
        from splatbus_client.host_memory import HostImages
        from splatbus_wire.init_packet import parse_init_packet
        images = HostImages(parse_init_packet({init_packet(memory.name)!r}))
        sys.exit(int(images.color(0).sum()))
    """
    assert subprocess.run([sys.executable, "-c", program], check=False, timeout=60).returncode == 0
    assert memory.path.stat().st_size == SIZE
