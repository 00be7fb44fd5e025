"""The images of a server: what is mapped, what is lent, and when it is given back.

Nothing here waits or locks; the session does.
"""

from __future__ import annotations

import logging
from typing import Any, NamedTuple, Protocol

from splatbus_schemas.visible import visible
from splatbus_wire.init_packet import InitPacket
from splatbus_wire.messages import Frame, Hello
from splatbus_wire.semantics import Semantics

from splatbus_client import cuda
from splatbus_client.complaints import Complaints
from splatbus_client.events import Announced, Declined, IpcEvent, Lent, Look, Negotiated
from splatbus_client.host_memory import CannotOpenError, HostImages
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.lease import Glimpse

log = logging.getLogger("splatbus_client")

GRANTS_NOTHING = (
    "the server grants nothing that is done on the IPC channel; are the two ports swapped?"
)
LOOK_SECONDS = 1 / 60
"""Between two looks at the buffers of 1.0, which nobody announces new images in."""
CAPABILITIES = ("host_shm", "frames", "reinit", "subscribe")
"""What this client can do on the IPC channel; with a GPU, `cuda_ipc` too."""


def capabilities() -> tuple[str, ...]:
    """Return what this client can do here."""
    return CAPABILITIES + (("cuda_ipc",) if cuda.usable() else ())


class Images(Protocol):
    """What every kind of memory has: see `HostImages`, and `cuda.images.CudaImages`."""

    generation: int
    semantics: Semantics
    size: tuple[int, int]

    def color(self, slot: int) -> Any: ...  # noqa: D102
    def depth(self, slot: int) -> Any: ...  # noqa: D102
    def on_host(self, name: str, slot: int, image: Any) -> Any: ...  # noqa: D102
    def copied(self, name: str, slot: int, image: Any) -> Any: ...  # noqa: D102
    def lost(self) -> str | None: ...  # noqa: D102
    def finish(self, slot: int) -> None: ...  # noqa: D102
    def close(self) -> bool: ...  # noqa: D102


class Mapped(NamedTuple):
    """Memory, and the connection that it was announced on."""

    images: Images
    machine: IpcProtocol


class ImagesOpen(NamedTuple):
    """What the server has said of the images that are read now.

    Attributes:
        generation: number of the init packet that announced them.
        width: in pixels.
        height: in pixels.
        semantics: how their numbers are meant.
    """

    generation: int
    width: int
    height: int
    semantics: Semantics


class Loan(NamedTuple):
    """A frame that the server lends, and which of `"color"` and `"depth"` may be read of it."""

    frame: Frame | Glimpse
    channels: frozenset[str]
    mapped: Mapped


class Reading:
    """Follows the connections of the IPC channel, one after the other.

    Args:
        hello: sent on each connection.
        channels: which of `"color"` and `"depth"` are read.
    """

    def __init__(self, hello: Hello, channels: frozenset[str]) -> None:
        self.lent: Loan | None = None
        """The frame that waits to be read."""
        self.held: Loan | None = None
        """The frame that is being read."""
        self.problem: str | None = None
        """Why there are no images, where the server has announced some."""
        self._hello, self._channels = hello, channels
        self.machine: IpcProtocol | None = None
        self.mapped: Mapped | None = None
        self._retired: list[Mapped] = []
        self._complaints = Complaints(log)
        self._looks = 0

    def begin(self) -> IpcProtocol:
        """Return the machine of a new connection."""
        self.machine = IpcProtocol(self._hello, self._channels)
        return self.machine

    def handle(self, event: IpcEvent) -> None:
        """Do what an event of the connection asks for."""
        if isinstance(event, Announced):
            self.open_memory(event.packet)
        elif isinstance(event, Declined):
            self._go_without(event.reason)
        elif isinstance(event, Negotiated) and event.version != "1.0" and not event.capabilities:
            self._go_without(GRANTS_NOTHING)
        elif isinstance(event, Lent):
            self.take_frame(event.frame, event.channels)
        elif isinstance(event, Look):
            self._look()

    def end(self) -> None:
        """Regard the buffers as gone, because the connection has ended [CHN-18]."""
        self.machine = None
        self.problem = None
        self._retire()

    def hold(self) -> Loan | None:
        """Hand out the frame that is lent, see `may_hold`; None if its memory is lost."""
        assert self.lent is not None
        if self.lost(self.lent):
            return None
        self.held, self.lent = self.lent, None
        return self.held

    def give_back(self, loan: Loan) -> None:
        """Release the frame that was handed out; reads of it have finished [IMG-13]."""
        self.held = None
        _release(loan)
        self.lost(loan)
        self.sweep()

    def lasts(self, loan: Loan) -> bool:
        """Whether connection and memory that the frame was lent on and in are still there."""
        return loan.mapped.machine is self.machine and loan.mapped.images.lost() is None

    def lost(self, loan: Loan) -> bool:
        """Whether a frame's memory is there no longer; if so, go without it (1.1 chapter 4)."""
        reason = loan.mapped.images.lost()
        if reason is not None and loan.mapped is self.mapped:
            loan.mapped.machine.give_up(loan.mapped.images.generation, reason)
            self._go_without(reason)
        return reason is not None

    def subscribe(self, channels: frozenset[str]) -> None:
        """Read only these channels, on this connection and those to come."""
        self._channels = channels
        if self.machine is not None:
            self.machine.subscribe(channels)

    def sweep(self) -> None:
        """Unmap retired memory that nobody reads any more, and tell the server so [OPN-5]."""
        self._retired = [mapped for mapped in self._retired if not self._unmap(mapped)]

    @property
    def may_hold(self) -> bool:
        """Whether a frame waits to be read, and none is being read."""
        return self.lent is not None and self.held is None

    @property
    def open(self) -> bool:
        """Whether there is memory to read from."""
        return self.mapped is not None

    @property
    def images(self) -> ImagesOpen | None:
        """What is known of the memory that is read from."""
        if self.mapped is None:
            return None
        images = self.mapped.images
        return ImagesOpen(images.generation, *images.size, images.semantics)

    def open_memory(self, packet: InitPacket) -> None:
        """Map what was announced, and retire what was mapped before."""
        assert self.machine is not None
        try:
            images = _opened(packet, self.machine.capabilities)
        except CannotOpenError as problem:
            self.machine.open_failed(packet, str(problem))
            self._go_without(str(problem))
        else:
            self.machine.opened(packet)
            self._retire()
            self.mapped, self.problem = Mapped(images, self.machine), None
            if _is_legacy(packet, self.machine.capabilities):
                self.machine.look(LOOK_SECONDS)

    def _go_without(self, reason: str) -> None:
        self._complaints.say(f"cannot open the server's images, going on without: {reason}")
        self.problem = visible(reason)
        self._retire()

    def take_frame(self, frame: Frame, channels: frozenset[str]) -> None:
        """Keep the frame that was lent until it is read."""
        assert self.mapped is not None
        size = frame.camera.width, frame.camera.height
        if size != self.mapped.images.size:
            self._complaints.say(f"a frame's camera has {size} pixels, its memory not [IMG-1]")
            self.mapped.machine.release(frame)
            return
        if self.lent is not None:  # two at a time, against IMG-2: the newer one is worth more
            _release(self.lent)
        self.lent = Loan(frame, channels, self.mapped)

    def _look(self) -> None:
        if self.mapped is not None and self.lent is None and self.held is None:
            self._looks += 1
            self.lent = Loan(Glimpse(self._looks), self._channels, self.mapped)

    def _retire(self) -> None:
        if self.lent is not None:
            _release(self.lent)
            self.lent = None
        if self.mapped is not None:
            self._retired.append(self.mapped)
            self.mapped = None
        self.sweep()

    def _unmap(self, mapped: Mapped) -> bool:
        """Whether the memory could be unmapped: not while arrays of it are still there."""
        # A reader lets go of its arrays a moment before it releases, and `closed` comes last.
        still_held = self.held is not None and self.held.mapped == mapped
        if still_held or not mapped.images.close():
            return False
        mapped.machine.closed(mapped.images.generation)
        return True


def _release(loan: Loan) -> None:
    if isinstance(loan.frame, Frame):
        loan.mapped.machine.release(loan.frame)


def _is_legacy(packet: InitPacket, capabilities: frozenset[str]) -> bool:
    return packet.legacy is not None and (packet.ring is None or "frames" not in capabilities)


def _opened(packet: InitPacket, capabilities: frozenset[str]) -> Images:
    if packet.legacy is not None and cuda.usable():
        from splatbus_client.cuda.images import CudaImages  # they need cuda-bindings
        from splatbus_client.cuda.legacy import LegacyImages

        return (LegacyImages if _is_legacy(packet, capabilities) else CudaImages)(packet)
    return HostImages(packet)
