"""The server as the author of a renderer sees it: which view to render, and where to put it."""

from __future__ import annotations

import threading
import time as clock
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from importlib.metadata import version
from types import TracebackType
from typing import Any, Literal, NamedTuple

from splatbus_wire.messages import (
    DEFAULT_OBJECT,
    GetScene,
    Program,
    Scene,
    SceneObject,
    decode_from_server_message,
    encode,
)
from splatbus_wire.poses import Pose
from splatbus_wire.semantics import Semantics, checked_semantics

from splatbus_server.connection import Terms
from splatbus_server.limits import DEFAULT, Limits
from splatbus_server.logs import log
from splatbus_server.memory import FrameMemory, LostMemoryError, Memory
from splatbus_server.service import Service
from splatbus_server.session import CAPABILITIES, MESSAGE_CAPABILITIES, Session
from splatbus_server.settings import listen, settings
from splatbus_server.shared_memory import sweep_stale
from splatbus_server.source import DepthKind
from splatbus_server.statistics import Statistics
from splatbus_server.telemetry import Given
from splatbus_server.view import Intrinsics, View

READERS = 4
STRAIGHT_SRGB = Semantics()
ONE_OBJECT = (SceneObject(DEFAULT_OBJECT, "", 0),)
STOP_SECONDS = 5.0


class Address(NamedTuple):
    """Where a server listens."""

    host: str
    ipc_port: int
    message_port: int


def serve(
    width: int,
    height: int,
    *,
    intrinsics: Intrinsics | None = None,
    cameras: Sequence[Pose] = (),
    semantics: Semantics = STRAIGHT_SRGB,
    objects: Sequence[SceneObject] = ONE_OBJECT,
    time_range: tuple[float, float] | None = None,
    readers: int = READERS,
    memory: Literal["host_shm", "cuda_ipc"] = "host_shm",
    device: int = 0,
    host: str | None = None,
    ipc_port: int | None = None,
    message_port: int | None = None,
    token: str | None = None,
    limits: Limits = DEFAULT,
) -> Bus:
    """Starts to serve both channels, beside the caller's render loop.

    Removes what a server that was killed has left in shared memory [OPN-9].

    Args:
        width: of the images, pixels.
        height: of the images, pixels.
        intrinsics: in pixels, where no client asks for others; a vertical field of view of 60
            degrees if not given. Images of another size are seen as high as these.
        cameras: that the scene comes with, camera-to-world; the first is where a view begins.
        semantics: what the numbers in the images mean, and the scene's `origin`, which lets a scene
            far from its own zero have small numbers on the wire: its own position is that on the
            wire plus `origin`, for `cameras` as well.
        objects: what the scene consists of, for clients that ask, and by which `id` they move it;
            one is called "default", which clients of 1.0 move too.
        time_range: first and last time of an animated scene, seconds; clients can choose the time
            if it is given.
        readers: how many clients may read images at a time. There are two more slots than that,
            and each takes 20 bytes a pixel.
        memory: where the images are: `host_shm`, memory of the host, or `cuda_ipc`, memory of a
            GPU, which takes images that are on it already, and serves clients of 1.0 too.
        device: which GPU, as this process counts.
        host: to listen on; SPLATBUS_HOST or 127.0.0.1 if not given.
        ipc_port: SPLATBUS_IPC_PORT or 6001 if not given; 0 lets the system choose.
        message_port: SPLATBUS_MSG_PORT or 6000 if not given; 0 lets the system choose.
        token: what clients have to say; SPLATBUS_TOKEN or none if not given.
        limits: to what clients may take, all together.

    Raises:
        ValueError: a setting is out of its range, the scene [SCN-2] or the semantics [MEM-12] could
            not be told of, or an address that other machines can reach lacks a token [NEG-17].
        OSError: an address is taken, memory is full, or there is no such GPU.
        ImportError: `cuda_ipc` without cuda-bindings.
    """
    where = settings(host, ipc_port, message_port, token)
    semantics = checked_semantics(semantics)
    scene = checked_scene(Scene(tuple(objects), time_range, len(cameras), semantics.origin))
    sweep_stale()
    with ExitStack() as undo:
        ipc = undo.enter_context(listen(where.host, where.ipc_port))
        message = undo.enter_context(listen(where.host, where.message_port))
        images = _memory(memory, device, width, height, readers, semantics)
        undo.callback(images.close)
        terms = Terms(
            Program("splatbus-server", version("splatbus-protocol")),
            {
                "ipc": tuple(images.kind if c == "host_shm" else c for c in CAPABILITIES),
                "msg": tuple(
                    c for c in MESSAGE_CAPABILITIES if c != "time" or time_range is not None
                ),
            },
            where.token,
        )
        session = Session(images, scene, cameras, intrinsics, limits)
        service = Service({"ipc": ipc, "msg": message}, session, terms, limits)
        address = Address(where.host, ipc.getsockname()[1], message.getsockname()[1])
        bus = Bus(address, session, service)
        undo.pop_all()
        return bus


class Bus:
    """A running server; close it, or use it in a ``with`` statement.

    All calls are for one thread, that of the render loop.

    Attributes:
        address: host and ports.
    """

    def __init__(self, address: Address, session: Session, service: Service) -> None:
        self.address = address
        self._exchange = session.exchange
        self._session = session
        self._service = service
        self._thread = threading.Thread(target=service.run, name="splatbus", daemon=True)
        self._thread.start()

    def __enter__(self) -> Bus:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def statistics(self) -> Statistics:
        """A copy of the counts so far."""
        counts = self._session.statistics
        return replace(counts, refused=counts.refused.copy())

    def next_view(self, timeout: float = 0.1, *, contents_changed: bool = False) -> View | None:
        """The view to render next, or None if for `timeout` seconds there is nothing to do.

        There is nothing to do while no client reads images, and while camera, intrinsics, objects,
        time, and what clients want are as in the image published last [IMG-10, IMG-21].

        Args:
            timeout: seconds to wait; 0 returns at once.
            contents_changed: the scene itself is not as it was in the image published last, which
                nobody is shown any more then, if nobody looks.
        """
        view = self._exchange.next_view(timeout, contents_changed)
        return view and replace(view, origin=self._session.scene.origin)

    def publish(
        self,
        view: View,
        color: Any,
        depth: Any = None,
        *,
        alpha: Any = None,
        depth_kind: DepthKind = "linear",
        time: float | None = None,
        stream: object = None,
    ) -> None:
        """Makes an image the newest; clients that wait for one are told. Never waits for any.

        Nothing is written that no client wants, and nothing at all if the size changed after the
        view.

        Args:
            view: that was rendered.
            color: RGB or RGBA, straight or premultiplied as the server's `semantics` say, top row
                first, (height, width, 3 or 4) or (3 or 4, height, width); converted to float32,
                clamped to [0, 1] [BUF-3]: divide bytes by 255.
            depth: planar, positive in front of the camera, top row first, (height, width) or with
                one axis of length 1 more; needed if `view.wants_depth`. Nothing is there where it
                is not finite and above 0.
            alpha: accumulated, of the shape of depth; that of the colour, if it has one, if not
                given. Pixels where it is less than 1/255 are empty [ACC-9]. It is the colour's own
                too where that is premultiplied RGB.
            depth_kind: `linear`: z in scene units [BUF-6]. `inverse`: Σ(1/zᵢ)αᵢTᵢ, as 3DGS
                rasterisers accumulate it; stored as alpha / depth [ACC-8]. `accumulated`: Σzᵢαᵢ Tᵢ,
                stored as depth / alpha.
            time: in the scene, seconds [TIM-3]; `view.time`, or 0 without one, if not given.
            stream: with memory on a GPU, the CUDA stream to work on, behind what it has to do
                already; the one that `color` is made on, which for PyTorch is the current one, if
                not given.

        With memory on a GPU the arrays are float32 or float16 there (PyTorch, CuPy, JAX, or
        whatever has `__dlpack__` or `__cuda_array_interface__`), are read where they lie, and may
        be freed or written again by later work on the same stream. Nothing waits for the GPU.

        Raises:
            ValueError: an array has another shape, or depth is wanted and not given; with memory on
                a GPU, it is not there, or of other numbers.
            OSError: the GPU refuses the work.
        """
        memory = self._exchange.memory
        if view.generation != memory.generation:
            return
        fill = memory.writer(color, depth, alpha, depth_kind, stream)
        if view.wants_depth and depth is None:
            raise ValueError(
                "a client wants depth (view.wants_depth), but none is given. A renderer without "
                "depth can give np.full((view.height, view.width), 0.99 * view.intrinsics.far): "
                "all of it is then behind what the viewer draws itself. Infinite depth means that "
                "nothing is there."
            )

        if time is None:
            time = 0.0 if view.time is None else view.time
        has_news = True  # former memory may have waited for an image that failed
        try:
            has_news = self._exchange.publish(view, time, fill)
        except LostMemoryError as lost:
            self._session.tell_taken(str(lost))
            self._make_anew(memory)
        finally:
            if has_news:
                self._service.ring()

    def telemetry(self, values: Mapping[str, Given] | None = None, /, **named: Given) -> None:
        """Tells clients that subscribed how the renderer is doing; never waits (annex A).

            bus.telemetry(render_ms=(3.5, "ms"), stage="training", splats=1_200_000)
            bus.telemetry(opacity=lambda: np.histogram(opacities, bins=64, range=(0, 1)))

        What nobody subscribed to is not looked at, and a callable not called [TEL-4]. A client that
        is slow misses what comes meanwhile.

        Args:
            values: by names that are no identifiers.
            named: a finite number; a pair of that and its unit; a text; a pair of counts and edges,
                as `numpy.histogram` returns them; or a callable that returns one of these.

        Raises:
            ValueError: one of those that are wanted is none of these, or too long [TEL-2].
        """
        if self._session.readings.give({**values, **named} if values else named, clock.monotonic()):
            self._service.ring()

    def describe(self, objects: Sequence[SceneObject]) -> None:
        """Lists the objects anew, whose Gaussians and bounds change while a scene is trained.

        Raises:
            ValueError: the ids are others than at first, or they could not be told of [SCN-2].
        """
        scene = self._session.scene
        if {each.id for each in objects} != {each.id for each in scene.objects}:
            raise ValueError("the objects of a scene keep their ids")
        self._session.scene = checked_scene(scene._replace(objects=tuple(objects)))

    def resize(self, width: int, height: int, intrinsics: Intrinsics | None = None) -> None:
        """Serves images of another size from now on, as when a client asks for that.

        Clients that can take it are told of new memory; others are disconnected, and get it when
        they connect again. Old memory is kept until they let go of it; those that have not done so
        when the size changes once more, or within 10 seconds, are disconnected.

        Args:
            width: pixels.
            height: pixels.
            intrinsics: in pixels; those before, seen as high, if not given.

        Raises:
            ValueError: a size is out of its range.
            OSError: shared memory is full; the former size stays.
        """
        while not self._replace(self._exchange.memory, width, height, intrinsics, is_own=True):
            pass  # a client's wish came before
        self._service.ring()

    def _replace(
        self,
        former: FrameMemory,
        width: int,
        height: int,
        intrinsics: Intrinsics | None,
        *,
        is_own: bool,
    ) -> bool:
        """Has other memory take the place of this; False if other memory has already."""
        new = former.successor(width, height)
        if self._exchange.replace(former, new, intrinsics, is_own=is_own):
            return True
        new.close()
        return False

    def _make_anew(self, lost: FrameMemory) -> None:
        """Has memory take the place of this, of which the renderer need not know."""
        try:
            self._replace(lost, lost.width, lost.height, None, is_own=False)
        except OSError as problem:
            log.error("%s: no image goes on until there is memory again", problem)

    def close(self) -> None:
        """Ends all connections, then frees the memory of the images [OPN-9, CUD-4]."""
        self._service.stop()
        self._thread.join(STOP_SECONDS)
        self._session.viewport.close()
        for memory in (*self._exchange.replaced, self._exchange.memory):
            memory.close()


def checked_scene(scene: Scene) -> Scene:
    """The scene, which a client can read; ValueError if none could."""
    decode_from_server_message(encode(scene, typed_replies=True)[4:], GetScene())
    if all(each.id != DEFAULT_OBJECT for each in scene.objects):
        raise ValueError(f"no object of the scene is called {DEFAULT_OBJECT!r} [SCN-2]")
    return scene


def _memory(
    kind: str, device: int, width: int, height: int, readers: int, semantics: Semantics
) -> FrameMemory:
    if kind == "host_shm":
        return Memory(width, height, readers, semantics)
    if kind != "cuda_ipc":
        raise ValueError(f"memory {kind!r} is neither 'host_shm' nor 'cuda_ipc'")
    from splatbus_server.cuda.driver import Device  # only here: few servers have a GPU
    from splatbus_server.cuda.memory import DeviceMemory

    return DeviceMemory(width, height, readers, semantics, Device(device))
