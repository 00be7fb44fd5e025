"""Images of another size while others read: nobody reads memory that is freed, or mixed."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np
import pytest
import splatbus_client
import splatbus_server.memory
from splatbus_client.steering import ServerRefusedError

from tests.pair.painting import is_whole, painter
from tests.pair.rig import MOST_SECONDS, eventually, serving
from tests.pair.talk import Onlooker, Talker

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
    with serving(painter()) as (bus, tap):
        sessions = [tap.session() for _ in range(3)]
        watchers = [Watcher(session) for session in sessions]
        with Talker(tap) as steering:
            for watcher in watchers:
                watcher.start()
            for number, (width, height) in enumerate(SIZES * 3):
                steering.send({"type": "camera_pose", **pose(number)})
                resize(steering, width, height)
                eventually(
                    lambda size=(height, width): all(size in w.sizes for w in watchers),
                    f"images of {width} by {height}",
                )
                for watcher in watchers:
                    watcher.sizes.clear()
        for watcher in watchers:
            watcher.stopped.set()
            watcher.join(MOST_SECONDS)
        assert min(w.read for w in watchers) >= len(SIZES) * 3
        assert [w.broken for w in watchers] == [0, 0, 0]
        assert poisoned == sorted(poisoned)
        assert len(poisoned) >= len(SIZES) * 3 - 2  # all but the newest two
        for session in sessions:
            session.close()
        assert bus.statistics.frames_published
    tap.assert_conforming()


def pose(number: int) -> dict[str, dict[str, float]]:
    return {
        "position": {"x": float(number), "y": 0.0, "z": 0.0},
        "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    }


def resize(steering: Talker, width: int, height: int) -> None:
    """Ask until it is granted: until everybody has let go of the size before."""

    def granted() -> bool:
        steering.send({"type": "set_viewport", "width": width, "height": height, "id": 1})
        while (reply := steering.receive()) is not None and reply.get("id") != 1:
            pass
        assert reply is not None
        if reply["type"] == "viewport_size":
            assert reply["viewport_size"] == [width, height]
            return True
        assert reply["code"] == "busy", reply
        time.sleep(0.005)
        return False

    eventually(granted, "another size")


def test_the_readers_control_shows_that_poison_is_seen(poisoned: list[int]) -> None:
    """A reader that goes on after `closed` does read poison: the test above can fail."""
    with serving(painter()) as (_, tap), Onlooker(tap) as rude, Talker(tap) as steering:
        rude.open()
        frame = rude.see(lambda f: True)
        pixels = rude.color(frame)
        resize(steering, 16, 12)
        assert "generation" in (rude.receive() or {})
        rude.send({"type": "closed", "generation": 1})  # and reads on
        eventually(lambda: 1 in poisoned, "generation 1 freed")
        assert np.isnan(pixels).all()


def test_memory_is_kept_for_who_has_not_closed_it_and_freed_when_it_dies(
    poisoned: list[int],
) -> None:
    with (
        serving(painter()) as (_, tap),
        Talker(tap) as steering,
        Onlooker(tap) as slow,
        Onlooker(tap) as quick,
    ):
        name = slow.open()["memory"]["name"]
        quick.open()
        slow.frame()  # and holds it
        resize(steering, 64, 48)
        for reader in (slow, quick):
            assert next_init_packet(reader)["generation"] == 2
        for kind, generation in (("opened", 2), ("closed", 1)):
            quick.send({"type": kind, "generation": generation})
        steering.send({"type": "set_viewport", "width": 16, "height": 12, "id": 2})
        assert steering.until("error")[0]["code"] == "busy"
        assert poisoned == []
        assert exists(name)
        slow.reset()
        eventually(lambda: poisoned == [1], "generation 1 freed")
        assert not exists(name)
        resize(steering, 16, 12)
    tap.assert_conforming()


def next_init_packet(reader: Onlooker) -> dict:
    """The next init packet; frames before it are released unread."""
    while "meta" not in (message := reader.receive() or {}):
        assert message, "the connection ended"
        reader.release(message)
    return message


def exists(name: str) -> bool:
    return not Path("/dev/shm").is_dir() or (Path("/dev/shm") / name).exists()


def test_a_client_without_reinit_makes_it_unsupported() -> None:
    with serving(painter()) as (_, tap), tap.session() as session:
        with Onlooker(tap, "host_shm", "frames") as rigid:
            rigid.open()
            with pytest.raises(ServerRefusedError, match="unsupported"):
                session.set_viewport(64, 48, MOST_SECONDS)
            rigid.see(lambda f: f["camera"]["width"] == 32)
        eventually(lambda: granted(session), "the size, once it has gone")
    tap.assert_conforming()


def granted(session: splatbus_client.Session) -> bool:
    try:
        return session.set_viewport(64, 48, MOST_SECONDS) == (64, 48)
    except ServerRefusedError:
        return False


def test_a_size_that_cannot_be_had_changes_nothing() -> None:
    with serving(painter()) as (_, tap), tap.session() as session:
        with session.next_frame(MOST_SECONDS) as frame:
            assert is_whole(frame)
        with pytest.raises(ServerRefusedError, match="unsupported"):
            session.set_viewport(32768, 32768, MOST_SECONDS)
        assert session.viewport_size(MOST_SECONDS) == (32, 24)
        assert session.set_viewport(32, 24, MOST_SECONDS) == (32, 24)
    tap.assert_conforming()
