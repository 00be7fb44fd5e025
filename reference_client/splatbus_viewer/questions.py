"""What a viewer asks on each new connection: where the first camera is, the size of images."""

from __future__ import annotations

import logging
from concurrent.futures import Future
from typing import Any

from splatbus_client.complaints import Complaints
from splatbus_client.message_protocol import NotOfferedError
from splatbus_client.session import Session
from splatbus_client.steering import ServerRefusedError
from splatbus_wire.messages import SetViewport
from splatbus_wire.poses import IDENTITY, Pose

log = logging.getLogger("splatbus_viewer")


class Questions:
    """Asks on each new connection, without waiting.

    Args:
        session: with any server, or none yet.
        wanted: width and height that images are asked to have; None takes them as they are.

    Attributes:
        camera: pose of the scene's first camera, the identity until it is known.
        size: width and height of the images in pixels, (0, 0) until they are known.
    """

    def __init__(self, session: Session, wanted: tuple[int, int] | None = None) -> None:
        self.camera = IDENTITY
        self.size = (0, 0)
        self._session, self._wanted = session, wanted
        self._connections = 0
        self._complaints = Complaints(log)
        self._camera: Future[Pose] = Future()
        self._size: Future[tuple[int, int]] = Future()
        self._resized: Future[Any] = Future()

    def follow(self) -> None:
        """Take answers that have come, and ask again where that is due."""
        connections = self._session.status.message.connections
        if connections > self._connections:
            self._connections = connections
            # What went unanswered would be asked once more on each connection.
            for former in (self._camera, self._size, self._resized):
                former.cancel()
            self._camera = self._session.ask_camera_pose(0)
            self._size = self._session.ask_viewport_size()
            if self._wanted is not None:
                self._resized = self._session.ask(SetViewport(*self._wanted))
                self._resized.add_done_callback(self._complain)
        self.camera = _answer(self._camera) or self.camera
        self.size = size = _answer(self._size) or self.size
        if self._size.done() and not all(size):
            self._size = self._session.ask_viewport_size()  # the session keeps REQ-12's distance

    def _complain(self, answer: Future[Any]) -> None:
        problem = None if answer.cancelled() else answer.exception()
        if isinstance(problem, (ServerRefusedError, NotOfferedError)):
            self._complaints.say(f"the images keep their size: {problem}")


def _answer(future: Future[Any]) -> Any:
    """Return what was answered, or None if nothing was yet, or an error."""
    if not future.done():
        return None
    try:
        return future.result()
    except ServerRefusedError:
        return None
