"""The newest image, copied: for whoever looks at images now and then and keeps none lent."""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

from splatbus_client.lease import FrameLease, Image
from splatbus_client.mapping import MemoryLostError
from splatbus_client.session import Session
from splatbus_wire.messages import FrameCamera, Placement
from splatbus_wire.semantics import Semantics


class Copied(NamedTuple):
    """An image that stays as it is.

    Attributes:
        seq: number of the image.
        color: (H, W, 4) float32 RGBA, rows top-down; None where it was not subscribed to.
        depth: (H, W) float32 in scene units, rows top-down; None where it was not subscribed to.
        camera: what it was rendered with; None where a server of 1.0 does not say.
        semantics: how its numbers are meant.
        objects: where objects were in it, as far as they were moved.
        time: in the scene, seconds.
    """

    seq: int
    color: Image | None
    depth: Image | None
    camera: FrameCamera | None
    semantics: Semantics
    objects: tuple[Placement, ...] = ()
    time: float = 0.0


class Mirror:
    """Reads the frames of a session as they come.

    Attributes:
        newest: the last image that was copied whole; None before the first.
        session: whose frames are read.
    """

    newest: Copied | None = None

    def __init__(self, session: Session) -> None:
        self.session = session

    def read(self, timeout: float) -> None:
        """Copy the next frame, if one comes within `timeout` seconds, and give it back.

        Raises:
            RuntimeError: a frame is still borrowed, or the session is closed.
        """
        try:
            lease = self.session.next_frame(timeout)
        except TimeoutError:
            return
        with lease, suppress(MemoryLostError):
            copied = copy_of(lease)
            if lease.intact:
                self.newest = copied


def copy_of(lease: FrameLease) -> Copied:
    """Return a copy of what is lent.

    Raises:
        MemoryLostError: the server cut its memory short.
    """
    color = lease.copy("color") if "color" in lease.channels else None
    depth = lease.copy("depth") if "depth" in lease.channels else None
    camera = lease.camera if lease.has_camera else None
    return Copied(lease.seq, color, depth, camera, lease.semantics, lease.objects, lease.time)
