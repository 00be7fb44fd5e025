"""One generation of memory: a segment, the ring that divides it, the packet that tells of it."""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable, Set
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from splatbus_schemas import LIMITS
from splatbus_wire.init_packet import VERSION, HostMemory, InitPacket, host_ring
from splatbus_wire.semantics import Semantics

from splatbus_server import shared_memory
from splatbus_server.logs import log
from splatbus_server.publish import Publisher
from splatbus_server.ring import Ring
from splatbus_server.source import DOUBTS, source

Pixels = NDArray[np.float32]
Writer = Callable[[int, Set[str]], None]
"""Fills a slot with what is wanted of an image: `color`, `depth`, `legacy`."""


class LostMemoryError(OSError):
    """Another program has taken the memory away, or a part of it."""


class FrameMemory(Protocol):
    """What every kind of memory has: see `Memory`, and `cuda.memory.DeviceMemory`.

    Memory of kind `cuda_ipc` has a legacy slot too, which clients without `frames` read.
    """

    generation: int
    width: int
    height: int
    ring: Ring
    init_packet: InitPacket

    @property
    def kind(self) -> str:
        """The capability that a client needs: `host_shm` or `cuda_ipc`."""

    def writer(self, color: Any, depth: Any, alpha: Any, depth_kind: Any, stream: Any) -> Writer:
        """What writes an image, as `Bus.publish` describes it, into a slot; errors as there."""

    def successor(self, width: int, height: int) -> FrameMemory:
        """Memory for images of another size, the next generation."""

    def taken(self) -> str:
        """What another program has taken of it; nothing of what is whole."""

    def free_bytes(self) -> int:
        """How much more memory of this kind there is."""

    def close(self) -> None:
        """Frees it; once is enough."""


class Memory:
    """Slots for images of one size, in memory of the host.

    Attributes:
        kind: the capability that a client needs.
        generation: number of this memory, greater than that of the one before.
        width: pixels.
        height: pixels.
        ring: who may touch which slot.
        publisher: converts images of this size.
        init_packet: what a client needs to open it.
    """

    kind = "host_shm"

    def __init__(
        self,
        width: int,
        height: int,
        readers: int,
        semantics: Semantics,
        generation: int = 1,
    ) -> None:
        """Allocates.

        Args:
            width: pixels, 1 to 32,768 [INI-2].
            height: pixels, the same.
            readers: how many clients may hold an image at a time.
            semantics: of what will be published.
            generation: of this memory.

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
        self.ring = Ring(readers)
        self._readers = readers
        self._semantics = semantics
        self._doubts = dict(DOUBTS) if generation == 1 else {}  # which are looked at once
        layout, size = host_ring(width, height, self.ring.slots)
        segment = shared_memory.create(size)
        self.taken = segment.taken
        self._remove = weakref.finalize(self, remove_if_owner, segment, os.getpid())
        # Only now: what it writes to for itself takes seconds for a size that cannot be had.
        self.publisher = Publisher(width, height, semantics.depth_empty)
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
        return Memory(width, height, self._readers, self._semantics, self.generation + 1)

    def writer(self, color: Any, depth: Any, alpha: Any, depth_kind: Any, stream: Any) -> Writer:
        """What converts an image into a slot; errors as `source` says."""
        if stream is not None:
            raise ValueError("memory of the host is written by the processor: it takes no stream")
        premultiplied = self._semantics.alpha == "premultiplied"
        image = source(color, depth, alpha, depth_kind, self.width, self.height, premultiplied)
        for name in [it for it in self._doubts if getattr(image, it) is not None]:
            if doubt := self._doubts.pop(name)(image):
                log.warning(doubt)

        def write(slot: int, wants: Set[str]) -> None:
            if taken := self.taken():
                raise LostMemoryError(taken)
            is_deep = "depth" in wants and image.depth is not None
            self.publisher.write(
                image,
                self.color(slot) if "color" in wants else None,
                self.depth(slot) if is_deep else None,
            )

        return write

    def free_bytes(self) -> int:
        """How much more shared memory there is."""
        return shared_memory.free_bytes()

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


def remove_if_owner(segment: shared_memory.Segment, owner: int) -> None:
    """Removes it from the system."""
    if os.getpid() == owner:  # a forked child ends too, and has not made it
        segment.close()


def _slots(
    memory: Pixels, offset: int, stride: int, count: int, shape: tuple[int, ...]
) -> list[Pixels]:
    """Views of the slots; offset and stride in bytes."""
    size = int(np.prod(shape))
    starts = range(offset // 4, (offset + count * stride) // 4, stride // 4)
    return [memory[start : start + size].reshape(shape) for start in starts]
