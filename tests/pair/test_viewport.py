"""Images of another size while others read: nobody reads memory that is freed, or mixed."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
import splatbus_client
import splatbus_server.memory
from splatbus_client import Pose
from splatbus_client.steering import ServerRefusedError

from tests.pair.painting import is_whole, painter
from tests.pair.rig import MOST_SECONDS, serving
from tests.peers.raw_client import Reader
from tests.waiting import eventually

SIZES = [(32, 24), (64, 48), (48, 36), (16, 12), (128, 96)]


@pytest.fixture
def poisoned(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Freed memory holds NaN from the moment on at which it is freed: the generations freed."""
    freed: list[int] = []
    close = splatbus_server.memory.Memory.close

    def poison_and_close(memory: splatbus_server.memory.Memory) -> None:
        for slot in range(memory.ring.slots):
            if memory._colors:
                memory.color(slot)[...] = np.nan
                memory.depth(slot)[...] = np.nan
        freed.append(memory.generation)
        close(memory)

    monkeypatch.setattr(splatbus_server.memory.Memory, "close", poison_and_close)
    return freed


class Watcher(threading.Thread):
    """Reads every frame that it can get, twice, and counts those that are not whole."""

    def __init__(self, session: splatbus_client.Session) -> None:
        super().__init__(daemon=True)
        self.session = session
        self.stopped = threading.Event()
        self.sizes: set[tuple[int, ...]] = set()
        self.read = self.broken = 0

    def run(self) -> None:
        while not self.stopped.is_set():
            try:
                frame = self.session.next_frame(0.2)
            except TimeoutError:
                continue
            with frame:
                for _ in range(2):
                    self.broken += not is_whole(frame)
                    time.sleep(0.001)
                self.sizes.add(frame.color.shape[:2])
                self.read += 1


def test_three_clients_read_while_the_size_changes(poisoned: list[int]) -> None:
    with serving(painter()) as (_, tap), tap.session() as steering:
        sessions = [tap.session() for _ in range(3)]
        watchers = [Watcher(session) for session in sessions]
        for watcher in watchers:
            watcher.start()
        for number, (width, height) in enumerate(SIZES * 3):
            steering.send_camera(Pose((float(number), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
            resize(steering, width, height)
            assert eventually(
                lambda size=(height, width): all(size in w.sizes for w in watchers)
            ), f"no images of {width} by {height}"
            for watcher in watchers:
                watcher.sizes.clear()
        for watcher in watchers:
            watcher.stopped.set()
            watcher.join(MOST_SECONDS)
        assert min(w.read for w in watchers) >= len(SIZES) * 3
        assert [w.broken for w in watchers] == [0, 0, 0]
        for session in sessions:
            session.close()
        assert eventually(lambda: len(poisoned) == len(SIZES) * 3 - 1), "all but the newest freed"
        assert poisoned == sorted(poisoned)
    tap.assert_conforming()


def resize(steering: splatbus_client.Session, width: int, height: int) -> None:
    """Ask until it is granted: until everybody has let go of the size before."""

    def granted() -> bool:
        try:
            return steering.set_viewport(width, height, MOST_SECONDS) == (width, height)
        except ServerRefusedError as refused:
            if refused.error.code != "busy":
                raise
            return False

    assert eventually(granted), "another size"


def test_the_readers_control_shows_that_poison_is_seen(poisoned: list[int]) -> None:
    """A reader that goes on after `closed` does read poison: the test above can fail."""
    with (
        serving(painter()) as (_, tap),
        Reader(tap.ports["ipc"]) as rude,
        tap.session() as steering,
    ):
        rude.open()
        pixels = rude.color(rude.frame())
        resize(steering, 16, 12)
        assert "generation" in (rude.receive() or {})
        rude.send({"type": "closed", "generation": 1})  # and reads on
        assert eventually(lambda: 1 in poisoned), "generation 1 freed"
        assert np.isnan(pixels).all()
