"""What the harness paints is where it says, exact, and never taken for something else."""

import hashlib

import numpy as np
import pytest
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.images.memory.reading import Opened, RingLayout
from splatbus_conformance.images.painted import coordinates, sha256, spoilt, write
from splatbus_conformance.wire.messages import init_packet_1_1, ring_bytes

W, H, SLOTS = 7, 5, 3


@pytest.fixture
def opened():
    """The memory as somebody else reads it who knows only the init packet."""
    with HostMemory(ring_bytes(W, H, SLOTS)) as memory:
        ring = init_packet_1_1("", 1, W, H, SLOTS)["ring"]
        names = ("colorOffset", "colorStride", "depthOffset", "depthStride")
        layout = RingLayout(W, H, SLOTS, *(ring[name] for name in names), memory.size)
        yield memory, Opened(1, memory.name, layout), ring


def test_an_image_is_read_back_as_it_was_painted(opened):
    memory, reader, ring = opened
    for slot in range(SLOTS):
        write(memory, coordinates(slot, W, H), slot, ring)
    for slot in range(SLOTS):
        image = coordinates(slot, W, H)
        assert np.array_equal(reader.color(slot), image.color)
        assert np.array_equal(reader.depth(slot), image.depth)
    reader.close()


def test_every_pixel_says_where_it_lies_and_survives_nothing_else():
    image = coordinates(3, W, H)
    assert len({tuple(pixel) for pixel in image.color.reshape(-1, 4).tolist()}) == W * H
    for other in (
        image._replace(color=image.color[::-1]),
        image._replace(color=image.color[:, ::-1]),
        image._replace(color=np.floor(image.color * 255) / np.float32(255)),
        coordinates(4, W, H),
        spoilt(W, H),
    ):
        assert other.digests()[0] != image.digests()[0]


def test_images_are_what_a_server_may_store():
    image = coordinates(40000, 2048, 2)
    assert image.color.dtype == image.depth.dtype == np.float32
    assert image.color.min() >= 0
    assert image.color.max() <= 1
    assert image.depth.min() > 0
    assert np.isposinf(image.depth).any()


def test_a_digest_is_that_of_the_page():
    image = np.array([[[0.0, 0.5, 1.0, 1.0]], [[0.25, 0.0, 0.0, 0.0]]], np.float32)
    data = image.astype("<f4").tobytes()
    assert sha256(image) == hashlib.sha256(data).hexdigest()
    assert sha256(image[::-1]) == hashlib.sha256(data[16:] + data[:16]).hexdigest()
