"""A log that nobody can fill, nor write into: what a client says stands there to be seen."""

from __future__ import annotations

import logging
import time

from splatbus_schemas.visible import visible

LINES_A_SECOND = 20


class Sparing(logging.Filter):
    """Lets so many lines of each kind through in a second; the next says how many it did not.

    Lines are of a kind if they have the same words around what differs: so a warning that was not
    there yet is read, whatever else goes on.
    """

    def __init__(self) -> None:
        super().__init__()
        self._begun: dict[object, float] = {}
        self._lines: dict[object, int] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether the line is written."""
        kind, now = record.msg, time.monotonic()
        record.msg, record.args = visible(record.getMessage()), ()
        if now >= self._begun.get(kind, -1.0) + 1.0:
            left_out = self._lines.get(kind, 0) - LINES_A_SECOND
            self._begun[kind], self._lines[kind] = now, 0
            if left_out > 0:
                record.msg += f" ({left_out} like it left out)"
        self._lines[kind] += 1
        return self._lines[kind] <= LINES_A_SECOND


log = logging.getLogger("splatbus_server")
log.addFilter(Sparing())
