"""What the render loop and the I/O thread share, behind one lock that is only held for a swap."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Hashable, Set
from typing import NamedTuple

from splatbus_server.control import Poses
from splatbus_server.memory import FrameMemory
from splatbus_server.statistics import Statistics
from splatbus_server.view import Intrinsics, View

BOTH = frozenset(("color", "depth"))
WITH_LEGACY = BOTH | {"legacy"}
"""What is wanted while a client looks at the legacy slot."""


class Image(NamedTuple):
    """A whole image in a slot.

    Attributes:
        memory: where the slot is.
        slot: its number there.
        seq: number of the image.
        view: what it shows; of its channels, those of `view.wants` are written.
        time: in the scene, seconds.
        rendered_at: seconds on the server's monotonic clock.
    """

    memory: FrameMemory
    slot: int
    seq: int
    view: View
    time: float
    rendered_at: float


class Exchange:
    """The newest poses on their way to the renderer, the newest image on its way to clients.

    Attributes:
        memory: where images are published now.
        poses: what the next image is to show.
        newest: the image published last in that memory.
        replaced: memory that was published in before and is not freed yet, oldest first.
    """

    def __init__(
        self, memory: FrameMemory, intrinsics: Intrinsics, poses: Poses, statistics: Statistics
    ) -> None:
        self.memory = memory
        self.poses = poses
        self.newest: Image | None = None
        self.replaced: list[FrameMemory] = []
        self._intrinsics = intrinsics
        self._statistics = statistics
        self._changed = threading.Condition()
        self._pending: Counter[type] = Counter()
        self._wanted: frozenset[str] = frozenset()
        self._shown: View | None = None
        self._is_awaited = False
        self._failure: BaseException | None = None

    # The render loop's side

    def next_view(self, timeout: float | None, contents_changed: bool) -> View | None:
        """What to render now; None if nothing needs it within `timeout` seconds [IMG-10]."""
        with self._changed:
            if not self._changed.wait_for(lambda: self._is_due(contents_changed), timeout):
                return None
            if self._failure is not None:
                raise RuntimeError("the server's I/O thread died") from self._failure
            self._statistics.views += 1
            self._statistics.poses_superseded += sum(n - 1 for n in self._pending.values())
            self._pending.clear()
            return View(
                self.poses,
                self._intrinsics,
                self.memory.width,
                self.memory.height,
                self._wanted,
                self.memory.generation,
            )

    def publish(self, view: View, scene_time: float, write: Callable[[int], None]) -> bool:
        """Lets `write` fill a slot with what the view wants, then makes it the newest [IMG-6].

        Returns whether a client waits for an image; the others ask when they release theirs.
        """
        memory = self.memory
        with self._changed:
            slot = memory.ring.begin_write()
        write(slot)
        now = time.monotonic()
        with self._changed:
            seq = memory.ring.publish(slot)
            self.newest = Image(memory, slot, seq, view, scene_time, now)
            self._shown = view
            memory.ring.begin_write()  # now, not before the next image, which does not wait then
            is_awaited, self._is_awaited = self._is_awaited, False
        self._statistics.frames_published += 1
        return is_awaited

    def replace(self, memory: FrameMemory, intrinsics: Intrinsics) -> None:
        """Renders into other memory from now on."""
        with self._changed:
            self.replaced.append(self.memory)
            self.memory, self._intrinsics, self.newest = memory, intrinsics, None
            self._wanted = frozenset()

    # The I/O thread's side

    def move(self, poses: Poses, received: Counter[type]) -> None:
        """Takes the poses to render with, and how many of each kind arrived since the last."""
        with self._changed:
            self.poses = poses
            self._pending += received
            self._changed.notify_all()

    def want(self, channels: frozenset[str], memory: FrameMemory) -> None:
        """Takes which channels clients read of this memory; none if nobody reads."""
        if channels != self._wanted:
            with self._changed:
                if memory is self.memory:
                    self._wanted = channels
                    self._changed.notify_all()

    def lend(self, client: Hashable, memory: FrameMemory, wants: Set[str]) -> Image | None:
        """Leases the newest image of the memory [IMG-3]; None if there is nothing new for it."""
        with self._changed:
            image = self.newest
            if (
                image is not None
                and image.memory is memory
                and wants <= image.view.wants
                and memory.ring.lease(client) is not None
            ):
                return image
            self._is_awaited = True
            return None

    def take_back(self, client: Hashable, image: Image) -> None:
        """Ends a lease."""
        with self._changed:
            image.memory.ring.release(client, image.seq)

    def forget(self, client: Hashable, memory: FrameMemory) -> None:
        """Ends whatever a client had in the memory [IMG-17]."""
        with self._changed:
            memory.ring.drop(client)

    def free(self, memory: FrameMemory) -> None:
        """Frees memory that has been replaced and that no client has any more [OPN-8]."""
        with self._changed:
            self.replaced.remove(memory)
        memory.close()

    def fail(self, error: BaseException) -> None:
        """Lets the render loop know that nobody serves its images any more."""
        with self._changed:
            self._failure = error
            self._changed.notify_all()

    def _is_due(self, contents_changed: bool) -> bool:
        if self._failure is not None:
            return True
        if not self._wanted:
            return False
        shown = self._shown
        return (
            contents_changed
            or shown is None
            or shown.generation != self.memory.generation
            or not self._wanted <= shown.wants
            or not self.poses.look_alike(shown.poses)
        )
