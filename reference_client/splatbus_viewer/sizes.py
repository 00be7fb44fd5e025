"""Asks the server for images as large as the view: one request at a time, and not too often."""

from __future__ import annotations

import math
from concurrent.futures import Future
from typing import Any

from splatbus_client import NotOfferedError, ServerRefusedError, Session
from splatbus_client.reading import ImagesOpen
from splatbus_wire.messages import SetViewport

Size = tuple[int, int]
LARGEST = 32_768

_SOONEST = 0.1
"""Seconds between requests [VPT-9]."""
_BUSY_PAUSE = 0.5


class Sizes:
    """What was asked for, and what became of it; belongs to one thread.

    Attributes:
        problem: why images have another size, in words; None where they have not, or will not.
    """

    def __init__(self) -> None:
        self.problem: str | None = None
        self._asked: Size | None = None
        self._answer: Future[Any] | None = None
        self._soonest = -math.inf
        self._again = math.inf
        self._connections = 0
        self._generation = 0

    @property
    def under_way(self) -> bool:
        """Whether a reply is awaited, or the images that follow it."""
        return self._answer is not None

    def turn(self, session: Session, wanted: Size | None, now: float) -> None:
        """Take the reply that has come, and ask where that is due.

        Args:
            session: with a server.
            wanted: of the view; None to leave images as they are.
            now: seconds on a clock that does not go back.
        """
        connections = session.status.message.connections
        if connections != self._connections:
            self._connections = connections
            self._drop()
        images = session.images
        if self._answer is not None and not self._heard(images, now):
            return
        has = None if images is None else (images.width, images.height)
        if wanted is None or images is None or not 0 < min(wanted) <= max(wanted) <= LARGEST:
            return
        if wanted == has:
            self.problem = None
        elif now >= (self._soonest if wanted != self._asked else self._again):
            self._asked, self._soonest, self._again = wanted, now + _SOONEST, math.inf
            self._generation = images.generation
            self._answer = session.ask(SetViewport(*wanted))

    def _heard(self, images: ImagesOpen | None, now: float) -> bool:
        """Whether the request has come to its end."""
        answer = self._answer
        assert answer is not None
        if not answer.done():
            return False
        try:
            reply = answer.result()
        except (ServerRefusedError, NotOfferedError) as refused:
            busy = isinstance(refused, ServerRefusedError) and refused.error.code == "busy"
            self.problem = f"images keep their size: {refused}"
            self._again = now + _BUSY_PAUSE if busy else math.inf
            self._answer = None
            return True
        self.problem = None
        # They follow on the other channel [VPT-5]; or others did, of which nobody told us.
        follow = images is not None and (
            images.generation != self._generation or images[1:3] == (reply.width, reply.height)
        )
        if follow:
            self._answer = None
        return follow

    def _drop(self) -> None:
        """On another connection all is asked anew, of another server perhaps."""
        if self._answer is not None:
            self._answer.cancel()
        self._answer, self._asked, self.problem = None, None, None
