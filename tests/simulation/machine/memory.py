"""Memory for images that stands in for the host's, or a GPU's: an array for each slot.

Each image has its number in every element, and is written in two halves, so that an image that is
read while it is written can be told from one that is whole.
"""

from __future__ import annotations

import errno
from collections.abc import Set
from typing import Any

from splatbus_client.host_memory import CannotOpenError
from splatbus_server.ring import Ring
from splatbus_wire.init_packet import (
    CudaMemory,
    HostMemory,
    InitPacket,
    LegacyBuffers,
    host_ring,
)
from splatbus_wire.semantics import Semantics

from tests.simulation.machine.world import World

HALVES = 2
LEGACY = -1
"""The slot of 1.0."""


class Store:
    """All memory of a machine.

    Attributes:
        made: every memory that ever was, by name.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.made: dict[str, Memory] = {}

    @property
    def open(self) -> list[Memory]:
        """That which is not freed."""
        return [memory for memory in self.made.values() if not memory.is_freed]

    def find(self, packet: InitPacket) -> Memory:
        """What a packet announces."""
        memory = packet.memory
        if isinstance(memory, HostMemory):
            return self.made[memory.name]
        handle = memory.handle if memory is not None else packet.legacy and packet.legacy.mem_color
        assert handle is not None
        return self.made[handle.rstrip(b"\0").decode()]


class Memory:
    """One generation of a server's memory: what `splatbus_server.memory.FrameMemory` asks for.

    Attributes:
        is_freed: as far as the server goes; who has it mapped keeps it.
        slots: two halves for each of color and depth, by slot.
    """

    def __init__(
        self, store: Store, kind: str, width: int, height: int, readers: int, generation: int = 1
    ) -> None:
        if store.world.chance(0.05 if generation > 1 else 0.0):
            raise OSError(errno.ENOSPC, "no space left on device")
        self.store, self.kind = store, kind
        self.width, self.height, self.generation = width, height, generation
        self.ring = Ring(readers)
        self.readers = readers
        self.name = f"splatbus-{len(store.made)}"
        self.is_freed = False
        self.slots: dict[tuple[int, str], list[int]] = {}
        layout, size = host_ring(width, height, self.ring.slots)
        packet = InitPacket(
            *(width, height, None, "1.1", generation, HostMemory(self.name, size), layout),
            Semantics(),
        )
        if kind == "cuda_ipc":
            handle = self.name.encode().ljust(64, b"\0")
            uuid = "GPU-00000000-0000-0000-0000-000000000000"
            packet = packet._replace(
                legacy=LegacyBuffers(handle, handle, handle),
                memory=CudaMemory(uuid, handle, size),
                ring=layout._replace(events=(handle,) * layout.slots),
            )
        self.init_packet = packet
        store.made[self.name] = self
        self.is_gone = False

    def successor(self, width: int, height: int) -> Memory:
        """Memory for images of another size, the next generation."""
        return Memory(self.store, self.kind, width, height, self.readers, self.generation + 1)

    def taken(self) -> str:
        """Its name goes at times, and does not come back."""
        self.is_gone |= self.kind == "host_shm" and self.store.world.is_stolen()
        return "its name" if self.is_gone else ""

    def free_bytes(self) -> int:
        """How much more there is: enough."""
        return 1 << 40

    def writer(self, *_: Any) -> Any:
        """Is not asked for one: the renderer of the simulation writes itself."""
        raise NotImplementedError

    def close(self) -> None:
        """Frees it."""
        self.is_freed = True

    def write(self, slot: int, wants: Set[str], number: int, half: int) -> None:
        """Writes half of an image."""
        for channel in ("color", "depth"):
            if channel in wants:
                self.slots.setdefault((slot, channel), [0] * HALVES)[half] = number
        if "legacy" in wants:
            self.slots.setdefault((LEGACY, "color"), [0] * HALVES)[half] = number

    def read(self, slot: int, channel: str, half: int) -> int:
        """What half of an image holds, 0 if nothing was written there."""
        return self.slots.get((slot, channel), (0, 0))[half]


class Images:
    """Memory as a client has it mapped: what `splatbus_client.reading.Images` asks for.

    Raises:
        CannotOpenError: sometimes, for no reason.
    """

    def __init__(self, store: Store, packet: InitPacket) -> None:
        self.world = store.world
        self.memory = store.find(packet)
        if self.memory.is_gone or self.world.chance(0.03):
            raise CannotOpenError("of no reason")
        self.generation = packet.generation or 0
        self.semantics = packet.semantics or Semantics()
        self.size = packet.width, packet.height

    def lost(self) -> str | None:
        """Nobody cuts memory short here."""
        return None

    def close(self) -> bool:
        """Unmaps; not while somebody has an array of it, which is so at times."""
        return not self.world.chance(0.2)
