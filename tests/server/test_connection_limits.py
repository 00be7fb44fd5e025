"""Limits of time, bytes and work on one connection, by a made-up clock."""

from __future__ import annotations

import json
import math

import pytest
from splatbus_schemas import LIMITS
from splatbus_server.connection import (
    FULL_BYTES,
    LINGER_SECONDS,
    LONG_BYTES,
    REST_SECONDS,
    Connection,
)
from splatbus_wire.messages import (
    CameraPose,
    GetViewportSize,
    ViewportSize,
)

from tests.peers.raw_client import camera_pose, hello, packet
from tests.server.talk import OPEN, REQUEST, events, greeted


def test_an_incomplete_packet_has_ten_seconds_from_its_first_byte() -> None:
    """[FRM-5]"""
    connection = Connection("msg", OPEN, 0.0)
    events(connection, REQUEST, 1.0)
    assert connection.deadline == math.inf
    events(connection, REQUEST + REQUEST[:2], 5.0)
    events(connection, REQUEST[2:6], 9.0)
    assert connection.deadline == 5.0 + LIMITS["packet_completion_seconds"]
    events(connection, REQUEST[6:] + REQUEST[:1], 12.0)
    assert connection.deadline == 12.0 + LIMITS["packet_completion_seconds"]
    connection.expire(connection.deadline)
    assert "FRM-5" in str(connection.ending)


def test_what_came_whole_before_the_end_of_the_stream_is_handled() -> None:
    """[CHN-16, FRM-6]"""
    connection = Connection("msg", OPEN, 0.0)
    connection.receive(REQUEST + REQUEST[:5], 0.0)
    assert events(connection, b"") == [GetViewportSize()]
    connection.send(ViewportSize(1, 1))
    assert connection.ending is not None
    assert not connection.over
    connection.sent(len(connection.unsent), 0.0)
    assert connection.over


def test_a_client_that_does_not_read_is_given_five_seconds() -> None:
    """[LIM-2]"""
    connection = Connection("msg", OPEN, 0.0)
    connection.send(ViewportSize(1, 1))
    assert connection.deadline == math.inf
    connection.sent(0, 1.0)
    connection.sent(0, 3.0)
    assert connection.deadline == 1.0 + LIMITS["stalled_reader_seconds"]
    connection.sent(4, 4.0)
    assert connection.deadline == 4.0 + LIMITS["stalled_reader_seconds"]
    connection.expire(connection.deadline)
    assert connection.over
    assert "LIM-2" in str(connection.ending)


def test_a_client_that_does_not_read_is_given_a_megabyte() -> None:
    """[LIM-2]"""
    connection = Connection("msg", OPEN, 0.0)
    while len(connection.unsent) <= LIMITS["max_unsent_bytes"]:
        assert not connection.over
        connection.send(ViewportSize(1, 1))
    connection.sent(0, 0.0)
    assert connection.over
    assert "LIM-2" in str(connection.ending)


def test_an_ended_connection_waits_for_the_client_to_read_the_last_packet() -> None:
    connection = greeted()
    events(connection, bytes(4))
    connection.sent(len(connection.unsent), 2.0)
    assert not connection.over
    assert connection.deadline == 2.0 + LINGER_SECONDS
    assert events(connection, REQUEST, 2.5) == []
    connection.receive(b"", 2.6)
    assert connection.over


def long_pose(length: int) -> bytes:
    pose = json.dumps({**camera_pose(1.0), "note": ""})
    return packet((pose[:-2] + "x" * (length - len(pose)) + pose[-2:]).encode())


def test_who_sends_long_packets_rests_so_that_others_need_not() -> None:
    """[FRM-2] Each is taken; what follows it waits, and half a packet is not late meanwhile."""
    connection = Connection("msg", OPEN, 0.0)
    longest = LIMITS["max_payload_bytes"]
    (pose,) = events(connection, long_pose(longest) + REQUEST + REQUEST[:5], 1.0)
    assert isinstance(pose, CameraPose)
    assert connection.share.is_resting
    assert connection.deadline == 1.0 + REST_SECONDS
    connection.expire(1.0 + REST_SECONDS)
    assert isinstance(connection.next_event(1.0 + REST_SECONDS), GetViewportSize)
    assert connection.next_event(1.0 + REST_SECONDS) is None
    late = 1.0 + REST_SECONDS + LIMITS["packet_completion_seconds"]
    assert connection.deadline == late
    assert len(events(connection, REQUEST[5:] + long_pose(LONG_BYTES) + REQUEST, late)) == 3


def test_a_request_that_takes_time_and_a_rest_end_apart() -> None:
    connection = Connection("msg", OPEN, 0.0)
    events(connection, long_pose(LONG_BYTES + 1) + REQUEST)
    connection.hold()
    connection.expire(connection.deadline)
    assert connection.next_event(1.0) is None
    connection.go_on(1.0)
    assert isinstance(connection.next_event(1.0), GetViewportSize)


def test_who_does_not_read_is_not_heard_before_it_does() -> None:
    """[LIM-2]"""
    connection = Connection("msg", OPEN, 0.0)
    connection.unsent += bytes(FULL_BYTES + 1)
    assert events(connection, REQUEST) == []
    connection.sent(1, 0.0)
    assert len(events(connection, REQUEST)) == 2


def test_half_a_packet_is_not_late_while_the_server_does_not_look() -> None:
    """[FRM-5] Neither behind replies that are not read nor in a rest of the client's share."""
    connection = Connection("msg", OPEN, 0.0)
    events(connection, REQUEST[:5])
    connection.unsent += bytes(FULL_BYTES + 100)
    for second in range(20):
        connection.sent(0 if second % 4 else 1, float(second))
        connection.expire(float(second))
    assert connection.is_open
    connection.sent(100, 20.0)
    assert connection.reader.deadline == 20.0 + LIMITS["packet_completion_seconds"]
    connection.sent(len(connection.unsent), 20.0)
    connection.charge(1.0, 0, 21.0)
    assert connection.deadline == connection.share.rests_until > 31.0
    assert events(connection, REQUEST[5:], 40.0) == []
    connection.expire(connection.deadline)
    assert connection.next_event(41.0) == GetViewportSize()
    assert connection.next_event(41.0) is None
    assert connection.deadline == math.inf


def test_time_begins_with_a_packet_not_with_the_end_of_a_rest() -> None:
    """[FRM-5, CHN-9]"""
    connection = Connection("msg", OPEN, 0.0)
    connection.unsent += bytes(FULL_BYTES + 1)
    connection.sent(0, 0.0)
    connection.sent(FULL_BYTES + 1, 1.0)
    assert connection.deadline == math.inf


@pytest.mark.parametrize(
    ("message", "known"),
    [(hello(), True), ({"type": "get_viewport_size"}, True), (camera_pose(), True), (b"{}", False)],
)
def test_who_sent_something_valid_is_known(message: object, known: bool) -> None:
    """[CHN-25]"""
    connection = Connection("msg", OPEN, 0.0)
    assert not connection.is_known
    events(connection, packet(message))
    assert connection.is_known == known


def test_a_greeting_of_tls_that_reads_as_a_length_is_told_when_its_time_is_over() -> None:
    """[FRM-5] One shorter than 256 bytes begins with a length that is allowed."""
    connection = Connection("msg", OPEN, 0.0)
    assert events(connection, b"\x16\x03\x01\x00\xf0\x01") == []
    connection.expire(connection.deadline)
    assert "TLS" in (connection.ending or "")
