"""A client's session with a server: what an application calls.

One thread of its own does all waiting on sockets; the caller's thread sends directly, so that a
pose or a `release` does not wait for another thread to wake.
"""

import contextlib
import selectors
import socket
import threading
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import CancelledError, Future
from importlib.metadata import version
from types import TracebackType
from typing import Any, NamedTuple, Self

from splatbus_wire.messages import (
    CameraPose,
    GetCameraPose,
    GetViewportSize,
    Hello,
    PointCloudPose,
    Program,
    Request,
)
from splatbus_wire.poses import Pose

from splatbus_client.channel import Channel, ChannelStatus
from splatbus_client.ipc_protocol import CHANNELS
from splatbus_client.lease import FrameLease
from splatbus_client.reading import ImagesOpen, Loan, Reading, capabilities
from splatbus_client.settings import Settings, settings
from splatbus_client.steering import Steering

_NAP_SECONDS = 0.5
# They need no object of the system, unlike epoll and kqueue, and the former takes any descriptor.
_Selector = getattr(selectors, "PollSelector", selectors.SelectSelector)


class Status(NamedTuple):
    """How both channels fare, and why there are no images where the server announced some."""

    ipc: ChannelStatus
    message: ChannelStatus
    no_images: str | None


def connect(
    host: str | None = None,
    ipc_port: int | None = None,
    message_port: int | None = None,
    *,
    token: str | None = None,
    channels: Iterable[str] = CHANNELS,
) -> "Session":
    """Begin a session; what is not given comes from SPLATBUS_HOST, _IPC_PORT, _MSG_PORT, _TOKEN.

    Returns at once: connecting goes on in the background, and again whenever a connection is lost.

    Args:
        host: name or address of the server.
        ipc_port: of its IPC channel.
        message_port: of its message channel.
        token: what the server requires, if it does.
        channels: which of `"color"` and `"depth"` will be read; what nobody reads, a server need
            not write.

    Raises:
        ValueError: a setting is out of its range.
        OSError: the host's name cannot be resolved.
    """
    return Session(settings(host, ipc_port, message_port, token), channels)


class Session:
    """Both channels to one server; see `connect`. Every method may be called from any thread."""

    def __init__(self, where: Settings, channels: Iterable[str] = CHANNELS) -> None:
        program = Program("splatbus-client", version("splatbus-protocol"))
        hello = Hello(("1.1", "1.0"), program, capabilities(), where.token)
        self._where = where
        self._started = time.monotonic()
        self._changed = threading.Condition()
        self._closed = False
        self._wakes_at = 0.0  # when the thread looks after deadlines next, if nothing comes before
        self._reading = Reading(hello, _known(channels))
        self._steering = Steering(hello._replace(capabilities=()))
        self._ipc = Channel("IPC", where.host, where.ipc_port, self._reading)
        self._message = Channel("message", where.host, where.message_port, self._steering)
        self._awaited: list[tuple[socket.socket, int, Channel]] | None = None
        self._wakened, self._waker = socket.socketpair()
        self._wakened.setblocking(False)
        self._waker.setblocking(False)
        self._thread = threading.Thread(target=self._run, name="splatbus-client", daemon=True)
        self._thread.start()

    def send_camera(self, pose: Pose) -> None:
        """Send the camera's pose, camera-to-world in the axes of the wire [CNV-1].

        The newest one wins: it replaces one that could not be sent yet, and is sent again to a
        server that was restarted.

        Raises:
            ProtocolError: the pose breaks POS-2 or POS-3.
        """
        self._steer(CameraPose(pose, time.monotonic() - self._started))

    def send_object(self, pose: Pose) -> None:
        """Send the Gaussians' pose, object-to-world in the axes of the wire [CNV-2].

        Raises:
            ProtocolError: the pose breaks POS-2 or POS-3.
        """
        self._steer(PointCloudPose(pose, time.monotonic() - self._started))

    def ask_viewport_size(self) -> "Future[tuple[int, int]]":
        """Ask without waiting; (0, 0) is a reply too. A lost connection delays the answer."""
        return self._ask(GetViewportSize())

    def ask_camera_pose(self, index: int) -> "Future[Pose]":
        """Ask without waiting; a lost connection delays the answer."""
        return self._ask(GetCameraPose(index))

    def viewport_size(self, timeout: float) -> tuple[int, int]:
        """Return width and height of the images; ask again while the server does not know [REQ-12].

        Raises:
            TimeoutError: they were not known within `timeout` seconds.
            ServerRefusedError: the server answered with an error.
        """
        end = time.monotonic() + timeout
        while True:
            size: tuple[int, int] = self._answer(self.ask_viewport_size(), end, "viewport size")
            if all(size):
                return size

    def camera_pose(self, index: int, timeout: float) -> Pose:
        """Return the pose of the scene's camera `index`, modulo their number [REQ-6].

        Raises:
            TimeoutError: there was no reply within `timeout` seconds.
            ServerRefusedError: the server answered with an error.
            ProtocolError: `index` is out of the range of REQ-2.
        """
        end = time.monotonic() + timeout
        pose: Pose = self._answer(self.ask_camera_pose(index), end, "camera pose")
        return pose

    def next_frame(self, timeout: float) -> FrameLease:
        """Wait for a frame that was not read before, and borrow it: `with session.next_frame(1.0)`.

        Raises:
            TimeoutError: none came within `timeout` seconds; the message says why, and what to do.
            RuntimeError: a frame is still borrowed, or the session is closed.
        """
        with self._changed:
            if self._reading.held is not None:
                raise RuntimeError("release the former frame first: one is lent at a time [IMG-2]")
            self._changed.wait_for(lambda: self._reading.may_hold or self._closed, timeout)
            self._require_open()
            if not self._reading.may_hold:
                raise TimeoutError(f"no frame came in time: {self._why_no_frame()}")
            return self._lease(self._reading.hold())

    def subscribe(self, *channels: str) -> None:
        """Read only these of `"color"` and `"depth"` from now on [IMG-19]."""
        with self._sending(self._ipc):
            self._require_open()
            self._reading.subscribe(_known(channels))

    @property
    def status(self) -> Status:
        """How both channels fare now."""
        with self._changed:
            return Status(self._ipc.status, self._message.status, self._reading.problem)

    @property
    def images(self) -> ImagesOpen | None:
        """What the server has said of the images that are read now; None while there are none."""
        with self._changed:
            return self._reading.images

    def close(self) -> None:
        """End both connections, and with them every lease. Further calls do nothing."""
        with self._changed:
            if not self._closed:
                self._closed = True
                self._wake()
        self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _steer(self, message: CameraPose | PointCloudPose) -> None:
        with self._sending(self._message):
            self._require_open()
            self._steering.pose(message)

    def _ask(self, request: Request) -> "Future[Any]":
        with self._sending(self._message):
            self._require_open()
            return self._steering.ask(request)

    def _require_open(self) -> None:
        if self._closed:
            raise RuntimeError("the session is closed")

    def _lease(self, loan: Loan) -> FrameLease:
        images, slot = loan.mapped.images, loan.frame.slot

        def give_back() -> None:
            images.finish(slot)
            with self._sending(self._ipc):
                self._reading.give_back(loan)

        return FrameLease(
            loan.frame,
            images.semantics,
            images.color(slot) if "color" in loan.channels else None,
            images.depth(slot) if "depth" in loan.channels else None,
            lambda name, image: images.on_host(name, slot, image),
            give_back,
            lambda: self._reading.lasts(loan),
        )

    def _answer(self, answer: "Future[Any]", end: float, name: str) -> Any:
        try:
            return answer.result(max(0.0, end - time.monotonic()))
        except CancelledError:
            raise RuntimeError("the session is closed") from None
        except TimeoutError:
            answer.cancel()
            raise TimeoutError(f"no {name} came in time: {self._why_no_reply()}") from None

    def _why_no_frame(self) -> str:
        if not self._ipc.status.connected:
            return self._why_not_connected(self._ipc)
        if self._reading.problem is not None:
            return f"the images cannot be opened: {self._reading.problem}"
        if not self._reading.open:
            return "the server has announced no images yet"
        return "the server has published no other image"

    def _why_no_reply(self) -> str:
        if not self._message.status.connected:
            return self._why_not_connected(self._message)
        return "the server has not answered, or does not know yet"

    def _why_not_connected(self, channel: Channel) -> str:
        return (
            f"no server at {self._where.address()}: {channel.status.problem or 'connecting'}."
            " Start one with: splatbus-server"
        )

    @contextlib.contextmanager
    def _sending(self, channel: Channel) -> Iterator[None]:
        """Send at once what the block gives the channel to send, and have its deadline kept."""
        with self._changed:
            before = channel.interest()
            yield
            channel.flush(time.monotonic())
            due = channel.deadline()
            too_late = due is not None and due < self._wakes_at
            if (too_late or channel.interest() != before) and not self._closed:
                self._wake()

    def _wake(self) -> None:
        with contextlib.suppress(BlockingIOError):  # as full as it is, it wakes already
            self._waker.send(b"\0")

    def _run(self) -> None:
        """Wait for both channels and their deadlines, until the session is closed."""
        channels = (self._ipc, self._message)
        try:
            while True:
                with self._changed:
                    if self._closed:
                        return
                    now = time.monotonic()
                    self._reading.sweep()
                    for channel in channels:
                        channel.advance(now)
                    self._changed.notify_all()
                    selector, self._wakes_at = self._selector(), self._next_deadline(now)
                    timeout = max(0.0, self._wakes_at - now)
                ready = selector.select(timeout)
                with self._changed:
                    now = time.monotonic()
                    for key, mask in ready:
                        if key.data is None:
                            self._wakened.recv(4096)
                        else:
                            key.data.ready(mask, now)
                    self._changed.notify_all()
        finally:
            with self._changed:
                self._closed = True
                for channel in channels:
                    channel.close()
                self._steering.close()
                self._wakened.close()
                self._waker.close()
                self._changed.notify_all()

    def _selector(self) -> selectors.BaseSelector:
        # Made anew for other sockets, of which it has three at most: none that was closed since.
        wanted = [
            (channel.socket, channel.interest(), channel)
            for channel in (self._ipc, self._message)
            if channel.socket is not None
        ]
        if wanted != self._awaited:
            self._awaited = wanted
            self._waiting = _Selector()
            self._waiting.register(self._wakened, selectors.EVENT_READ)
            for each in wanted:
                self._waiting.register(*each)
        return self._waiting

    def _next_deadline(self, now: float) -> float:
        # Waking now and then for nothing spares a wake for every request, whose time is long.
        deadlines = [self._ipc.deadline(), self._message.deadline(), now + _NAP_SECONDS]
        return min(deadline for deadline in deadlines if deadline is not None)


def _known(channels: Iterable[str]) -> frozenset[str]:
    wanted = frozenset(channels)
    if not wanted or not wanted <= CHANNELS:
        raise ValueError(f"channels are 'color', 'depth' or both, not {sorted(wanted)} [IMG-19]")
    return wanted
