from __future__ import annotations

from typing import Any

import pytest
from splatbus_server.connection import Connection

from tests.peers.raw_client import camera_pose, hello
from tests.server.stage import READERS, TERMS, Client, Stage


def test_a_reader_is_sent_each_image_once_and_one_at_a_time(stage: Stage) -> None:
    """[IMG-1, IMG-2, IMG-3]"""
    reader = stage.reader()
    view = stage.view()
    stage.publish(view)
    first = reader.frame()
    stage.publish(view)
    stage.publish(view)
    assert reader.hear() == []
    assert reader.release(first) == []
    second = reader.frame()
    assert second["seq"] == first["seq"] + 2
    reader.release(second)
    assert reader.hear() == []
    assert stage.statistics.frames_sent == 2


def test_an_image_that_is_there_is_sent_to_who_opens_later(stage: Stage) -> None:
    """[IMG-11]: nothing need be rendered again for it [IMG-10]."""
    stage.reader()
    stage.publish()
    assert stage.view() is None
    late = stage.connect()
    late.say({"type": "opened", "generation": 1})
    assert [message.get("type") for message in late.hear()] == ["welcome", None, "frame"]
    assert stage.view() is None


def test_what_has_changed_unseen_is_rendered_for_who_comes_next(stage: Stage) -> None:
    """[IMG-3]: the image before it is not what there is any more."""
    reader = stage.reader()
    stage.publish()
    seq = reader.frame()["seq"]
    reader.leave()
    assert stage.exchange.next_view(0, True) is None
    late = stage.connect()
    late.say({"type": "opened", "generation": 1})
    assert [message.get("type") for message in late.hear()] == ["welcome", None]
    stage.publish()
    assert late.frame()["seq"] == seq + 1


def test_nobody_reads_so_nothing_is_rendered(stage: Stage) -> None:
    """[IMG-10, IMG-21]"""
    assert stage.view() is None
    reader = stage.reader()
    assert stage.view() is not None
    reader.leave()
    assert stage.view() is None


def test_depth_is_wanted_only_where_somebody_subscribes(stage: Stage) -> None:
    """[IMG-20, IMG-21]"""
    reader = stage.connect()
    reader.say({"type": "subscribe", "channels": ["color"]}, {"type": "opened", "generation": 1})
    reader.hear()
    view = stage.view()
    assert view is not None
    assert not view.wants_depth
    stage.publish(view)
    reader.release(reader.frame())
    assert stage.view() is None
    reader.say({"type": "subscribe", "channels": ["color", "depth"]})
    deep = stage.view()
    assert deep is not None
    assert deep.wants_depth
    assert reader.hear() == []
    stage.publish(deep)
    assert reader.frame()["seq"] == 2


@pytest.mark.parametrize("is_alone", [True, False])
def test_who_waits_and_subscribes_to_more_is_sent_two_images(stage: Stage, is_alone: bool) -> None:
    """[IMG-25]: of the first, which was on its way already, it may not read what is new."""
    reader = stage.connect()
    reader.say({"type": "subscribe", "channels": ["color"]}, {"type": "opened", "generation": 1})
    reader.hear()
    if not is_alone:
        stage.reader()  # so that the image that there is has depth
    stage.publish()
    reader.release(reader.frame())
    assert stage.view() is None
    reader.say({"type": "subscribe", "channels": ["color", "depth"]})
    for seq in (2, 3):
        stage.publish()
        frame = reader.frame()
        assert frame["seq"] == seq
        assert stage.view() is None
        reader.release(frame)
    assert stage.view() is None


@pytest.mark.parametrize("is_alone", [True, False])
def test_who_subscribes_to_more_while_it_reads_is_sent_one_image(
    stage: Stage, is_alone: bool
) -> None:
    """[IMG-25]"""
    reader = stage.connect()
    reader.say({"type": "subscribe", "channels": ["color"]}, {"type": "opened", "generation": 1})
    reader.hear()
    if not is_alone:
        stage.reader()
    stage.publish()
    reader.say({"type": "subscribe", "channels": ["color", "depth"]})
    if is_alone:
        stage.publish()
    assert stage.view() is None
    reader.release(reader.frame())
    if not is_alone:
        stage.publish()
    frame = reader.frame()
    assert frame["seq"] == 2
    reader.release(frame)
    assert stage.view() is None


def test_who_wants_again_what_it_gave_up_is_sent_it(stage: Stage) -> None:
    """[IMG-25]: of the image before it read colour alone, though it might have read both."""
    reader = stage.reader()
    stage.publish()
    frame = reader.frame()
    reader.say({"type": "subscribe", "channels": ["color"]})
    reader.release(frame)
    assert stage.view() is None
    reader.say({"type": "subscribe", "channels": ["color", "depth"]})
    assert stage.view() is not None


def test_who_gives_up_and_wants_again_while_it_waits_is_sent_two_images(stage: Stage) -> None:
    """[IMG-25]: it may read the first whole, and reads what it has wanted all the time."""
    reader = stage.reader()
    for channels in (["color"], ["color", "depth"]):
        reader.say({"type": "subscribe", "channels": channels})
    for _ in range(2):
        stage.publish()
        reader.release(reader.frame())
    assert stage.view() is None


def test_an_image_without_depth_is_not_sent_to_who_wants_it(stage: Stage) -> None:
    """[IMG-20]"""
    flat = stage.connect()
    flat.say({"type": "subscribe", "channels": ["color"]}, {"type": "opened", "generation": 1})
    flat.hear()
    shallow = stage.view()
    deep = stage.reader()
    stage.publish(shallow)
    assert flat.frame()["seq"] == 1
    assert deep.hear() == []
    stage.publish()
    assert deep.frame()["seq"] == 2


def test_what_was_wanted_when_the_wait_began_is_there(stage: Stage) -> None:
    """[IMG-20]: a `subscribe` that crosses the frame counts from the next `release` on."""
    reader = stage.reader()
    reader.say({"type": "subscribe", "channels": ["color"]})
    view = stage.view()
    assert view is not None
    assert view.wants_depth
    stage.publish(view)
    frame = reader.frame()
    later = stage.exchange.next_view(0, True)
    assert later is not None
    assert not later.wants_depth
    reader.say({"type": "subscribe", "channels": ["depth"]})
    reader.release(frame)
    reader.say({"type": "subscribe", "channels": ["color"]})
    view = stage.view()
    assert view is not None
    assert view.wants == {"color", "depth"}


def test_equal_poses_change_nothing(stage: Stage) -> None:
    """[IMG-10]"""
    stage.reader()
    stage.publish()
    mover = Client(stage, Connection("msg", TERMS, 0.0))
    mover.say(camera_pose(0.0), camera_pose(0.0))
    assert stage.view() is None
    mover.say(camera_pose(2.0), camera_pose(1.0))
    view = stage.view()
    assert view is not None
    assert view.poses.camera.position == (1.0, 0.0, 0.0)
    assert stage.statistics.poses_received == 4
    assert stage.statistics.poses_superseded == 3


def test_a_view_that_is_not_published_is_due_still(stage: Stage) -> None:
    stage.reader()
    assert stage.view() is not None
    assert stage.view() is not None
    stage.publish()
    assert stage.view() is None


def test_who_has_no_control_is_told_once(stage: Stage) -> None:
    """[POS-10, POS-11]"""
    first, second = (Client(stage, Connection("msg", TERMS, 0.0)) for _ in range(2))
    second.say(hello())
    second.hear()
    assert first.say(camera_pose(1.0)) == []
    assert [refusal.code for refusal in second.say(camera_pose(2.0))] == ["busy"]
    assert [message["code"] for message in second.hear()] == ["busy"]
    second.say(camera_pose(2.0))
    assert second.hear() == []
    assert stage.exchange.poses.camera.position == (1.0, 0.0, 0.0)
    first.leave()
    assert stage.exchange.poses.camera.position == (2.0, 0.0, 0.0)
    assert second.say(camera_pose(3.0)) == []


@pytest.mark.parametrize(("index", "x"), [(0, 0.0), (5, 2.0), (-1, 2.0), (3, 0.0)])
def test_cameras_are_counted_round(stage: Stage, index: int, x: float) -> None:
    """[REQ-6]"""
    client = Client(stage, Connection("msg", TERMS, 0.0))
    client.say({"type": "get_camera_pose", "cam_idx": index})
    assert client.hear() == [{"position": [x, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0]}]


@pytest.mark.parametrize(
    ("capabilities", "other"),
    [(["frames"], {}), (["cuda_ipc"], {}), (["host_shm"], {"versions": ["1.0", "1.1"]})],
)
def test_memory_is_announced_only_to_who_can_open_it(
    stage: Stage, capabilities: list[str], other: dict[str, Any]
) -> None:
    """[NEG-11, CHN-5]"""
    client = stage.connect(*capabilities, **other)
    assert [message.get("type") for message in client.hear()] == ["welcome"]


def test_without_frames_there_is_memory_and_no_lease(stage: Stage) -> None:
    client = stage.connect("host_shm")
    client.say({"type": "opened", "generation": 1})
    welcome, init = client.hear()
    assert welcome["capabilities"] == ["host_shm"]
    assert init["ring"]["slots"] == READERS + 2
    assert stage.view() is None


def test_one_reader_too_many_is_told_and_closed(stage: Stage) -> None:
    """[IMG-18]; `welcome` still comes first [NEG-6]."""
    readers = [stage.reader() for _ in range(READERS)]
    surplus = stage.connect()
    assert [message.get("code") for message in surplus.hear()] == [None, "too_many_clients"]
    assert surplus.connection.ending is not None
    surplus.leave()
    readers[0].leave()
    stage.publish()
    assert readers[1].frame()
    assert stage.reader().connection.ending is None


@pytest.mark.parametrize(
    "message",
    [
        {"type": "opened", "generation": 2},
        {"type": "open_failed", "generation": 2, "reason": "no"},
        {"type": "closed", "generation": 2},
        {"type": "release", "generation": 1, "seq": 2},
        {"type": "release", "generation": 2, "seq": 1},
    ],
)
def test_what_names_nothing_is_reported_and_changes_nothing(
    stage: Stage, message: dict[str, Any]
) -> None:
    """[OPN-12, IMG-16]"""
    reader = stage.reader()
    stage.publish()
    frame = reader.frame()
    assert [refusal.code for refusal in reader.say(message)] == ["invalid_message"]
    assert [error["code"] for error in reader.hear()] == ["invalid_message"]
    assert reader.release(frame) == []
    assert len(reader.release(frame)) == 1


def test_what_was_not_agreed_upon_is_unsupported(stage: Stage) -> None:
    """[NEG-5]"""
    reader = stage.reader("host_shm", "frames")
    (refusal,) = reader.say({"type": "subscribe", "channels": ["color"]})
    assert refusal.code == "unsupported"
    view = stage.view()
    assert view is not None
    assert view.wants_depth


def test_who_cannot_open_goes_on_without_images(stage: Stage) -> None:
    """[OPN-4]"""
    client = stage.connect()
    client.hear()
    (note,) = client.say({"type": "open_failed", "generation": 1, "reason": "no such file"})
    assert "no such file" in note.reason
    assert client.hear() == []
    assert client.connection.ending is None
    assert stage.view() is None


def test_a_slot_is_not_written_while_it_is_lent(stage: Stage) -> None:
    """[IMG-4, IMG-9, IMG-17]"""
    first = stage.reader()
    view = stage.view()
    assert view is not None
    stage.publish(view)
    stage.publish(view)
    second = stage.connect()
    second.say({"type": "opened", "generation": 1})
    held = [first.frame()["slot"], second.hear()[-1]["slot"]]
    assert len(set(held)) == 2
    written: list[int] = []
    for _ in range(20):
        stage.exchange.publish(view, 0.0, lambda slot, _: written.append(slot))
    assert not set(written) & set(held)
    first.leave()
    for _ in range(20):
        stage.exchange.publish(view, 0.0, lambda slot, _: written.append(slot))
    assert held[0] in written
    assert held[1] not in written


def test_another_size_is_announced_and_the_old_memory_freed_when_closed(stage: Stage) -> None:
    """[OPN-5, OPN-8, MEM-1, IMG-2]"""
    reader = stage.reader()
    stage.publish()
    frame = reader.frame()
    old = stage.memory
    stage.resize(8, 6)
    (init,) = reader.hear()
    assert (init["generation"], init["meta"]["w"], init["meta"]["h"]) == (2, 8, 6)
    reader.say({"type": "opened", "generation": 2})
    stage.publish()
    assert reader.hear() == []
    assert reader.release(frame) == []
    newer = reader.frame()
    assert newer["generation"] == 2
    assert newer["seq"] > frame["seq"]
    assert stage.exchange.replaced == [old]
    reader.say({"type": "closed", "generation": 1})
    assert stage.exchange.replaced == []
    assert reader.connection.ending is None


def test_who_takes_no_reinit_is_asked_to_connect_anew(stage: Stage) -> None:
    """[OPN-7]"""
    reader = stage.reader("host_shm", "frames")
    stage.resize(8, 6)
    assert reader.hear() == []
    assert "OPN-7" in str(reader.connection.ending)
    assert len(stage.exchange.replaced) == 1
    reader.leave()
    assert stage.exchange.replaced == []


def test_two_generations_are_kept_at_most(stage: Stage) -> None:
    reader = stage.reader()
    stage.resize(8, 6)
    stage.resize(8, 7)
    assert reader.connection.ending is not None
    reader.leave()
    assert stage.exchange.replaced == []
    assert stage.exchange.memory.generation == 3


def test_a_lease_of_closed_memory_has_ended(stage: Stage) -> None:
    reader = stage.reader()
    stage.publish()
    reader.frame()
    stage.resize(8, 6)
    reader.hear()
    reader.say({"type": "opened", "generation": 2}, {"type": "closed", "generation": 1})
    stage.publish()
    assert reader.frame()["generation"] == 2
