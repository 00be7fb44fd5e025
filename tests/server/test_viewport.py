"""Another size because a client asks for it, and memory that is given up, by a made-up clock."""

from __future__ import annotations

import re
from typing import Any

import pytest
from splatbus_server.limits import Limits
from splatbus_server.reader import LET_GO_SECONDS

from tests.peers.raw_client import hello
from tests.server.stage import READERS, Stage

NO_ROOM = OSError(28, "none left")


def failing(monkeypatch: pytest.MonkeyPatch, stage: Stage, error: Exception) -> None:
    """No memory can be had from now on."""

    def fail(*_: Any) -> None:
        raise error

    monkeypatch.setattr(stage.exchange.memory, "successor", fail)


@pytest.mark.parametrize(
    ("error", "code"),
    [(NO_ROOM, "unsupported"), (MemoryError(), "unsupported"), (KeyError(), "internal")],
)
def test_memory_that_cannot_be_had_leaves_what_there_is(
    stage: Stage, monkeypatch: pytest.MonkeyPatch, error: Exception, code: str
) -> None:
    """[VPT-2, VPT-6, NEG-29]"""
    failing(monkeypatch, stage, error)
    reader, asker = stage.reader(), stage.steerer()
    told = asker.resize()
    assert (told["code"], told["id"]) == (code, 12)
    assert stage.exchange.memory is stage.memory
    assert reader.hear() == []
    assert stage.statistics.refused[code] == 1
    assert asker.ask({"type": "get_viewport_size"})["viewport_size"] == [4, 2]


def test_what_counts_is_the_moment_of_the_answer(stage: Stage) -> None:
    """[VPT-3]: who came meanwhile and takes no reinit forbids it; and who asks alone waits."""
    asker, size = stage.steerer(), {"type": "get_viewport_size", "id": 13}
    asker.say({"type": "set_viewport", "width": 8, "height": 6, "id": 12}, size)
    assert asker.hear() == []
    other = stage.steerer()
    assert other.ask(size)["viewport_size"] == [4, 2]
    assert other.ask({"type": "set_viewport", "width": 9, "height": 6})["code"] == "busy"
    late = stage.reader("host_shm", "frames")
    stage.do_chores()
    asker.say()
    assert [reply.get("code") for reply in asker.hear()] == ["unsupported", None]
    assert late.connection.is_open
    assert stage.do_chores() == 1, "what was made is freed"
    assert [memory.generation for memory in stage.memory.store.open] == [1]


def test_who_cannot_open_the_memory_anyway_forbids_nothing(stage: Stage) -> None:
    """[VPT-3]: it was sent no init packet."""
    stage.arrive().say(hello("cuda_ipc", "frames"))
    assert stage.steerer().resize()["viewport_size"] == [8, 6]


def test_the_renderer_that_was_faster_wins(stage: Stage) -> None:
    asker = stage.steerer()
    asker.say({"type": "set_viewport", "width": 8, "height": 6, "id": 12})
    stage.resize(16, 12)
    stage.do_chores()
    assert asker.hear()[0]["code"] == "busy"
    assert stage.size == (16, 12)
    stage.do_chores()
    asker.leave()
    assert stage.do_chores() == 0, "its own size stays"


@pytest.mark.parametrize(
    "says",
    [
        [{"type": "opened", "generation": 2}, {"type": "closed", "generation": 1}],
        [{"type": "closed", "generation": 1}],
        [{"type": "open_failed", "generation": 1, "reason": "no"}],
    ],
)
def test_who_keeps_former_memory_alone_is_disconnected(stage: Stage, says: list[Any]) -> None:
    """[VPT-7, VPT-8]: after that the size can change again; who let go can take its time."""
    reader, keeper, asker = stage.reader(), stage.reader(), stage.steerer()
    stage.now = 100.0
    asker.resize()
    reader.say(*says)
    stage.wait(LET_GO_SECONDS - 0.01)
    assert keeper.connection.is_open
    stage.wait(10 * LET_GO_SECONDS)
    assert reader.connection.is_open
    assert "VPT-8" in str(keeper.connection.ending)
    keeper.leave()
    assert stage.exchange.replaced == []
    assert asker.resize(16, 12)["viewport_size"] == [16, 12]
    assert stage.memory.is_freed


@pytest.mark.parametrize("fails", [False, True])
def test_memory_is_not_freed_while_an_image_is_written(stage: Stage, fails: bool) -> None:
    """[OPN-8]: the render loop is another thread; an image that fails keeps no memory."""
    reader, asker = stage.reader(), stage.steerer()
    view = stage.view()
    assert view is not None

    def write(slot: int, wants: object) -> None:
        asker.resize()
        reader.answer(2, 1)
        assert stage.exchange.replaced == [stage.memory]
        if fails:
            raise ZeroDivisionError

    reader.hear()
    try:
        assert stage.exchange.publish(view, 0.0, write), "there is something to do: to free it"
        assert not fails
    except ZeroDivisionError:
        assert fails
    stage.catch_up()
    assert stage.exchange.replaced == []
    assert [message.get("generation") for message in reader.hear()] == [2], "no frame of it"
    stage.publish()
    assert reader.hear()[0]["seq"] == 1


@pytest.mark.parametrize(
    ("limits", "is_granted"),
    [
        (Limits(pixels=47), False),
        (Limits(pixels=48), True),
        (Limits(share=0.4999), False),
        (Limits(share=0.5), True),
    ],
)
def test_no_client_has_more_than_its_share_of_the_memory(limits: Limits, is_granted: bool) -> None:
    """[VPT-2]: which is said before any is made."""
    stage = Stage(limits=limits)
    stage.memory.free_bytes = lambda: 2 * 20 * 8 * 6 * (READERS + 2)
    told = stage.steerer().resize()
    assert told["id"] == 12
    assert told.get("code", "") == ("" if is_granted else "unsupported")
    assert len(stage.memory.store.made) == 1 + is_granted
    assert is_granted or re.search("48 pixels|3840 bytes", told["message"])


def test_a_size_goes_back_when_nobody_is_left_who_asked_for_it(stage: Stage) -> None:
    reader, asker, other = stage.reader(), stage.steerer(), stage.steerer()
    asker.resize()
    reader.hear()
    reader.answer(2, 1)
    assert other.resize()["type"] == "viewport_size"
    asker.leave()
    stage.do_chores()
    assert stage.size == (8, 6)
    other.leave()
    assert stage.do_chores() == 1
    (init,) = reader.hear()
    assert (init["generation"], init["meta"]["w"], init["meta"]["h"]) == (3, 4, 2)
    reader.answer(3, 2)
    stage.do_chores()
    assert stage.do_chores() == 0


def test_a_size_goes_back_whose_asker_left_while_its_memory_was_made(stage: Stage) -> None:
    asker = stage.steerer()
    asker.say({"type": "set_viewport", "width": 8, "height": 6})
    asker.leave()
    assert [(stage.do_chores(), stage.size) for _ in range(2)] == [(1, (8, 6)), (2, (4, 2))]


def test_a_size_stays_while_somebody_reads_who_could_not_follow(stage: Stage) -> None:
    asker = stage.steerer()
    asker.resize()
    reader = stage.reader("host_shm", "frames")
    stage.do_chores()
    asker.leave()
    assert stage.do_chores() == 0
    reader.leave()
    assert stage.do_chores() == 1
    assert stage.size == (4, 2)


def test_to_go_back_is_tried_once(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    asker = stage.steerer()
    asker.resize()
    stage.do_chores()
    failing(monkeypatch, stage, NO_ROOM)
    asker.leave()
    assert [stage.do_chores(), stage.do_chores()] == [1, 0]
    assert stage.size == (8, 6)
