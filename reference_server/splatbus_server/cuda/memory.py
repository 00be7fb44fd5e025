"""One generation of memory on a GPU: an allocation, an event a slot, and the init packet.

Nothing here waits for the GPU but its end. A frame is one kernel on the caller's stream and the
record of its slot's event behind it; who reads the slot waits for that event, on the GPU.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Set
from typing import Any

from splatbus_schemas import LIMITS
from splatbus_wire.init_packet import (
    VERSION,
    CudaMemory,
    InitPacket,
    LegacyBuffers,
    host_ring,
)
from splatbus_wire.semantics import Semantics

from splatbus_server.cuda.arrays import handle
from splatbus_server.cuda.driver import (
    Device,
    api,
    call,
    event_handle,
    interprocess_event,
    memory_handle,
)
from splatbus_server.cuda.kernels import Compiler
from splatbus_server.cuda.launching import Launch, current_context
from splatbus_server.cuda.source import Layout, Source, source
from splatbus_server.ring import Ring
from splatbus_server.source import DepthKind

_MOST_LAUNCHES = 1024
"""Prepared and kept; more are of arrays that never lie alike."""
_INFINITY = 0x7F800000
_BLOCK = 2 << 20
"""Bytes. The driver cuts what is smaller out of blocks of this size, and a handle opens all of its
block, neighbours and all [CUD-1]."""


class DeviceMemory:
    """Slots for images of one size, and the legacy slot behind them, in one allocation [CUD-1].

    Attributes:
        kind: the capability that a client needs.
        generation: number of this memory, greater than that of the one before.
        width: pixels.
        height: pixels.
        ring: who may touch which slot.
        init_packet: what a client needs to open it.
    """

    kind = "cuda_ipc"

    def __init__(
        self,
        width: int,
        height: int,
        readers: int,
        semantics: Semantics,
        device: Device,
        compiler: Compiler | None = None,
        generation: int = 1,
    ) -> None:
        """Allocates 20 bytes a pixel for each slot: readers and three.

        Args:
            width: pixels, 1 to 32,768 [INI-2].
            height: pixels, the same.
            readers: how many clients may hold an image at a time.
            semantics: of what will be published.
            device: on which.
            compiler: of the kernels for this device, if there is one already.
            generation: of this memory.

        Raises:
            ValueError: a size is out of its range.
            CudaError: there is no room, or the platform shares no memory.
        """
        largest = LIMITS["max_image_size"]
        if not (1 <= width <= largest and 1 <= height <= largest):
            raise ValueError(f"an image of {width}×{height} pixels is not from 1 to {largest}")
        self.generation, self.width, self.height = generation, width, height
        self.ring = Ring(readers)
        self._readers, self._semantics = readers, semantics
        self._device = device
        self._compiler = compiler or Compiler(device.capability)
        layout, legacy_color = host_ring(width, height, self.ring.slots)
        legacy_depth = legacy_color + layout.color_stride
        size = legacy_depth + layout.depth_stride
        allocated = math.ceil(size / _BLOCK) * _BLOCK
        with device.current():
            self._pointer = call(api.cuMemAlloc, allocated)
            base = int(self._pointer)
            self._events = [interprocess_event() for _ in range(self.ring.slots + 1)]
            # What this process had there before is nobody's business, so nobody is told of the
            # memory before that is done [MEM-16]; on a stream that waits for no renderer's.
            stream = call(api.cuStreamCreate, api.CUstream_flags.CU_STREAM_NON_BLOCKING)
            call(api.cuMemsetD8Async, self._pointer, 0, allocated, stream)
            call(api.cuMemsetD32Async, base + legacy_depth, _INFINITY, width * height, stream)
            for event in self._events:
                call(api.cuEventRecord, event, stream)
            call(api.cuStreamSynchronize, stream)
            call(api.cuStreamDestroy, stream)
            shared = memory_handle(self._pointer)
            *events, legacy_event = map(event_handle, self._events)
        legacy = LegacyBuffers(
            shared, shared, legacy_event, legacy_color, legacy_depth, device.ordinal
        )
        memory = CudaMemory(device.uuid, shared, size)
        layout = layout._replace(events=tuple(events))
        self.init_packet = InitPacket(
            width, height, legacy, VERSION, generation, memory, layout, semantics
        )
        self._places = [
            (
                base + layout.color_offset + slot * layout.color_stride,
                base + layout.depth_offset + slot * layout.depth_stride,
            )
            for slot in range(layout.slots)
        ]
        self._places.append((base + legacy_color, base + legacy_depth))
        self._wrote: list[int | None] = [None] * len(self._places)  # stream that wrote there last
        self._in_use: dict[int, list[Any]] = {}  # owners of what a slot's kernel may still read
        self._launches: dict[tuple[str, Layout, int, int], Launch] = {}
        self._context = int(device.context)

    def successor(self, width: int, height: int) -> DeviceMemory:
        """Memory for images of another size, the next generation; errors as at first."""
        return DeviceMemory(
            width,
            height,
            self._readers,
            self._semantics,
            self._device,
            self._compiler,
            self.generation + 1,
        )

    def writer(
        self, color: Any, depth: Any, alpha: Any, depth_kind: DepthKind, stream: Any
    ) -> Callable[[int, Set[str]], None]:
        """What writes the wanted channels of an image into a slot, on the stream.

        Returns once the GPU has been told; never waits for it.

        Raises:
            ValueError: as `source` says.
            CudaError: the kernels cannot be compiled.
        """
        found = source(
            color,
            depth,
            alpha,
            depth_kind,
            None if stream is None else handle(stream),
            width=self.width,
            height=self.height,
            premultiplied=self._semantics.alpha == "premultiplied",
            device=self._device.ordinal,
        )
        return lambda slot, wants: self._write(slot, found, wants)

    def _write(self, slot: int, image: Source, wants: Set[str]) -> None:
        layout, pointers, stream, owners = image
        foreign = current_context() != self._context
        if foreign:
            call(api.cuCtxPushCurrent, self._device.context)
        try:
            if "depth" not in wants or not pointers[1]:
                kernel = "color_only"
            else:
                kernel = "color_depth" if "color" in wants else "depth_only"
            self._launch(kernel, slot, layout, pointers, stream)
            if "legacy" in wants:
                self._launch("legacy", len(self._places) - 1, layout, pointers, stream)
            if self._in_use:
                self._let_go()
            if owners:
                self._in_use[slot] = owners
        finally:
            if foreign:
                call(api.cuCtxPopCurrent)

    def _launch(
        self, kernel: str, slot: int, layout: Layout, pointers: tuple[int, int, int], stream: int
    ) -> None:
        """Fills a slot and records its event behind that [IMG-7, BUF-10]."""
        launch = self._launches.get((kernel, layout, slot, stream))
        if launch is None:
            launch = self._prepared(kernel, layout, slot, stream)
        if self._wrote[slot] != stream:  # what another stream still writes there comes first
            call(api.cuStreamWaitEvent, stream, self._events[slot], 0)
            self._wrote[slot] = stream
        launch(*pointers)

    def _prepared(self, kernel: str, layout: Layout, slot: int, stream: int) -> Launch:
        if len(self._launches) == _MOST_LAUNCHES:
            self._launches.clear()
        launch = self._launches[kernel, layout, slot, stream] = Launch(
            int(getattr(self._compiler.kernels(layout.format), kernel)),
            layout,
            self._places[slot],
            (self.width, self.height),
            math.inf if kernel == "legacy" else self._semantics.depth_empty,
            stream,
            int(self._events[slot]),
        )
        return launch

    def _let_go(self) -> None:
        """Lets go of what kernels have read that are done by now."""
        for slot in list(self._in_use):
            if not api.cuEventQuery(self._events[slot])[0]:
                del self._in_use[slot]

    def taken(self) -> str:
        """Nothing: memory on a GPU is its owner's."""
        return ""

    def free_bytes(self) -> int:
        """How much more memory the GPU has."""
        with self._device.current():
            free, _ = call(api.cuMemGetInfo)
        return int(free)

    def close(self) -> None:
        """Frees the memory, once what writes it is done; once is enough."""
        if not self._events:
            return
        with self._device.current():
            for event in self._events:
                call(api.cuEventSynchronize, event)
            call(api.cuMemFree, self._pointer)
            for event in self._events:
                call(api.cuEventDestroy, event)
        self._events = []
        self._in_use = {}
