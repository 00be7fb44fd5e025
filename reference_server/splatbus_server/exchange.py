"""What the render loop and the I/O thread share, behind one lock that is only held for a swap."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Hashable, Set
from typing import NamedTuple

from splatbus_wire.lens import as_high, scaled

from splatbus_server.control import Poses
from splatbus_server.memory import FrameMemory, Writer
from splatbus_server.statistics import Statistics
from splatbus_server.view import Intrinsics, View, lens_of, without_size

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
        lens: the renderer's own, for images of that memory's size.
        own_size: width and height that the renderer has chosen itself.
        poses: what the next image is to show.
        newest: the image published last in that memory.
        replaced: memory that was published in before and is not freed yet, oldest first.
        shown: what the image published last shows; None if another is due, whatever it shows.
        lock: guards all of these.
        changed: notified when there may be something to render.
    """

    def __init__(
        self, memory: FrameMemory, intrinsics: Intrinsics, poses: Poses, statistics: Statistics
    ) -> None:
        self.memory = memory
        self.own_size = memory.width, memory.height
        self.poses = poses
        self.newest: Image | None = None
        self.replaced: list[FrameMemory] = []
        self.lens = self._given_lens = lens_of(intrinsics, memory.width, memory.height)
        self._statistics = statistics
        self.lock = threading.Lock()
        self.changed = threading.Condition(self.lock)
        self._pending: Counter[object] = Counter()
        self._wanted: frozenset[str] = frozenset()
        self.shown: View | None = None
        self._written: FrameMemory | None = None
        self._is_awaited = False

    # The render loop's side

    def next_view(self, timeout: float | None, contents_changed: bool) -> View | None:
        """What to render now; None if nothing needs it within `timeout` seconds [IMG-10]."""
        with self.lock:
            if contents_changed and not self._wanted:
                self.newest = self.shown = None  # who comes next is not shown what is no more
            if not self.changed.wait_for(lambda: self._is_due(contents_changed), timeout):
                return None
            self._statistics.views += 1
            self._statistics.poses_superseded += sum(n - 1 for n in self._pending.values())
            self._pending.clear()
            memory, lens = self.memory, self.lens
            if self.poses.intrinsics is not None:
                lens = scaled(self.poses.intrinsics, memory.width, memory.height)
            return View(
                self.poses,
                without_size(lens),
                memory.width,
                memory.height,
                self._wanted,
                memory.generation,
            )

    def publish(self, view: View, scene_time: float, fill: Writer) -> bool:
        """Lets `fill` write what the view wants into a slot, then makes it the newest [IMG-6].

        Does nothing if the view is of memory that was replaced. If that comes to be meanwhile, the
        image is written and nobody sees it.

        Returns whether the I/O thread has something to do: a client waits for an image (the others
        ask when they release theirs), or memory for not being written any more.
        """
        with self.lock:
            memory = self.memory
            if view.generation != memory.generation:
                return False
            self._written = memory
            slot = memory.ring.begin_write()
        try:
            fill(slot, view.wants)
        finally:
            with self.lock:
                self._written = None
        now = time.monotonic()
        with self.lock:
            if memory is not self.memory:
                return True
            seq = memory.ring.publish(slot)
            self.newest = Image(memory, slot, seq, view, scene_time, now)
            self.shown = view
            memory.ring.begin_write()  # now, not before the next image, which does not wait then
            is_awaited, self._is_awaited = self._is_awaited, False
        self._statistics.frames_published += 1
        self._statistics.colors_converted += "color" in view.wants
        self._statistics.depths_converted += view.wants_depth
        return is_awaited

    # Either's side

    def replace(
        self,
        former: FrameMemory,
        memory: FrameMemory,
        intrinsics: Intrinsics | None = None,
        *,
        is_own: bool = False,
    ) -> bool:
        """Renders into other memory from now on; False if `former` is not in use any more.

        Args:
            former: that the memory is a successor of.
            memory: what comes next.
            intrinsics: the renderer's own for its size; if not given, the view keeps the height
                that those given last have.
            is_own: the renderer has chosen the size itself.
        """
        with self.lock:
            if former is not self.memory:
                return False
            if is_own:
                self.own_size = memory.width, memory.height
            if intrinsics is not None:
                self._given_lens = lens_of(intrinsics, memory.width, memory.height)
            self.lens = as_high(self._given_lens, memory.width, memory.height)
            memory.ring.last_seq = former.ring.last_seq
            self.replaced.append(former)
            self.memory, self.newest = memory, None
            self._wanted = frozenset()
            return True

    # The I/O thread's side

    def move(self, poses: Poses, received: Counter[object]) -> None:
        """Takes the poses to render with, and how many of each kind arrived since the last."""
        with self.lock:
            self.poses = poses
            self._pending += received
            self.changed.notify_all()

    def want(self, channels: frozenset[str], memory: FrameMemory) -> None:
        """Takes which channels clients read of this memory; none if nobody reads."""
        if channels != self._wanted:
            with self.lock:
                if memory is self.memory:
                    self._wanted = channels
                    self.changed.notify_all()

    def lend(self, client: Hashable, memory: FrameMemory, wants: Set[str]) -> Image | None:
        """Leases the newest image of the memory [IMG-3]; None if there is nothing new for it."""
        with self.lock:
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

    def renew(self, client: Hashable, memory: FrameMemory) -> None:
        """Has a scene at rest rendered again for who was lent its newest image [IMG-25]."""
        with self.lock:
            if memory is self.memory and memory.ring.has_seen(client):
                self.shown = None
                self.changed.notify_all()

    def take_back(self, client: Hashable, image: Image) -> None:
        """Ends a lease."""
        with self.lock:
            image.memory.ring.release(client, image.seq)

    def forget(self, client: Hashable, memory: FrameMemory) -> None:
        """Ends whatever a client had in the memory [IMG-17]."""
        with self.lock:
            memory.ring.drop(client)

    def give_up(self, memory: FrameMemory) -> bool:
        """Forgets memory that was replaced, to be closed then; False while it is written still."""
        with self.lock:
            if memory is self._written:
                return False
            self.replaced.remove(memory)
            return True

    def _is_due(self, contents_changed: bool) -> bool:
        if not self._wanted:
            return False
        shown = self.shown
        return (
            contents_changed
            or shown is None
            or shown.generation != self.memory.generation
            or not self._wanted <= shown.wants
            or not self.poses.look_alike(shown.poses)
        )
