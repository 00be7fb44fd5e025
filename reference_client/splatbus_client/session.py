"""A client's session with a server: what an application calls.

A thread of its own does all waiting on sockets; the caller's thread sends directly, so that a
pose or a `release` does not wait for another thread to wake.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import CancelledError, Future
from concurrent.futures import TimeoutError as NotInTime  # Python's own only since 3.11
from importlib.metadata import version
from types import TracebackType
from typing import Any

from splatbus_wire.messages import (
    DEFAULT_OBJECT,
    CameraPose,
    CameraReply,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Hello,
    Intrinsics,
    ObjectPose,
    Ping,
    Program,
    Request,
    Scene,
    SetTime,
    SetViewport,
    SubscribeTelemetry,
    Telemetry,
    ViewportSize,
)
from splatbus_wire.poses import Pose
from splatbus_wire.settings import Settings, settings

from splatbus_client.channel import Channel, Tap
from splatbus_client.clock import Sample
from splatbus_client.ipc_protocol import CHANNELS
from splatbus_client.lease import FrameLease
from splatbus_client.loop import Loop, clock
from splatbus_client.message_protocol import NotOfferedError
from splatbus_client.outgoing import Told
from splatbus_client.reading import ImagesOpen, Loan, Reading, capabilities
from splatbus_client.status import Status, why_no_frame, why_no_reply
from splatbus_client.steering import Steering


def connect(
    host: str | None = None,
    ipc_port: int | None = None,
    message_port: int | None = None,
    *,
    token: str | None = None,
    channels: Iterable[str] = CHANNELS,
) -> Session:
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

    def __init__(
        self, where: Settings, channels: Iterable[str] = CHANNELS, tap: Tap | None = None
    ) -> None:
        program = Program("splatbus-client", version("splatbus-protocol"))
        hello = Hello(("1.1", "1.0"), program, capabilities(), where.token)
        self._where = where
        self._started = clock()
        self._reading = Reading(hello, _known(channels))
        self._steering = Steering(hello)
        self._ipc = Channel("IPC", where.host, where.ipc_port, self._reading, tap)
        self._message = Channel("message", where.host, where.message_port, self._steering, tap)
        self._loop = Loop((self._ipc, self._message), self._reading.sweep, self._steering.close)
        self._changed = self._loop.changed

    # What is told, without a reply

    def send_camera(
        self, pose: Pose, *, tag: str | None = None, intrinsics: Intrinsics | None = None
    ) -> None:
        """Send the camera's pose, camera-to-world in the axes of the wire [CNV-1].

        The newest one wins: it replaces one that could not be sent yet, and is sent again to a
        server that was restarted. A server that does not know `tag` or `intrinsics` is sent the
        pose without.

        Args:
            pose: of the camera.
            tag: 1 to 64 characters that come back with the first image that was rendered with
                this pose, as `frame.camera.tag` [CAM-2]; sent once at most.
            intrinsics: the lens, from now on; it stays in force when it is not given [CAM-5].

        Raises:
            ProtocolError: a server would refuse it, for the requirement that is named.
        """
        self._tell(CameraPose(pose, self._timestamp(), tag, intrinsics))

    def send_object(self, pose: Pose, name: str = DEFAULT_OBJECT, scale: float = 1.0) -> None:
        """Send an object's pose: X_world = scale · R · X + position [CNV-2, OBJ-1].

        The newest one of each object wins, as for the camera. A server without `objects` is sent
        that of the object `"default"` with scale 1 only; see `status.no_effect`.

        Args:
            pose: object-to-world in the axes of the wire.
            name: an `id` of `scene`.
            scale: from 0.000001 to 1,000,000.

        Raises:
            ProtocolError: a server would refuse it, for the requirement that is named.
        """
        self._tell(ObjectPose(name, pose, float(scale), self._timestamp()))

    def send_time(self, seconds: float) -> None:
        """Send the time in the scene that images are to be rendered at [TIM-2].

        The newest one wins, as for the camera. A server without `time` is sent none; see
        `status.no_effect`.

        Raises:
            ProtocolError: a server would refuse it, for the requirement that is named.
        """
        self._tell(SetTime(seconds))

    def subscribe(self, *channels: str) -> None:
        """Read only these of `"color"` and `"depth"` from now on [IMG-19]."""
        with self._loop.sending(self._ipc):
            self._require_open()
            self._reading.subscribe(_known(channels))

    def subscribe_telemetry(self, names: Iterable[str] | None = None) -> None:
        """Have the server send these series of figures from now on; None for all [TEL-1].

        It is said again on each new connection. Read them with `next_telemetry`.

        Raises:
            ProtocolError: there are more than 256 names, or one has not 1 to 64 characters.
        """
        self._tell(SubscribeTelemetry(None if names is None else frozenset(names)))

    # What is asked

    def ask(self, request: Request) -> Future[Any]:
        """Ask without waiting; a lost connection delays the answer.

        Args:
            request: one of `splatbus_wire.messages`, without `id`.

        Returns:
            The reply as a future: ViewportSize, CameraReply, Scene, or for a Ping a Sample. It
            fails with ServerRefusedError, or with NotOfferedError where the server lacks the
            capability.

        Raises:
            ProtocolError: a server would refuse it, for the requirement that is named.
            RuntimeError: the session is closed, or 1,024 questions are unanswered.
        """
        return self._ask(request, lambda answer: answer)

    def ask_viewport_size(self) -> Future[tuple[int, int]]:
        """Ask without waiting; (0, 0) is a reply too. A lost connection delays the answer."""
        return self._ask(GetViewportSize(), _size)

    def ask_camera_pose(self, index: int) -> Future[Pose]:
        """Ask without waiting; a lost connection delays the answer."""
        return self._ask(GetCameraPose(index), lambda camera: camera.pose)

    def viewport_size(self, timeout: float) -> tuple[int, int]:
        """Return width and height of the images; ask again while the server does not know [REQ-12].

        Raises:
            TimeoutError: they were not known within `timeout` seconds.
            ServerRefusedError: the server answered with an error.
        """
        end = clock() + timeout
        while True:
            size: tuple[int, int] = self._answer(self.ask_viewport_size(), end, "viewport size")
            if all(size):
                return size

    def set_viewport(self, width: int, height: int, timeout: float) -> tuple[int, int]:
        """Ask for images of another size, and return it; they follow on the IPC channel [VPT-5].

        Raises:
            TimeoutError: there was no reply within `timeout` seconds.
            ServerRefusedError: `busy` while another client has control or former memory is still
                in use [VPT-4]: to try again at once is to wait 100 ms [VPT-9]; `unsupported` for a
                size that cannot be had or clients that could not follow [VPT-3].
            NotOfferedError: the server does not offer `viewport`.
            ProtocolError: a side is not from 1 to 32,768 [VPT-1].
        """
        end = clock() + timeout
        answer = self._ask(SetViewport(width, height), _size)
        size: tuple[int, int] = self._answer(answer, end, "reply to set_viewport")
        return size

    def camera(self, index: int, timeout: float) -> CameraReply:
        """Return the scene's camera `index`, modulo their number [REQ-6].

        Its `intrinsics` are None where the server does not tell them [CAM-8].

        Raises:
            TimeoutError: there was no reply within `timeout` seconds.
            ServerRefusedError: the server answered with an error.
            ProtocolError: `index` is out of the range of REQ-2.
        """
        end = clock() + timeout
        reply: CameraReply = self._answer(self.ask(GetCameraPose(index)), end, "camera")
        return reply

    def camera_pose(self, index: int, timeout: float) -> Pose:
        """Return the pose of that camera alone; all else as for `camera`."""
        return self.camera(index, timeout).pose

    def scene(self, timeout: float) -> Scene:
        """Return what the scene consists of [SCN-2].

        Raises:
            TimeoutError: there was no reply within `timeout` seconds.
            ServerRefusedError: the server answered with an error.
            NotOfferedError: the server does not offer `scene`.
        """
        end = clock() + timeout
        scene: Scene = self._answer(self.ask(GetScene()), end, "scene")
        return scene

    def ping(self, timeout: float) -> Sample:
        """Return the time of a round trip, and how the server's clock compares [PNG-2].

        Of several, `splatbus_client.clock.best` chooses the one that tells most.

        Raises:
            TimeoutError: there was no reply within `timeout` seconds.
            ServerRefusedError: the server answered with an error.
            NotOfferedError: the server does not offer `ping`.
        """
        now = clock()
        sample: Sample = self._answer(self.ask(Ping(now)), now + timeout, "pong")
        return sample

    # What is waited for

    def next_frame(self, timeout: float) -> FrameLease:
        """Wait for a frame that was not read before, and borrow it: `with session.next_frame(1.0)`.

        Raises:
            TimeoutError: none came within `timeout` seconds; the message says why, and what to do.
            RuntimeError: a frame is still borrowed, or the session is closed.
        """
        end = clock() + timeout
        with self._changed:
            if self._reading.held is not None:
                raise RuntimeError("release the former frame first: one is lent at a time [IMG-2]")
            loan = None
            while loan is None:
                wait = max(0.0, end - clock())
                self._changed.wait_for(lambda: self._reading.may_hold or self._loop.closed, wait)
                self._require_open()
                if not self._reading.may_hold:
                    why = why_no_frame(self.status, self._where, announced=self._reading.open)
                    raise TimeoutError(f"no frame came within {max(0.0, timeout):.1f} s: {why}")
                with self._loop.sending(self._ipc):
                    loan = self._reading.hold()
            camera = loan.frame.camera
            if camera is not None and self._steering.shown(camera.tag):
                self._message.settle()
            return self._lease(loan)

    def next_telemetry(self, timeout: float) -> Telemetry:
        """Wait for figures that were not read before. Of many unread ones, the newest are kept.

        Raises:
            TimeoutError: none came within `timeout` seconds; the message says why, and what to do.
            NotOfferedError: the server does not offer `telemetry`.
            RuntimeError: the session is closed.
        """
        unread, everything = self._steering.telemetry, SubscribeTelemetry(None)
        with self._changed:
            self._changed.wait_for(
                lambda: unread or self._steering.lacks(everything) or self._loop.closed, timeout
            )
            self._require_open()
            if unread:
                return unread.popleft().telemetry
            if (capability := self._steering.lacks(everything)) is not None:
                raise NotOfferedError(capability)
            why = why_no_reply(self.status, self._where)
            raise TimeoutError(f"no telemetry came within {timeout:.1f} s: {why}")

    # How it fares

    @property
    def status(self) -> Status:
        """How both channels fare now."""
        with self._changed:
            reading, steering = self._reading.problem, self._steering.no_effect
            return Status(self._ipc.status, self._message.status, reading, steering)

    @property
    def images(self) -> ImagesOpen | None:
        """What the server has said of the images that are read now; None while there are none."""
        with self._changed:
            return self._reading.images

    def close(self) -> None:
        """End both connections, and with them every lease. Further calls do nothing."""
        self._loop.close()

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _timestamp(self) -> float:
        return clock() - self._started

    def _tell(self, message: Told) -> None:
        with self._loop.sending(self._message):
            self._require_open()
            self._steering.tell(message)

    def _ask(self, request: Request, value: Callable[[Any], Any]) -> Future[Any]:
        with self._loop.sending(self._message):
            self._require_open()
            return self._steering.ask(request, value)

    def _require_open(self) -> None:
        if self._loop.closed:
            raise RuntimeError("the session is closed")

    def _lease(self, loan: Loan) -> FrameLease:
        images, slot = loan.mapped.images, loan.frame.slot

        def give_back() -> None:
            images.finish(slot)
            with self._loop.sending(self._ipc):
                self._reading.give_back(loan)

        return FrameLease(
            loan.frame,
            images.semantics,
            images.color(slot) if "color" in loan.channels else None,
            images.depth(slot) if "depth" in loan.channels else None,
            lambda name, image: images.on_host(name, slot, image),
            lambda name, image: images.copied(name, slot, image),
            give_back,
            lambda: self._reading.lasts(loan),
        )

    def _answer(self, answer: Future[Any], end: float, name: str) -> Any:
        wait = max(0.0, end - clock())
        try:
            return answer.result(wait)
        except CancelledError:
            raise RuntimeError("the session is closed") from None
        except NotInTime:
            answer.cancel()
            why = why_no_reply(self.status, self._where)
            raise TimeoutError(f"no {name} came within {wait:.1f} s: {why}") from None


def _size(reply: ViewportSize) -> tuple[int, int]:
    return reply.width, reply.height


def _known(channels: Iterable[str]) -> frozenset[str]:
    wanted = frozenset(channels)
    if not wanted or not wanted <= CHANNELS:
        raise ValueError(f"channels are 'color', 'depth' or both, not {sorted(wanted)} [IMG-19]")
    return wanted
