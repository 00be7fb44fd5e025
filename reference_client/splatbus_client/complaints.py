"""What is logged of a server: nothing that acts on a terminal, or repeats itself, or has no end."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable

from splatbus_schemas.visible import visible

MOST = 20
SECONDS = 60.0


class Complaints:
    """Warnings that a server can cause as often as it likes, with words of its own.

    One that only repeats the one before, and any beyond `MOST` within `SECONDS`, is for who debugs.

    Args:
        log: where they go.
        clock: seconds that never go back.
    """

    def __init__(self, log: logging.Logger, clock: Callable[[], float] = time.monotonic) -> None:
        self._log, self._clock = log, clock
        self._said = ""
        self._left, self._until = 0, -math.inf

    def say(self, text: str) -> None:
        """Log a text that may be the server's in part."""
        text = visible(text)
        if (now := self._clock()) >= self._until:
            self._left, self._until = MOST, now + SECONDS
        told = text != self._said and self._left > 0
        self._said = text
        self._log.log(logging.WARNING if told else logging.DEBUG, "%s", text)
        self._left -= told
        if told and not self._left:
            self._log.warning("what else there is of that kind, in this minute, is not told")
