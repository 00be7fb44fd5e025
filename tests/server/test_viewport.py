"""Another size because a client asks for it, and memory that is given up, by a made-up clock."""

from __future__ import annotations

from typing import Any

import pytest
from splatbus_schemas import LIMITS
from splatbus_server import memory
from splatbus_server.memory import Memory
from splatbus_wire.messages import Closed

from tests.peers.raw_client import camera_pose
from tests.server.resizing import LET_GO, answers, change, set_viewport
from tests.server.stage import Stage


def test_all_are_told_of_the_size_and_the_old_memory_is_freed(stage: Stage) -> None:
    """[VPT-2, VPT-5, VPT-7]"""
    readers, asker = [stage.reader(), stage.reader()], stage.steerer()
    assert change(stage, asker) == {"type": "viewport_size", "id": 12, "viewport_size": [8, 6]}
    assert asker.ask({"type": "get_viewport_size", "id": 1})["viewport_size"] == [8, 6]
    for reader in readers:
        assert stage.exchange.replaced == [stage.memory]
        (init,) = reader.hear()
        assert (init["generation"], init["meta"]["w"], init["meta"]["h"]) == (2, 8, 6)
        reader.say(*answers(2, 1))
    assert stage.exchange.replaced == []
    assert stage.do_chores() == 1
    view = stage.view()
    assert view is not None
    assert (view.width, view.height, view.generation) == (8, 6, 2)


@pytest.mark.parametrize("error", [OSError(28, "none left"), MemoryError()])
def test_a_size_that_cannot_be_had_is_refused_before_more_is_made(
    stage: Stage, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    """[VPT-2]: what an image is converted in takes long to make for the largest size."""
    made: list[tuple[int, int]] = []

    def create(size: int) -> None:
        raise error

    monkeypatch.setattr(memory.shared_memory, "create", create)
    monkeypatch.setattr(memory, "Publisher", lambda *size: made.append(size))
    assert change(stage, stage.steerer())["code"] == "unsupported"
    assert made == []
    assert stage.exchange.memory is stage.memory


def test_the_size_that_images_have_is_no_change(stage: Stage) -> None:
    """[VPT-6]"""
    reader, asker = stage.reader(), stage.steerer()
    assert asker.ask(set_viewport(4, 2))["viewport_size"] == [4, 2]
    assert not asker.connection.is_held
    assert reader.hear() == []


def test_only_who_asked_waits_for_the_memory(stage: Stage) -> None:
    """[NEG-29]: its replies stay in order, and others have theirs at once."""
    asker, other = stage.steerer(), stage.steerer()
    size = {"type": "get_viewport_size", "id": 13}
    asker.say(set_viewport(), size, camera_pose(3.0), {"type": "nonsense"})
    asker.say(size | {"id": 14})
    assert asker.hear() == []
    assert other.ask(size)["viewport_size"] == [4, 2]
    assert other.ask(set_viewport())["code"] == "busy"
    stage.do_chores()
    asker.say()
    replies = asker.hear()
    assert [reply.get("id") for reply in replies] == [12, 13, None, 14]
    assert [reply.get("viewport_size") for reply in replies] == [[8, 6], [8, 6], None, [8, 6]]
    assert stage.exchange.poses.camera.position[0] == 3.0


def test_half_a_packet_waits_without_being_late(stage: Stage) -> None:
    """[FRM-5]: the client is not to blame for the time that memory takes."""
    asker = stage.steerer()
    asker.say(set_viewport())
    asker.connection.receive(b"\x02\x00", stage.now)
    stage.now = 60.0
    assert asker.connection.deadline > stage.now
    stage.do_chores()
    asker.say()
    assert asker.connection.deadline == stage.now + LIMITS["packet_completion_seconds"]
    asker.hear()
    asker.connection.receive(b"\x00\x00{}", stage.now)
    assert [refusal.code for refusal in asker.say()] == ["unknown_type"]


def test_who_has_no_control_is_told_busy(stage: Stage) -> None:
    """[VPT-4]"""
    first, second = stage.steerer(), stage.steerer()
    first.say(camera_pose(1.0))
    error = second.ask(set_viewport())
    assert (error["code"], error["id"]) == ("busy", 12)
    assert second.ask(set_viewport())["code"] == "busy", "each request has an answer"
    assert second.ask(set_viewport(4, 2))["viewport_size"] == [4, 2], "nothing changes"
    assert change(stage, first)["viewport_size"] == [8, 6]


def test_one_change_at_a_time(stage: Stage) -> None:
    """[VPT-4]: until nobody has the former memory; and that is known at once."""
    reader, asker = stage.reader(), stage.steerer()
    change(stage, asker)
    assert asker.ask(set_viewport(16, 12))["code"] == "busy"
    reader.say({"type": "opened", "generation": 2})
    assert asker.ask(set_viewport(16, 12))["code"] == "busy"
    stage.session.handle(reader.connection, Closed(1), stage.now)  # in the same turn
    assert change(stage, asker, 16, 12)["viewport_size"] == [16, 12]


def test_a_reader_without_reinit_forbids_it(stage: Stage) -> None:
    """[VPT-3, VPT-6]"""
    reader, asker = stage.reader("host_shm", "frames"), stage.steerer()
    assert asker.ask(set_viewport())["code"] == "unsupported"
    assert asker.ask(set_viewport(4, 2))["viewport_size"] == [4, 2], "nothing changes"
    assert reader.hear() == []
    assert reader.connection.ending is None
    reader.leave()
    assert change(stage, asker)["viewport_size"] == [8, 6]


def test_who_cannot_open_the_memory_anyway_forbids_nothing(stage: Stage) -> None:
    """[VPT-3]: it was sent no init packet."""
    stage.connect("cuda_ipc", "frames")
    assert change(stage, stage.steerer())["viewport_size"] == [8, 6]


def test_a_reader_without_reinit_that_came_meanwhile_forbids_it(stage: Stage) -> None:
    """[VPT-3]: what counts is the moment of the answer."""
    asker = stage.steerer()
    asker.say(set_viewport())
    late = stage.reader("host_shm", "frames")
    stage.do_chores()
    assert asker.hear()[0]["code"] == "unsupported"
    assert late.connection.ending is None
    assert stage.exchange.memory is stage.memory
    assert stage.do_chores() == 1, "what was made is freed"


def test_the_renderer_that_was_faster_wins(stage: Stage) -> None:
    asker = stage.steerer()
    asker.say(set_viewport())
    stage.resize(16, 12)
    stage.do_chores()
    assert asker.hear()[0]["code"] == "busy"
    assert stage.exchange.memory.width == 16


@pytest.mark.parametrize(
    ("error", "code"),
    [(OSError(28, "full"), "unsupported"), (KeyError(), "internal")],
)
def test_memory_that_cannot_be_had_leaves_what_there_is(
    stage: Stage, monkeypatch: pytest.MonkeyPatch, error: Exception, code: str
) -> None:
    """[VPT-2, VPT-6, NEG-29]"""

    def fail(*_: Any) -> None:
        raise error

    monkeypatch.setattr(Memory, "successor", fail)
    reader, asker = stage.reader(), stage.steerer()
    told = change(stage, asker)
    assert (told["code"], told["id"]) == (code, 12)
    assert stage.exchange.memory is stage.memory
    assert reader.hear() == []
    assert stage.statistics.refused[code] == 1
    assert asker.ask({"type": "get_viewport_size"})["viewport_size"] == [4, 2]


def test_who_keeps_former_memory_is_disconnected(stage: Stage) -> None:
    """[VPT-8]: and after that the size can change again."""
    keeper, prompt, asker = stage.reader(), stage.reader(), stage.steerer()
    stage.now = 100.0
    change(stage, asker)
    keeper.say(*answers(2))
    prompt.say(*answers(2, 1))
    stage.wait(LET_GO - 0.01)
    assert keeper.connection.ending is None
    stage.wait(0.02)
    assert "VPT-8" in str(keeper.connection.ending)
    assert prompt.connection.ending is None
    assert asker.ask(set_viewport(16, 12))["code"] == "busy"
    keeper.leave()
    assert stage.exchange.replaced == []
    assert change(stage, asker, 16, 12)["viewport_size"] == [16, 12]


def test_who_does_not_even_answer_is_disconnected_too(stage: Stage) -> None:
    """[VPT-8]: it opened the former memory and has not closed it."""
    keeper = stage.reader()
    change(stage, stage.steerer())
    stage.wait(LET_GO)
    assert "VPT-8" in str(keeper.connection.ending)


def test_who_let_go_of_the_memory_can_take_its_time(stage: Stage) -> None:
    """[VPT-8]: it binds who opened it; an answer to the new one has no deadline."""
    reader = stage.reader()
    change(stage, stage.steerer())
    reader.say({"type": "closed", "generation": 1})
    stage.wait(10 * LET_GO)
    assert reader.connection.ending is None
    assert stage.exchange.replaced == []


def test_who_never_answers_keeps_memory_for_so_long(stage: Stage) -> None:
    """[OPN-8, VPT-8]: it may have mapped it, and not have said so yet."""
    silent, asker = stage.connect(), stage.steerer()
    silent.hear()
    change(stage, asker)
    stage.wait(LET_GO - 0.01)
    assert stage.exchange.replaced == [stage.memory]
    stage.wait(0.02)
    assert "VPT-8" in str(silent.connection.ending)


def test_who_cannot_open_the_memory_lets_go_of_it_by_saying_so(stage: Stage) -> None:
    """[VPT-7]"""
    reader = stage.connect()
    reader.say({"type": "open_failed", "generation": 1, "reason": "no"})
    change(stage, stage.steerer())
    assert stage.exchange.replaced == []
    stage.wait(10 * LET_GO)
    assert reader.connection.ending is None


def test_memory_is_not_freed_while_an_image_is_written(stage: Stage) -> None:
    """[OPN-8]: the render loop is another thread."""
    reader, asker = stage.reader(), stage.steerer()
    view = stage.view()
    assert view is not None

    def write(slot: int, wants: object) -> None:
        change(stage, asker)
        reader.say(*answers(2, 1))
        assert stage.exchange.replaced == [stage.memory]
        stage.memory.color(slot).fill(1.0)

    reader.hear()
    assert stage.exchange.publish(view, 0.0, write), "there is something to do: to free it"
    stage.catch_up()
    assert stage.exchange.replaced == []
    assert [message.get("generation") for message in reader.hear()] == [2], "no frame of it"
    stage.publish()
    assert reader.frame()["seq"] == 1


def test_an_image_that_fails_does_not_keep_memory(stage: Stage) -> None:
    reader = stage.reader()
    view = stage.view()
    assert view is not None

    def fail(slot: int, wants: object) -> None:
        stage.resize(8, 6)
        reader.say(*answers(2, 1))
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        stage.exchange.publish(view, 0.0, fail)
    assert stage.exchange.replaced == [stage.memory]
    stage.catch_up()
    assert stage.exchange.replaced == []


def test_numbers_of_images_grow_over_generations(stage: Stage) -> None:
    """[IMG-1]: also those published while the memory was being made."""
    reader, asker = stage.reader(), stage.steerer()
    stage.publish()
    asker.say(set_viewport())
    view = stage.exchange.next_view(0, True)
    stage.publish(view)
    reader.release(reader.frame())
    last = reader.frame()["seq"]
    stage.do_chores()
    reader.hear()
    reader.say(*answers(2, 1))
    stage.publish()
    assert reader.frame()["seq"] > last


def test_a_wish_that_is_not_granted_in_time_leaves_no_memory(stage: Stage) -> None:
    """[OPN-9]: as when the server ends meanwhile."""
    asker = stage.steerer()
    asker.say(set_viewport())
    (allocate,) = stage.session.viewport.chores
    stage.session.viewport.chores.clear()
    allocate()
    made = stage.session.viewport.change.outcome  # type: ignore[union-attr]
    assert isinstance(made, Memory)
    stage.session.viewport.close()
    assert not made._remove.alive
