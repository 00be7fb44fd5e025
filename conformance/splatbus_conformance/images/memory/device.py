"""What a check needs of a device, be it the stand-in's (stand_in) or a GPU (real_device)."""

from typing import Protocol

STAND_IN = "the stand-in CUDA runtime"
NO_DEVICE = "it takes a GPU that can be used here, or --stand-in-cuda"


def why_no_device(device: str, unseen: str | None) -> str | None:
    """Why nothing can be shown on this device, or None if it can.

    Args:
        device: a GPU, `STAND_IN`, or nothing.
        unseen: why a testee is not seen at the stand-in.
    """
    return unseen if device == STAND_IN else None if device else NO_DEVICE


class Allocation(Protocol):
    """Device memory that another process opens by its handle; poisoned until it is written."""

    handle: bytes
    name: str
    """As calls of the stand-in name it."""
    size: int

    def write(self, offset: int, data: bytes) -> None:
        """Write bytes; ValueError beyond its end."""

    def poison(self) -> None:
        """Spoil all of it."""

    def free(self) -> None:
        """Spoil and free it; once is enough."""


class Event(Protocol):
    """An interprocess event: recorded and complete in one, or with time between."""

    handle: bytes
    name: str

    def begin(self) -> None:
        """Record it behind work that is not done yet: who waits now, waits for `complete`."""

    def complete(self) -> None:
        """The work before the last record is done."""

    def free(self) -> None:
        """Destroy it; once is enough."""


class Device(Protocol):
    """Where images lie that cross the wire by handles."""

    uuid: str
    """As `memory.deviceUuid` names it (MEM-2)."""
    ordinal: int
    """As `meta.device` names it."""

    def fits(self) -> float:
        """How often what is held of its memory would fit into what is free."""

    def named(self, uuid: object) -> "Device":
        """The device with this UUID; ValueError if there is none."""

    def allocate(self, size: int) -> Allocation:
        """Device memory; OSError if there is no room."""

    def event(self) -> Event:
        """An interprocess event that was never recorded: nobody waits for it."""

    def read(self, handle: bytes, offset: int, size: int, after: bytes | None = None) -> bytes:
        """Bytes of the memory that a handle names, behind the event that `after` names.

        ValueError if there is no such memory or event, or the event is not complete in time.
        """

    def forget(self, handle: bytes) -> None:
        """Let go of memory, or of an event, that was read; what is not known is no matter."""

    def close(self) -> None:
        """Free everything."""
