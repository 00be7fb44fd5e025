"""What `reference_server/NUMERICS.md` says of 8K."""

import mmap
import sys

import numpy as np
import pytest
from splatbus_server.memory import _slots
from splatbus_wire.init_packet import host_ring


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere untouched memory may be reserved")
def test_slots_beyond_two_and_four_thousand_million_bytes():
    """8K, eight slots: colour goes beyond 2³¹, depth beyond 2³² bytes."""
    width, height, slots = 7680, 4320, 8
    ring, size = host_ring(width, height, slots)
    assert size > 2**32
    with mmap.mmap(-1, size) as memory:
        everything = np.frombuffer(memory, np.float32)
        colors = _slots(everything, ring.color_offset, ring.color_stride, slots, (height, width, 4))
        depth = _slots(everything, ring.depth_offset, ring.depth_stride, slots, (height, width))
        assert len(colors) == len(depth) == slots
        colors[-1][-1, -1, -1] = 0.25
        depth[-1][-1, -1] = 7.0
        end_of_colors = ring.color_offset + slots * ring.color_stride
        end_of_depths = ring.depth_offset + (slots - 1) * ring.depth_stride + 4 * width * height
        found = [
            np.frombuffer(memory[end - 4 : end], "<f4")[0] for end in (end_of_colors, end_of_depths)
        ]
        del everything, colors, depth
    assert found == [0.25, 7.0]
