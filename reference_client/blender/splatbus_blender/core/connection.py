"""A session in the background, for who may never wait: Blender's interface.

It knows nothing of Blender: what a file, an undo or the extension's end does to Blender's data does
nothing to it. One thread begins the session, since a host's name may take long to resolve, copies
images as they come, and ends it.
"""

from __future__ import annotations

import contextlib
import itertools
import secrets
import threading
import time
from collections.abc import Callable, Iterator

from splatbus_client import Session, Status, connect
from splatbus_viewer.mirror import Copied, Mirror
from splatbus_viewer.sizes import Sizes
from splatbus_wire.errors import ProtocolError

from .wanted import Said, Wanted, said, shows

_TURN_SECONDS = 0.05
_TIMELESS = "the server does not offer 'time' [NEG-5]"
"""No problem here: every scene of Blender has a timeline, and few of splats have one."""
_TAG_SECONDS = 1.0
"""How long the tag of a pose is waited for before images are looked at for what they show."""


class Connection:
    """One session with a server, from its beginning to `close`.

    No method waits but `image_of`. Every method may be called from any thread.

    Args:
        host: name or address; None for SPLATBUS_HOST, and so for the others.
        ipc_port: of the IPC channel.
        message_port: of the message channel.
    """

    def __init__(
        self,
        host: str | None = None,
        ipc_port: int | None = None,
        message_port: int | None = None,
    ) -> None:
        self._where = (host, ipc_port, message_port)
        self._session: Session | None = None
        self._mirror: Mirror | None = None
        self._failed: str | None = None
        self._closing = threading.Event()
        self._steering = threading.Lock()
        self._sizes = Sizes()
        self._told = Said()
        self._connections = 0, 0
        self._complained = False
        self._channels = Wanted().channels  # a session begins with both
        self._tags = (f"{secrets.token_hex(8)}-{n}" for n in itertools.count())
        self._tag_seen: str | None = None
        self._told_at = 0.0
        threading.Thread(target=self._run, name="splatbus-blender", daemon=True).start()

    @property
    def session(self) -> Session | None:
        """The session, once it has begun; None after its end."""
        return self._session

    @property
    def newest(self) -> Copied | None:
        """The newest image that was read, be its server gone or not."""
        return None if self._mirror is None else self._mirror.newest

    @property
    def image(self) -> Copied | None:
        """The newest image of a server that is there; None otherwise."""
        session = self._session
        return None if session is None or session.images is None else self.newest

    @property
    def status(self) -> Status | None:
        """How the session fares; None before it has begun, and after its end."""
        return None if self._session is None else self._session.status

    @property
    def problems(self) -> tuple[str, ...]:
        """What is wrong now, in words for a person."""
        status, found = self.status, [self._failed]
        if status is not None:
            for name, channel in (("images", status.ipc), ("messages", status.message)):
                if channel.problem is not None:
                    found.append(f"{name}: {channel.problem}")
            found += [status.no_images, self._sizes.problem]
            if status.no_effect != _TIMELESS:
                found.append(status.no_effect)
        return tuple(each for each in found if each is not None) + self._told.problems

    def tell(self, wanted: Wanted) -> None:
        """Say what is new of what Blender shows, unless a render is waiting for what it said."""
        if self._steering.acquire(blocking=False):
            try:
                self._tell(wanted)
            finally:
                self._steering.release()

    def image_of(
        self, wanted: Wanted, timeout: float, cancelled: Callable[[], bool] = lambda: False
    ) -> Copied:
        """Wait for an image of this, which no `tell` disturbs meanwhile; not for the interface.

        Args:
            wanted: what it is to show.
            timeout: seconds.
            cancelled: asked again and again; whether nobody wants it any more.

        Raises:
            TimeoutError: none came within `timeout` seconds; the message says what is wrong.
        """
        end = time.monotonic() + timeout
        with self._steering:
            self._told = Said(problems=self._told.problems)  # so that all is said, with a new tag
            tag = None
            for _ in self._turns(end):
                if cancelled():
                    break
                # Before it is known what the server can do, nothing could be said whole.
                session = self._session
                if session is None or session.images is None:
                    continue
                if session.status.message.version is None:
                    continue
                tag = self._tell(wanted) or tag
                image = self.image
                if self._sizes.under_way:
                    continue
                if self._told.lens is None and wanted.lens is not None:
                    continue
                if wanted.depth and image is not None and image.depth is None:
                    continue  # rendered before it was known that this is wanted
                age = time.monotonic() - self._told_at
                if image is not None and self._is_of(image, tag, age):
                    return image
        raise TimeoutError("; ".join(self.problems) or "no image of this view came in time")

    def close(self) -> None:
        """Have the session end, without waiting for it. Further calls do nothing."""
        self._closing.set()

    def _run(self) -> None:
        try:
            session = connect(*self._where)
        except (ValueError, OSError) as wrong:
            self._failed = str(wrong)
            return
        with session:
            self._mirror, self._session = Mirror(session), session
            while not self._closing.is_set():
                with contextlib.suppress(RuntimeError):
                    self._mirror.read(_TURN_SECONDS)
                    self._note_tag(self._mirror.newest)
            self._session = None

    def _note_tag(self, image: Copied | None) -> None:
        # A later image has no tag, and may take the place of this one before anybody looks.
        if image is not None and image.camera is not None and image.camera.tag is not None:
            self._tag_seen = image.camera.tag

    def _turns(self, end: float) -> Iterator[None]:
        while time.monotonic() < end and not self._closing.wait(_TURN_SECONDS / 10):
            yield

    def _is_of(self, image: Copied, tag: str | None, age: float) -> bool:
        if tag is not None and self._tag_seen == tag:
            return True
        if age < _TAG_SECONDS or self._session is None:
            return False
        if image.camera is None:
            return True  # a server of 1.0 does not say; it has had its time
        able = self._session.status.message.capabilities
        return shows(image.camera, image.objects, self._told, able)

    def _tell(self, wanted: Wanted) -> str | None:
        """Say what is new; return the tag of the camera's pose, if that was said."""
        session = self._session
        if session is None:
            return None
        self._begin_anew(session.status)
        self._sizes.turn(session, wanted.size, time.monotonic())
        new = said(wanted, session.images, last=not self._sizes.under_way)
        try:
            self._subscribe(session, wanted)
            return self._say(session, new)
        except RuntimeError:
            return None  # the session has ended meanwhile

    def _begin_anew(self, status: Status) -> None:
        """Say all again to another server, and ask again where nothing stands in the way any more.

        The session has said it again, but a lens that is not of the new images' shape is refused,
        and the pose with it [CAM-6].
        """
        connections = status.message.connections, status.ipc.connections
        if connections != self._connections:
            self._connections, self._told = connections, Said(problems=self._told.problems)
        complained, self._complained = self._complained, status.message.problem is not None
        if complained and not self._complained and not self._sizes.under_way:
            self._sizes = Sizes()

    def _subscribe(self, session: Session, wanted: Wanted) -> None:
        """Ask for depth only where it is looked at."""
        if wanted.channels != self._channels:
            session.subscribe(*wanted.channels)
            self._channels = wanted.channels

    def _say(self, session: Session, new: Said) -> str | None:
        told, problems, tag = self._told, list(new.problems), None
        objects, seconds, camera, lens = dict(told.objects), told.seconds, told.camera, told.lens
        for name, (pose, scale) in new.objects.items():
            if told.objects.get(name) != (pose, scale):
                with _noted(problems):
                    session.send_object(pose, name, scale)
                    objects[name] = pose, scale
        timed = "time" in session.status.message.capabilities
        if timed and new.seconds is not None and new.seconds != seconds:
            with _noted(problems):
                session.send_time(new.seconds)
                seconds = new.seconds
        other = None if new.lens == lens else new.lens
        # The camera last, so that an image with its tag shows the others too.
        if new.camera is not None and (new.camera != camera or other is not None):
            with _noted(problems):
                session.send_camera(new.camera, tag=(named := next(self._tags)), intrinsics=other)
                camera, lens, tag = new.camera, new.lens or lens, named
                self._told_at = time.monotonic()
        self._told = Said(camera, lens, objects, seconds, tuple(problems))
        return tag


@contextlib.contextmanager
def _noted(problems: list[str]) -> Iterator[None]:
    """Keep in words why something cannot be said; it is tried again at the next turn."""
    try:
        yield
    except ProtocolError as wrong:
        problems.append(str(wrong))
