"""Follow a recording while it is written: read it, and judge it, on threads that give way."""

import os
import sys
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Self, TextIO

from splatbus_conformance.observe.audit import Audit, AuditFinding, audit_of
from splatbus_conformance.observe.live import LiveSession, Seen
from splatbus_conformance.wire.recording import from_line

LOOK_SECONDS = 0.2
LESS_PRIORITY, LEAST_PRIORITY = 10, 19


class Follower:
    """A session as its recording tells it.

    Attributes:
        seen: what is to be shown of it.
        broken: what is known to be broken, each requirement once for each peer, as it was judged
            last; in the order in which it was found.
        behind: seconds that what was read lies behind the clock.
    """

    def __init__(self, file: Path) -> None:
        self.seen = Seen()
        self.broken: list[AuditFinding] = []
        self.behind = 0.0
        self._file = file
        self._live = LiveSession()
        self._began = time.monotonic()
        self._stopping = threading.Event()
        self._pool = ThreadPoolExecutor(2, initializer=_give_way)

    def __enter__(self) -> Self:
        self._following = self._pool.submit(self._follow)
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._pool.shutdown(cancel_futures=True)

    def finish(self) -> LiveSession:
        """Read what is there to its end; the whole session."""
        self._stopping.set()
        self._following.result()
        return self._live

    def _follow(self) -> None:
        judging: Future[Audit] | None = None
        with self._file.open(encoding="utf-8") as recording:
            last = False
            while not last:
                last = self._stopping.is_set()
                self._read(recording, to_the_end=last)
                if judging is None and self._live.is_due and not last:
                    judging = self._pool.submit(audit_of, self._live.so_far())
                elif judging is not None and judging.done():
                    self._learn(judging.result())
                    judging = None
                self.seen = self._live.seen()
                if not self.behind:
                    self._stopping.wait(LOOK_SECONDS)

    def _read(self, recording: TextIO, *, to_the_end: bool) -> None:
        """Take what was written since the last look, or what can be read in a moment."""
        look_ends = time.monotonic() + LOOK_SECONDS
        while to_the_end or time.monotonic() < look_ends:
            place = recording.tell()
            line = recording.readline()
            now = time.monotonic() - self._began
            if not line.endswith("\n"):  # one that is not whole waits
                recording.seek(place)
                self._live.now = max(self._live.now, now)
                self.behind = 0.0
                return
            self._live.feed(from_line(line))
            self.behind = max(0.0, now - self._live.now)

    def _learn(self, judged: Audit) -> None:
        newest = {(it.requirement.id, it.peer): it for it in judged.findings if it.broken}
        known = {(it.requirement.id, it.peer): it for it in self.broken}
        self.broken = list((known | newest).values())


def _give_way() -> None:
    """The client, the server and the relay come first: to look at them must not slow them down."""
    if sys.platform == "linux":  # elsewhere a thread has no priority of its own
        thread = threading.get_native_id()
        nice = os.getpriority(os.PRIO_PROCESS, thread) + LESS_PRIORITY
        os.setpriority(os.PRIO_PROCESS, thread, min(nice, LEAST_PRIORITY))
