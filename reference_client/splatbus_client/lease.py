"""A frame in the hands of its reader: the right to read one slot, until it is given back."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.messages import DEFAULT_OBJECT, Frame, FrameCamera, Placement
from splatbus_wire.poses import IDENTITY
from splatbus_wire.semantics import Semantics

Image = NDArray[np.float32]


class OnDevice(Protocol):
    """An array on a GPU, its bottom row first; see `splatbus_client.cuda.arrays.DeviceArray`."""

    pointer: int
    shape: tuple[int, ...]

    def ready_on(self, stream: int) -> int:
        """Make a stream wait for the image, and return the pointer."""

    def __dlpack__(self, *, stream: int | None = None) -> Any:
        """Return what other libraries read it by, on that stream."""

    def __dlpack_device__(self) -> tuple[int, int]:
        """Return which device it is on."""


class Glimpse(NamedTuple):
    """A copy of the buffers of 1.0, which say nothing of the image: neither camera nor time."""

    seq: int
    slot: int = 0
    camera: None = None
    objects: tuple[Placement, ...] = ()
    time: float = math.nan
    rendered_at: float = math.nan


class FrameLease:
    """One whole image: colour and depth of one moment, and the camera that it was rendered with.

    Its arrays are views of memory that the server lends and will write again: copy what is to
    outlive the `with` block. Nothing may still be reading them when it ends [IMG-13]; reads on a
    GPU through DLPack are waited for then.

    A server that breaks MEM-5 can cut memory of the host short, and the system kills a process that
    touches an array of what is gone (SIGBUS). Whether it has is asked before a frame is handed out
    and when it is given back. In between, `color` and `depth` are as safe as the server is good;
    `copy` is safe from all of them.

    Of a server of 1.0 it is a copy of what its buffers hold when it is read first: colour and depth
    may be of different images, camera and times are not known, and `seq` counts the copies.

    Attributes:
        has_camera: whether `camera` is known.
        objects: where objects were, as far as they were moved; see `placement`.
        semantics: how the numbers are meant (alpha, colour space, kind of depth).
        seq: number of the image.
        time: time in the scene, seconds; NaN where it is not known.
        rendered_at: seconds on the server's monotonic clock; NaN where it is not known.
    """

    def __init__(
        self,
        frame: Frame | Glimpse,
        semantics: Semantics,
        color: Image | OnDevice | None,
        depth: Image | OnDevice | None,
        on_host: Callable[[str, Any], Image],
        copied: Callable[[str, Any], Image],
        give_back: Callable[[], None],
        lasts: Callable[[], bool],
    ) -> None:
        self._camera: FrameCamera | None = frame.camera
        self.has_camera = frame.camera is not None
        self.objects: tuple[Placement, ...] = frame.objects
        self.semantics = semantics
        self.seq = frame.seq
        self.time = frame.time
        self.rendered_at = frame.rendered_at
        self._color, self._depth = color, depth
        self._on_host, self._copied = on_host, copied
        self._give_back, self._lasts = give_back, lasts
        self._on_host_already: dict[str, Image] = {}
        self._released = False

    def placement(self, name: str = DEFAULT_OBJECT) -> Placement:
        """Where an object was in this image, and how large [OBJ-7].

        Put a mesh that is bound to the object there. Where the object was sent to last is where it
        will be in a later image: with that the mesh would swim against the splats.
        """
        return placement(self.objects, name)

    @property
    def camera(self) -> FrameCamera:
        """What it was rendered with, and the tag of the pose that it is the first to show.

        Raises:
            RuntimeError: the server speaks 1.0, which does not say.
        """
        if self._camera is None:
            raise RuntimeError("the server speaks 1.0, which does not say what camera it renders")
        return self._camera

    @property
    def color(self) -> Image:
        """(H, W, 4) float32 RGBA in [0, 1], rows top-down, read-only.

        Without a copy where it is in memory of the host, with one, the first time, where it is on
        a GPU.

        Raises:
            RuntimeError: the frame was released, or colour was not subscribed to [IMG-14, IMG-22].
        """
        return self._host("color", self._readable(self._color, "color"))

    @property
    def depth(self) -> Image:
        """(H, W) float32 depth in scene units, rows top-down, read-only; copied as colour is.

        Raises:
            RuntimeError: the frame was released, or depth was not subscribed to [IMG-14, IMG-22].
        """
        return self._host("depth", self._readable(self._depth, "depth"))

    def copy(self, channel: str) -> Image:
        """Return an array of one's own with what `color` or `depth` shows, by its name.

        Raises:
            RuntimeError: as for `color` and `depth`.
            MemoryLostError: the server cut its memory short; frames of other memory may follow.
        """
        image = {"color": self._color, "depth": self._depth}.get(channel)
        return self._copied(channel, self._readable(image, channel))

    @property
    def color_on_device(self) -> OnDevice:
        """(H, W, 4) float32 RGBA where it lies on the GPU, rows bottom-up, not to be written.

        For `torch.from_dlpack`, `cupy.from_dlpack`, `jax.dlpack.from_dlpack`, without a copy.

        Raises:
            RuntimeError: it is in memory of the host, or as for `color`.
        """
        return _device(self._readable(self._color, "color"))

    @property
    def depth_on_device(self) -> OnDevice:
        """(H, W) float32 depth where it lies on the GPU; all else as for `color_on_device`."""
        return _device(self._readable(self._depth, "depth"))

    @property
    def channels(self) -> frozenset[str]:
        """Which of `"color"` and `"depth"` may be read."""
        images = {"color": self._color, "depth": self._depth}
        return frozenset(name for name, image in images.items() if image is not None)

    @property
    def intact(self) -> bool:
        """Whether the server still lends it: asked after a copy, whether the copy is whole.

        False once it was released, or the connection ended and the server may write again [CHN-18],
        or its memory was cut short.
        """
        return not self._released and self._lasts()

    def release(self) -> None:
        """Give the slot back; the end of a `with` block does so. Further calls do nothing."""
        if not self._released:
            self._released = True
            self._color = self._depth = None
            self._on_host_already.clear()
            self._give_back()

    def _host(self, name: str, image: Image | OnDevice) -> Image:
        if name not in self._on_host_already:
            self._on_host_already[name] = self._on_host(name, image)
        return self._on_host_already[name]

    def _readable(self, image: Image | OnDevice | None, name: str) -> Image | OnDevice:
        if self._released:
            raise RuntimeError("the frame was released; copy what is to outlive it [IMG-14]")
        if image is None:
            raise RuntimeError(f"{name} was not subscribed to [IMG-22]")
        return image

    def __enter__(self) -> FrameLease:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()


def placement(objects: Iterable[Placement], name: str) -> Placement:
    """The placement of that name; at the identity and of scale 1 if it is not listed [OBJ-7]."""
    return next((each for each in objects if each.object == name), Placement(name, IDENTITY))


def _device(image: Image | OnDevice) -> OnDevice:
    if isinstance(image, np.ndarray):
        raise RuntimeError("the server's images are in memory of the host, not on a GPU")
    return image
