"""Images lent to a client, in a ring whose other slots hold what nobody may read, and what is seen
of its reading: in memory of the host or of a device by what its adapter says that it shows, or, in
device memory of the stand-in CUDA runtime, by its calls.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.images import painted
from splatbus_conformance.images.memory.cuda_stand_in import usage
from splatbus_conformance.images.memory.cuda_stand_in.ring import DeviceRing
from splatbus_conformance.images.memory.cuda_stand_in.trace import Call
from splatbus_conformance.images.painted import Painting, sha256, spoilt
from splatbus_conformance.trials import memory_pace
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.scripted_server import NextFrame
from splatbus_conformance.trials.trial import GLANCE_SECONDS
from splatbus_conformance.wire.conversation import Message
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

READS = ("hello:ipc", "capability:frames", "opens", "adapter:digest")
OPENS_DEVICE = ("device", "returns:ipc", "capability:cuda_ipc")
TAKES_FRAMES_ON_DEVICE = (*OPENS_DEVICE, "capability:frames")
CHANNELS = ("color", "depth")
READINGS: tuple[tuple[str, Callable[[NDArray[Any]], NDArray[Any]]], ...] = (
    ("", lambda image: image),
    (", rows top-down", lambda image: image[::-1]),
    (", blue for red", lambda image: image[..., [2, 1, 0, 3]] if image.ndim == 3 else image),
    (", rounded to 8 bits", lambda image: np.round(np.clip(image, 0, 1) * 255) / np.float32(255)),
    (
        ", opaque",
        lambda image: np.where([0, 0, 0, 1], np.float32(1), image) if image.ndim == 3 else image,
    ),
)
"""Ways in which an image is misread."""


@contextmanager
def ring_on_device(trial: ClientTrial) -> Iterator[DeviceRing]:
    """A ring in device memory, which is what this trial offers; freed in the end (OPN-8)."""
    assert trial.device is not None, "a check of device memory needs a device"
    role = trial.role
    ring = DeviceRing(trial.device, role.width, role.height, role.slots)
    role.offer_on_device(ring)
    try:
        yield ring
    finally:
        role.offers_memory = False
        trial.peer.close_all()
        ring.free()


def reading(trial: ClientTrial) -> Connection:
    """An IPC connection on which the testee has opened the memory and reads frames."""
    role = trial.role
    role.lends_frames = False
    if role.ring is None:
        connection = trial.greeted("ipc")
    else:  # device memory is announced at once [NEG-15]
        role.welcomes = role.offers_memory = False
        connection = trial.connection("ipc")
        role.offer(connection)
        if not trial.says_hello(connection):
            trial.not_observable("the testee said no hello on this connection")
        role.welcome(connection)
    if not trial.opens(connection):
        trial.not_observable("the testee did not open the memory")
    return connection


@contextmanager
def lending(trial: ClientTrial, place: str) -> Iterator["FrameLender"]:
    """A lender of images in memory of the `host` or of a `device`; or in that, and their reading is
    seen by `calls`.
    """
    if place == "host":
        yield FrameLender(trial)
        return
    with ring_on_device(trial):
        yield FrameLender(trial, by_calls=place == "calls")


class FrameLender:
    """Paints a slot, lends it, and spoils it in the moment in which it is given back.

    Attributes:
        connection: the IPC connection on which the testee reads.
        shown: the image of each number that was lent.
    """

    def __init__(
        self, trial: ClientTrial, connection: Connection | None = None, *, by_calls: bool = False
    ) -> None:
        self.shown: dict[int, Painting] = {}
        trial.lent = self.shown
        self._slots: dict[int, int] = {}
        self._trial, self._role, self._by_calls = trial, trial.role, by_calls
        self._calls_before = 0
        """The last image was lent."""
        self.spoil_everything()
        self.connection = connection or reading(trial)
        self._former = trial.peer.on_message
        trial.peer.on_message = self._on_message

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self._role.width, self._role.height

    @property
    def lens(self) -> Json:
        """What the last image was said to be seen through, which a client may have decided."""
        return self._role.with_(self.connection).seen_through

    def lend(self, image: Painting) -> int:
        """Lend an image once none is lent, and do not wait until it has been read; its number."""
        _, slot = self.announced(image)
        self.paint(image, slot)
        return self._trial.lend(self.connection)

    def announced(self, image: Painting) -> NextFrame:
        """Know an image as the one to be lent next; its number and its slot."""
        coming = self._role.coming(self.connection)
        self.shown[coming.seq], self._slots[coming.seq] = image, coming.slot
        self._calls_before = len(self._trial.calls())
        return coming

    def show(self, image: Painting) -> int:
        """Lend an image, and wait until the client has read it; its number.

        Skips the check if it never does.
        """
        seq = self.lend(image)
        self.expect_read(seq)
        return seq

    def expect_read(self, seq: int) -> None:
        """Skip the check unless an image is given back, and was read."""
        if not self._trial.releases(self.connection, seq):
            self._trial.not_observable("the testee did not give an image back")
        if self._by_calls:
            read = bool(self.copies(self._slots[seq]))
        else:
            read = self.newest()["seq"] == seq
        if not read:
            self._trial.not_observable("the testee gives images back, and does not read them")

    def newest(self) -> Json:
        """The client's digest of its newest image: the last that was lent, if it comes in time."""
        trial, last = self._trial, max(self.shown, default=None)
        answer = trial.ask("digest")
        clock = trial.peer.clock
        deadline = clock() + memory_pace.patience(trial.facts.memory_seconds)
        while answer["seq"] != last and clock() < deadline:
            trial.rest(GLANCE_SECONDS)
            answer = trial.ask("digest")
        return answer

    def paint(self, image: Painting, slot: int) -> None:
        """Write an image to a slot, whether or not it is lent."""
        painted.write(self._role.memory, image, slot, self._role.ring_layout)

    def spoil_everything(self) -> None:
        """Write over every slot."""
        for slot in range(self._role.slots):
            self.paint(spoilt(*self.size), slot)

    def expect_intact(self, code: str, otherwise: str) -> None:
        """What the client shows, if that is seen and there is anything, is an image as it was lent;
        else the requirement is violated in the way that has this code.
        """
        if self._by_calls:
            return
        answer = self._trial.ask("digest")
        seq = answer["seq"]
        if seq is None:
            return
        what = f"the client shows image {seq}, which was never lent"
        self._trial.expect(seq in self.shown, "never-lent", what)
        wrong = self.misread(answer)
        self._trial.expect(not wrong, code, f"image {seq} {otherwise}: {wrong}")

    def misread(self, answer: Json) -> str:
        """What the client shows instead of the image that it names, in words; nothing if that."""
        right = zip(CHANNELS, self.shown[answer["seq"]].digests(), strict=True)
        wrong = [name for name, digest in right if answer[name] not in (None, digest)]
        bad = spoilt(*self.size)
        for name in wrong:
            if answer[name] == sha256(getattr(bad, name)):
                return f"its {name} is what the slot held only while nobody was to read it"
            for seq, other in self.shown.items():
                for words, read in READINGS:
                    if answer[name] == sha256(read(getattr(other, name))):
                        return f"its {name} is that of image {seq}{words}"
        return f"its {' and '.join(wrong)} is of no image whole" if wrong else ""

    def copies(self, slot: int) -> list[Call]:
        """The calls by which it copied from a slot since the last image was to be lent; none where
        calls are not seen.
        """
        ring, calls = self._role.ring, self._trial.calls()[self._calls_before :]
        return ring.copies(calls, slot) if self._by_calls and ring else []

    def without_lease(self, seq: int) -> Iterator[tuple[int, Call]]:
        """Those that copied what was not lent, or no longer, when this image was lent last."""
        for slot in range(self._role.slots):
            for call in self.copies(slot):
                if slot != self._slots[seq] or call.time > self._released_at(seq):
                    yield slot, call

    def under_way(self, seq: int) -> Iterator[Call]:
        """Those whose end the host had not seen when it gave this image back."""
        if self._by_calls and self._role.ring:
            at = self._released_at(seq)
            calls = [call for call in self._trial.calls() if call.time <= at]
            yield from usage.under_way(calls, self._role.ring.memory.name)

    def _released_at(self, seq: int) -> float:
        said = (it for it in self.connection.messages if it.type == "release")
        mine = (it for it in said if (it.value or {}).get("seq") == seq)
        return next(map(self.connection.arrived, mine), math.inf)

    def _on_message(self, connection: Connection, arrived: Message) -> None:
        released = self._role.with_(connection).released
        before = len(released)
        self._former(connection, arrived)
        for seq in self.shown.keys() & released[before:]:
            self.paint(spoilt(*self.size), self._slots[seq])
