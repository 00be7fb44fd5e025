"""What a connection makes of bytes and moments."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import pytest
from splatbus_schemas import LIMITS
from splatbus_server.connection import (
    FULL_BYTES,
    LINGER_SECONDS,
    LONG_BYTES,
    REST_SECONDS,
    Connection,
    Refusal,
    Terms,
)
from splatbus_wire.messages import Program

from tests.peers.raw_client import camera_pose, hello, packet, packets

OPEN = Terms(Program("s", "1"), {"ipc": ("host_shm", "frames"), "msg": ()})
GUARDED = OPEN._replace(token="secret")
SIZE: dict[str, Any] = {"type": "get_viewport_size"}
CAMERA: dict[str, Any] = {"type": "get_camera_pose"}
REQUEST = packet(SIZE)


def events(connection: Connection, now: float) -> list[str]:
    """What it makes of what it has: the types of messages, the codes of refusals."""
    found = []
    while (event := connection.next_event(now)) is not None:
        found.append(event.code if isinstance(event, Refusal) else type(event).__name__)
    return found


def said(connection: Connection) -> list[str]:
    """What it has to say: of an error its code, to what in which request."""
    names = ("code", "version", "pointer", "id")
    return [
        " ".join(
            [message["type"]] * ("code" not in message)
            + [str(message[n]) for n in names if n in message]
        )
        for message in packets(bytes(connection.unsent))
    ]


TALKS: dict[str, tuple[list[Any], list[str], list[str], str]] = {
    "who awaits a reply in vain is told by an end [REQ-9]": (
        [{"type": "nope"}, CAMERA, SIZE],
        *(["unknown_type", "invalid_message"], [], "REQ-9"),
    ),
    "after hello by an error that names the request, if that is one [NEG-23, NEG-27, NEG-29]": (
        [
            hello(),
            CAMERA | {"id": 7.0},
            CAMERA,
            *(SIZE | {"id": bad} for bad in (-1, 7.5, 2**53, 1e300, "7", True, None)),
            *({"type": kind, "id": 7} for kind in ("weather", ["ping"])),
            SIZE,
        ],
        ["Hello", *["invalid_message"] * 9, *["unknown_type"] * 2, "GetViewportSize"],
        [
            "welcome 1.1",
            "invalid_message /cam_idx 7",
            "invalid_message /cam_idx",
            *["invalid_message /id"] * 7,
            *["unknown_type /type"] * 2,
        ],
        "",
    ),
}


@pytest.mark.parametrize(
    ("messages", "expected", "replies", "ending"),
    [pytest.param(*talk, id=name) for name, talk in TALKS.items()],
)
def test_what_is_said(
    messages: list[Any], expected: list[str], replies: list[str], ending: str
) -> None:
    """Where the standard leaves a choice, or the harness does not look."""
    connection = Connection("msg", OPEN, 0.0)
    connection.receive(b"".join(map(packet, messages)), 0.0)
    assert (events(connection, 0.0), said(connection)) == (expected, replies)
    assert connection.is_open == (not ending)
    assert ending in str(connection.ending)


# By a made-up clock

Deed = Callable[[Connection, float], None]


def feed(data: bytes) -> Deed:
    return lambda connection, now: connection.receive(data, now)


def queue(count: int) -> Deed:
    return lambda connection, now: connection.unsent.extend(bytes(count))


def take(count: int) -> Deed:
    """As many bytes as TCP takes."""
    return lambda connection, now: connection.sent(min(count, len(connection.unsent)), now)


def long_pose(length: int) -> bytes:
    pose = json.dumps({**camera_pose(1.0), "note": ""})
    return packet((pose[:-2] + "x" * (length - len(pose)) + pose[-2:]).encode())


def hold(connection: Connection, now: float) -> None:
    connection.hold()


EXPIRE, GO_ON, ALL = Connection.expire, Connection.go_on, 1 << 22
LATE: float = LIMITS["packet_completion_seconds"]
STALLED: float = LIMITS["stalled_reader_seconds"]
UNREAD: int = LIMITS["max_unsent_bytes"]
LONGEST = LIMITS["max_payload_bytes"]
RESTED = 1.0 + REST_SECONDS
TIMELINES: dict[str, list[tuple[float, Deed, list[str], float | str]]] = {
    "what reads as a length is told to be TLS": [
        (0.0, feed(b"\x16\x03\x01\x00\xf0\x01"), [], LATE),
        (LATE, EXPIRE, [], "TLS"),
    ],
    "an end within a packet is told [FRM-6]": [
        (0.0, feed(REQUEST + REQUEST[:5]), ["GetViewportSize"], LATE),
        (1.0, feed(b""), [], "FRM-6"),
    ],
    "who does not read is given five seconds [LIM-2]": [
        (0.0, queue(UNREAD), [], math.inf),
        (1.0, take(0), [], 1.0 + STALLED),
        (3.0, take(0), [], 1.0 + STALLED),
        (4.0, take(4), [], 4.0 + STALLED),
        (4.0 + STALLED, EXPIRE, [], "LIM-2"),
    ],
    "and a megabyte [LIM-2]": [
        (0.0, queue(UNREAD + 1), [], math.inf),
        (0.0, take(0), [], "LIM-2"),
    ],
    "who does not read is not heard, nor late meanwhile [LIM-2, FRM-5]": [
        (0.0, feed(REQUEST[:5]), [], LATE),
        (0.0, queue(FULL_BYTES + 100), [], LATE),
        (1.0, take(1), [], 1.0 + STALLED),
        (2.0, feed(REQUEST[5:] + REQUEST[:5]), [], 1.0 + STALLED),
        (5.0, take(98), [], 5.0 + STALLED),
        (9.0, take(1), ["GetViewportSize"], 9.0 + STALLED),
        (9.0, take(ALL), [], 9.0 + LATE),
    ],
    "a packet begins with its first byte, not with the end of a rest [FRM-5, CHN-9]": [
        (0.0, queue(FULL_BYTES + 1), [], math.inf),
        (0.0, take(0), [], STALLED),
        (1.0, take(ALL), [], math.inf),
    ],
    "who sends long packets rests [FRM-2]": [
        (1.0, feed(long_pose(LONGEST) + REQUEST + REQUEST[:5]), ["CameraPose"], RESTED),
        (RESTED, EXPIRE, ["GetViewportSize"], RESTED + LATE),
        (
            RESTED + LATE,
            feed(REQUEST[5:] + long_pose(LONG_BYTES) + REQUEST),
            ["GetViewportSize", "CameraPose", "GetViewportSize"],
            math.inf,
        ),
    ],
    "a request that takes time and a rest end apart": [
        (0.0, feed(long_pose(LONG_BYTES + 1) + REQUEST + REQUEST[:5]), ["CameraPose"], -1.0),
        (0.0, hold, [], -1.0),
        (1.0, EXPIRE, [], math.inf),
        (60.0, GO_ON, ["GetViewportSize"], 60.0 + LATE),
    ],
    "who has had more than its share is not late meanwhile": [
        (0.0, feed(REQUEST[:5]), [], LATE),
        (1.0, lambda connection, now: connection.charge(1.0, 0, now), [], -1.0),
        (LATE + 1.0, feed(REQUEST[5:]), [], -1.0),
        (50.0, EXPIRE, ["GetViewportSize"], math.inf),
    ],
    "who is ended can read the last words [NEG-34]": [
        (0.0, feed(packet(hello()) + bytes(4)), ["Hello", "malformed_packet"], math.inf),
        (2.0, take(ALL), [], 2.0 + LINGER_SECONDS),
        (2.5, feed(REQUEST), [], 2.0 + LINGER_SECONDS),
        (2.0 + LINGER_SECONDS, EXPIRE, [], "FRM-3"),
    ],
}
"""Moments, deeds, the events after each, and the deadline then (−1: whatever it is), or the end."""


@pytest.mark.parametrize(
    "timeline", [pytest.param(rows, id=name) for name, rows in TIMELINES.items()]
)
def test_when_it_happens(timeline: list[tuple[float, Deed, list[str], float | str]]) -> None:
    connection = Connection("msg", OPEN, 0.0)
    for now, deed, expected, then in timeline:
        deed(connection, now)
        assert events(connection, now) == expected
        if isinstance(then, str):
            assert then in str(connection.ending)
            assert connection.over or connection.deadline == now + LINGER_SECONDS

        else:
            assert then in (-1.0, connection.deadline)


def test_a_guarded_server_awaits_hello_for_ten_seconds() -> None:
    """[NEG-12]"""
    silent, greeting = (Connection("ipc", GUARDED, 100.0) for _ in range(2))
    assert silent.deadline == 100.0 + LIMITS["hello_seconds"]
    silent.expire(silent.deadline)
    assert "NEG-12" in str(silent.ending)
    greeting.receive(packet(hello(token="secret")), 101.0)
    assert events(greeting, 101.0) == ["Hello"]
    assert greeting.deadline == math.inf
