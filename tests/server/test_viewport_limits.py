"""Sizes that are refused, waited for or given up again, by a made-up clock."""

from __future__ import annotations

import pytest
from splatbus_server import memory
from splatbus_server.limits import Limits

from tests.server.resizing import answers, change, set_viewport
from tests.server.stage import READERS, Stage


def test_a_size_that_is_too_large_for_anybody_is_refused_before_it_is_made() -> None:
    """[VPT-2]"""
    limits = Limits(pixels=48)
    stage = Stage(limits=limits)
    asker = stage.steerer()
    refused = asker.ask(set_viewport(7, 7))
    assert (refused["code"], refused["id"]) == ("unsupported", 12)
    assert "49 pixels" in refused["message"]
    assert change(stage, asker, 8, 6)["viewport_size"] == [8, 6]
    stage.exchange.memory.close()


def test_no_client_has_more_than_its_share_of_the_memory(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """[VPT-2]"""
    needed = 20 * 8 * 6 * (READERS + 2)
    asker = stage.steerer()
    monkeypatch.setattr(memory.shared_memory, "free_bytes", lambda: 2 * needed - 2)
    refused = asker.ask(set_viewport())
    assert (refused["code"], stage.do_chores()) == ("unsupported", 0)
    assert str(needed) in refused["message"]
    monkeypatch.setattr(memory.shared_memory, "free_bytes", lambda: 2 * needed)
    assert change(stage, asker)["viewport_size"] == [8, 6]


def test_a_size_goes_back_when_nobody_is_left_who_asked_for_it(stage: Stage) -> None:
    reader, asker, other = stage.reader(), stage.steerer(), stage.steerer()
    change(stage, asker)
    reader.hear()
    reader.say(*answers(2, 1))
    assert other.ask(set_viewport())["type"] == "viewport_size"
    asker.leave()
    assert stage.do_chores() == 1  # which frees the first memory
    assert stage.exchange.memory.generation == 2
    other.leave()
    assert stage.do_chores() == 1
    (init,) = reader.hear()
    assert (init["generation"], init["meta"]["w"], init["meta"]["h"]) == (3, 4, 2)
    reader.say(*answers(3, 2))
    stage.do_chores()
    assert stage.do_chores() == 0


def test_a_size_goes_back_whose_asker_left_while_its_memory_was_made(stage: Stage) -> None:
    asker = stage.steerer()
    asker.say(set_viewport())
    asker.leave()
    assert stage.do_chores() == 1
    assert (stage.exchange.memory.width, stage.exchange.memory.height) == (8, 6)
    stage.do_chores()
    assert (stage.exchange.memory.width, stage.exchange.memory.height) == (4, 2)
    assert not stage.session.viewport.askers


def test_a_size_stays_while_somebody_reads_who_could_not_follow(stage: Stage) -> None:
    asker = stage.steerer()
    change(stage, asker)
    reader = stage.reader("host_shm", "frames")
    stage.do_chores()
    asker.leave()
    assert stage.do_chores() == 0
    reader.leave()
    assert stage.do_chores() == 1
    assert stage.exchange.memory.generation == 3


def test_a_size_that_the_renderer_chose_itself_stays(stage: Stage) -> None:
    asker = stage.steerer()
    change(stage, asker)
    stage.do_chores()
    stage.resize(6, 6)
    stage.do_chores()
    asker.leave()
    assert stage.do_chores() == 0


def test_to_go_back_is_tried_once(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    def create(size: int) -> None:
        raise OSError(28, "none left")

    asker = stage.steerer()
    change(stage, asker)
    stage.do_chores()
    monkeypatch.setattr(memory.shared_memory, "create", create)
    asker.leave()
    assert stage.do_chores() == 1
    assert stage.do_chores() == 0
    assert stage.exchange.memory.generation == 2
