"""One thread that waits for sockets and deadlines, so that nobody else has to."""

import contextlib
import selectors
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence

from splatbus_client.channel import Channel

_NAP_SECONDS = 0.5
_LONG_SECONDS, _LONGEST_REST = 0.001, 0.05
# They need no object of the system, unlike epoll and kqueue, and the former takes any descriptor.
_Selector = getattr(selectors, "PollSelector", selectors.SelectSelector)

# On Windows `time.monotonic` steps by 16 ms, which is longer than most round trips.
clock: Callable[[], float] = time.perf_counter
"""Seconds on the clock that all of a session's times are on."""


class Loop:
    """Keeps channels connected, and does what comes on them, until it is closed.

    Args:
        channels: closed at the end.
        tidy: called again and again, with the lock held.
        at_end: called once, when the channels are closed, with the lock held.

    Attributes:
        changed: its lock is held by whoever touches a channel or its owner; it is notified
            whenever one of them may have changed.
        closed: whether the end has begun.
    """

    def __init__(
        self, channels: Sequence[Channel], tidy: Callable[[], None], at_end: Callable[[], None]
    ) -> None:
        self.changed = threading.Condition()
        self.closed = False
        self._channels, self._tidy, self._at_end = channels, tidy, at_end
        self._wakes_at = 0.0  # when the thread looks after deadlines next, if nothing comes before
        self._awaited: list[tuple[socket.socket, int, Channel]] | None = None
        self._wakened, self._waker = socket.socketpair()
        self._wakened.setblocking(False)
        self._waker.setblocking(False)
        self._thread = threading.Thread(target=self._run, name="splatbus-client", daemon=True)
        self._thread.start()

    @contextlib.contextmanager
    def sending(self, channel: Channel) -> Iterator[None]:
        """Send at once what the block gives the channel to send, and have its deadline kept."""
        with self.changed:
            before = channel.interest()
            yield
            channel.flush(clock())
            too_late = channel.deadline() < self._wakes_at
            if (too_late or channel.interest() != before) and not self.closed:
                self._wake()

    def close(self) -> None:
        """End it, and wait for the end. Further calls do nothing."""
        with self.changed:
            if not self.closed:
                self.closed = True
                self._wake()
        self._thread.join()

    def _wake(self) -> None:
        with contextlib.suppress(BlockingIOError):  # as full as it is, it wakes already
            self._waker.send(b"\0")

    def _run(self) -> None:
        try:
            while True:
                with self.changed:
                    if self.closed:
                        return
                    now = clock()
                    self._tidy()
                    for channel in self._channels:
                        channel.advance(now)
                    self.changed.notify_all()
                    selector, self._wakes_at = self._selector(), self._next_deadline(now)
                    timeout = max(0.0, self._wakes_at - now)
                ready = selector.select(timeout)
                with self.changed:
                    now = clock()
                    for key, mask in ready:
                        if key.data is None:
                            self._wakened.recv(4096)
                        else:
                            key.data.ready(mask, now)
                    self.changed.notify_all()
                    took = clock() - now
                if took > _LONG_SECONDS:
                    # Who needs the lock, or Python's own, would come late every time while a server
                    # sends without end. It slows the server, too.
                    time.sleep(min(took, _LONGEST_REST))
        finally:
            with self.changed:
                self.closed = True
                for channel in self._channels:
                    channel.close()
                self._at_end()
                self._wakened.close()
                self._waker.close()
                self.changed.notify_all()

    def _selector(self) -> selectors.BaseSelector:
        # Made anew for other sockets, of which it has three at most: none that was closed since.
        wanted = [
            (channel.socket, channel.interest(), channel)
            for channel in self._channels
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
        return min(*(channel.deadline() for channel in self._channels), now + _NAP_SECONDS)
