"""What a window asks a server and tells it; nothing here waits."""

from __future__ import annotations

import secrets
from concurrent.futures import Future
from typing import Any

from splatbus_client.clock import Sample
from splatbus_client.message_protocol import NotOfferedError
from splatbus_client.session import Session
from splatbus_client.steering import ServerRefusedError
from splatbus_wire.messages import (
    CameraReply,
    FrameCamera,
    GetCameraPose,
    GetScene,
    Intrinsics,
    Ping,
    Placement,
    Request,
    Scene,
)
from splatbus_wire.poses import Pose

from splatbus_viewer.sizes import Sizes
from splatbus_viewer.window.cameras import Eye
from splatbus_viewer.window.choices import Choices
from splatbus_viewer.window.figures import Course, Images, Telemetries

PATIENCE_SECONDS = 0.25
"""A pose is not held back longer than that for the image of the one before [POS-12]."""
REST_SECONDS = 0.2
"""A window that is being drawn larger asks for its size once it rests."""
PING_SECONDS = 1.0


class Conversation:
    """Asks on each new connection, and tells what the user has changed.

    Attributes:
        scene: what it consists of, once that is known.
        refused: what the server refused last, by what it was asked for.
        round_trip: course of the pings, milliseconds.
        telemetries: the server's own figures.
        images: what came.
    """

    def __init__(self, session: Session) -> None:
        self.scene: Scene | None = None
        self.refused: dict[str, str] = {}
        self.round_trip = Course("ms")
        self.telemetries = Telemetries()
        self.images = Images()
        self._session = session
        self._connections = 0
        self._answers: dict[str, Future[Any]] = {}
        self._name, self._tags = secrets.token_hex(4), 0  # no other viewer's tags are ours
        self._told: tuple[Pose, Intrinsics | None] | None = None
        self._told_at, self._told_seen = 0.0, 0
        self._awaited: str | Pose | None = None
        self._told_objects: dict[str, Placement] = {}
        self._told_time: float | None = None
        self._channels = frozenset(("color", "depth"))
        self._names: frozenset[str] | None = frozenset()
        self._pinged = 0.0
        self._wanted, self._wanted_since = (0, 0), 0.0
        self._sizes = Sizes()

    def follow(
        self,
        choices: Choices,
        camera: FrameCamera | None,
        size: tuple[int, int],
        now: float,
        *,
        wants_telemetry: bool,
    ) -> None:
        """Do what is due.

        Args:
            choices: of the user; what a server answers with goes there too.
            camera: of the image that is shown, where it is known.
            size: that images are wanted in, pixels; (0, 0) for none in particular.
            now: seconds on the client's clock.
            wants_telemetry: whether somebody looks at the server's figures.
        """
        status = self._session.status.message
        if status.connections > self._connections:
            self._begin(status.connections)
        self._take_answers(choices, now)
        if camera is not None and self._awaited in (camera.tag, camera.pose):
            self._awaited = None
        if camera is not None and not choices.is_steering:
            choices.eye = choices.eye._replace(pose=camera.pose)
        if choices.channels != self._channels:
            self._channels = choices.channels
            self._session.subscribe(*self._channels)
        self._tell_camera(choices, camera, now)
        for name, placement in choices.objects.items():
            if self._told_objects.get(name) != placement:
                self._told_objects[name] = placement
                self._session.send_object(placement.pose, name, placement.scale)
        if choices.time is not None and choices.time != self._told_time:
            self._told_time = choices.time
            self._session.send_time(choices.time)
        if status.version is not None:
            self._ask_size(size, now)
            self._ping(now)
        self._follow_telemetry(wants_telemetry, now)

    @property
    def keeps_size(self) -> bool:
        """Whether it is known that the server's images do not follow the window's size."""
        status = self._session.status.message
        lacks = status.version is not None and "viewport" not in status.capabilities
        return lacks or self._sizes.problem is not None

    @property
    def problems(self) -> list[str]:
        """What the server refused, in words."""
        size = self._sizes.problem
        return [*self.refused.values(), *([] if size is None else [size])]

    @property
    def is_answered(self) -> bool:
        """Whether no answer is awaited, nor the image of a pose."""
        waits = self._sizes.under_way or self._awaited is not None
        return set(self._answers) <= {"ping"} and not waits

    def jump(self, index: int) -> None:
        """Ask for a camera of the scene, to look through it once the answer is here."""
        self._ask("camera", GetCameraPose(index))

    def _begin(self, connections: int) -> None:
        self._connections = connections
        for former in self._answers.values():
            former.cancel()
        self._answers.clear()
        self.refused.clear()
        self._ask("scene", GetScene())
        if self._session.images is None:
            self._ask("first camera", GetCameraPose(0))

    def _ask(self, name: str, request: Request) -> None:
        if name in self._answers:
            self._answers[name].cancel()
        self._answers[name] = self._session.ask(request)

    def _take_answers(self, choices: Choices, now: float) -> None:
        for name in [name for name, answer in self._answers.items() if answer.done()]:
            answer = self._answers.pop(name)
            problem = answer.exception()
            if problem is None:
                self.refused.pop(name, None)
                self._take(name, answer.result(), choices, now)
            elif isinstance(problem, ServerRefusedError):
                self.refused[name] = str(problem)
            elif not isinstance(problem, NotOfferedError):
                raise problem

    def _take(self, name: str, answer: Any, choices: Choices, now: float) -> None:
        if isinstance(answer, Scene):
            self.scene = answer
        elif isinstance(answer, Sample):
            self.round_trip.add(now, 1e3 * answer.round_trip)
        elif isinstance(answer, CameraReply):
            eye = Eye(answer.pose, choices.eye.distance)
            if name == "camera":
                choices.moved_to(eye)
            elif not choices.is_steering:
                choices.eye = eye

    def _tell_camera(self, choices: Choices, camera: FrameCamera | None, now: float) -> None:
        if not choices.is_steering:
            return
        lens = None
        if camera is not None:
            lens = choices.lens(camera.width, camera.height, camera.near, camera.far)
        if (choices.eye.pose, lens) == self._told:
            return
        if self.images.count == self._told_seen and now < self._told_at + PATIENCE_SECONDS:
            return
        new_lens = lens if self._told is None or lens != self._told[1] else None
        self._told, self._told_at = (choices.eye.pose, lens), now
        self._told_seen = self.images.count
        tag = None
        if self._session.status.message.version == "1.1":
            self._tags += 1
            tag = f"{self._name}-{self._tags}"
        self._awaited = tag or choices.eye.pose
        self.images.latencies.asked_for(self._awaited, now)
        self._session.send_camera(choices.eye.pose, tag=tag, intrinsics=new_lens)

    def _ask_size(self, size: tuple[int, int], now: float) -> None:
        if size != self._wanted:
            self._wanted, self._wanted_since = size, now
        rests = all(size) and now >= self._wanted_since + REST_SECONDS
        able = "viewport" in self._session.status.message.capabilities
        self._sizes.turn(self._session, size if rests and able else None, now)

    def _ping(self, now: float) -> None:
        if now >= self._pinged + PING_SECONDS and "ping" not in self._answers:
            self._pinged = now
            self._ask("ping", Ping(now))

    def _follow_telemetry(self, is_wanted: bool, now: float) -> None:
        names = None if is_wanted else frozenset[str]()
        if names != self._names:
            self._names = names
            self._session.subscribe_telemetry(names)
        while True:
            try:
                self.telemetries.take(self._session.next_telemetry(0.0), now)
            except (TimeoutError, NotOfferedError):
                return
