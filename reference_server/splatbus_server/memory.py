"""One generation of memory: a segment, the ring that divides it, the packet that tells of it."""

from __future__ import annotations

import os
import weakref

import numpy as np
from numpy.typing import NDArray
from splatbus_schemas import LIMITS
from splatbus_wire.init_packet import VERSION, HostMemory, InitPacket, Semantics, host_ring

from splatbus_server import shared_memory
from splatbus_server.publish import Publisher
from splatbus_server.ring import Ring

Pixels = NDArray[np.float32]


class Memory:
    """Slots for images of one size, in memory of the host.

    Attributes:
        generation: number of this memory, greater than that of the one before.
        width: pixels.
        height: pixels.
        ring: who may touch which slot.
        publisher: converts images of this size.
        init_packet: what a client needs to open it.
    """

    def __init__(
        self,
        width: int,
        height: int,
        readers: int,
        semantics: Semantics,
        generation: int = 1,
        last_seq: int = 0,
    ) -> None:
        """Allocates.

        Args:
            width: pixels, 1 to 32,768 [INI-2].
            height: pixels, the same.
            readers: how many clients may hold an image at a time.
            semantics: of what will be published.
            generation: of this memory.
            last_seq: number of the last image of the generation before [IMG-1].

        Raises:
            ValueError: a size is out of its range.
            OSError: there is no room.
        """
        largest = LIMITS["max_image_size"]
        if not (1 <= width <= largest and 1 <= height <= largest):
            raise ValueError(f"an image of {width}×{height} pixels is not from 1 to {largest}")
        self.generation = generation
        self.width = width
        self.height = height
        self.ring = Ring(readers, last_seq)
        self._readers = readers
        self._semantics = semantics
        self._last_seq = last_seq
        self.publisher = Publisher(width, height)
        layout, size = host_ring(width, height, self.ring.slots)
        segment = shared_memory.create(size)
        self._remove = weakref.finalize(self, _remove_if_owner, segment, os.getpid())
        memory = HostMemory(segment.name, size)
        self.init_packet = InitPacket(
            width, height, None, VERSION, generation, memory, layout, semantics
        )
        everything = np.frombuffer(segment.buffer, np.float32)
        self._colors = _slots(
            everything, layout.color_offset, layout.color_stride, layout.slots, (height, width, 4)
        )
        self._depths = _slots(
            everything, layout.depth_offset, layout.depth_stride, layout.slots, (height, width)
        )

    def successor(self, width: int, height: int) -> Memory:
        """Memory for images of another size, the next generation; errors as at first."""
        last_seq = self.ring.newest.seq if self.ring.newest else self._last_seq
        return Memory(width, height, self._readers, self._semantics, self.generation + 1, last_seq)

    def color(self, slot: int) -> Pixels:
        """(height, width, 4), bottom row first."""
        return self._colors[slot]

    def depth(self, slot: int) -> Pixels:
        """(height, width), bottom row first."""
        return self._depths[slot]

    def close(self) -> None:
        """Removes the memory from the system, as the end of the program does [OPN-9].

        Who has it mapped keeps it until it is unmapped.
        """
        self._colors.clear()
        self._depths.clear()
        self._remove()


def _remove_if_owner(segment: shared_memory.Segment, owner: int) -> None:
    if os.getpid() == owner:  # a forked child ends too, and has not made it
        segment.close()


def _slots(
    memory: Pixels, offset: int, stride: int, count: int, shape: tuple[int, ...]
) -> list[Pixels]:
    """Views of the slots; offset and stride in bytes."""
    size = int(np.prod(shape))
    starts = range(offset // 4, (offset + count * stride) // 4, stride // 4)
    return [memory[start : start + size].reshape(shape) for start in starts]
