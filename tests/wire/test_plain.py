"""The short ways take a message as the careful way does, or leave it to that."""

import json
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_wire import from_client, from_server
from splatbus_wire.errors import ProtocolError
from splatbus_wire.fields import Field
from splatbus_wire.json_text import parse_object
from splatbus_wire.messages import (
    Message,
    message_object,
)
from splatbus_wire.plain_frames import plain_frame
from splatbus_wire.plain_poses import plain_pose

from tests.wire import strategies

POSE = (
    b'{"type":"camera_pose","timestamp":1.5,"position":{"x":1.0,"y":-2.0,"z":5.0},'
    b'"rotation":{"x":0.6,"y":0.0,"z":-0.0,"w":0.8},"tag":"7c1f-41"}'
)
UNTAGGED = POSE.replace(b',"tag":"7c1f-41"', b"")
FRAME = (
    b'{"type":"frame","generation":1,"seq":7,"slot":2,"camera":{"position":[0.5,-2.0,-4.0],'
    b'"rotation":[0.0,0.6,-0.0,0.8],"fx":300.0,"fy":301.0,"cx":160.0,"cy":120.0,"width":320,'
    b'"height":240,"near":0.01,"far":100.0,"tag":"a-1"},"objects":[{"object":"default","position":'
    b'[0.1,0.0,4.0],"rotation":[0.0,0.0,0.0,1.0],"scale":2.0},{"object":"chair","position":'
    b'[1.1,0.0,4.0],"rotation":[0.0,0.0,0.0,1.0],"scale":0.5}],"time":1.5,"renderedAt":1041.25}'
)
BARE_FRAME = re.sub(rb',"tag":"a-1"|,"objects".*\]', b"", FRAME)
PLAIN = [
    POSE,
    UNTAGGED,
    POSE.replace(b"camera_pose", b"point_cloud_pose"),
    # as the deployed clients of Python and Unity write them
    b'{"type": "camera_pose", "position": {"x": 1, "y": -0, "z": 5.5},'
    b' "rotation": {"x": 0.0, "y": 0, "z": 0, "w": 1}}',
    b'{"type":"camera_pose","timestamp":0.045418000717113685,"position":{"x":1.0,"y":-0.0,'
    b'"z":5.5},"rotation":{"x":-0.0,"y":1e-7,"z":0E+0,"w":1.0}}',
    FRAME,
    BARE_FRAME,
]
VALUE = re.compile(rb'(?<=[:\[,])(-?[\d.]+|"[^"]*")(?=[,\]}])')
"""A number or a string that is no name."""
IN_ITS_PLACE = [
    *(b"NaN", b"Infinity", b"null", b"true", b'"1.5"', b"1e400", b"-1e999", b"9" * 400, b"1e-400"),
    *(b"+1", b"01", b"-02.0", b"2.", b".5", b"- 2", b"2e", b"1_0", "١".encode(), b"2.0", b"2e0"),
    *(b"0", b"-1", b"0.0", b"1.5", b"100.0", b"100.5", b"3.5e38", b"-3.5e38"),
    *(b"9007199254740991", b"9007199254740992", b"1023", b"1024", b"32768", b"32769"),
    *(b'""', b'"' + b"t" * 64 + b'"', b'"' + b"t" * 65 + b'"', b'"default"', b'"frames"'),
    *(b'"a\tb"', b'"\\"', b'"\\u0061"', '"é"'.encode(), b'"a'),
]
DAMAGE = [
    *((rb'^\{"type"', b'\xef\xbb\xbf{"type"'), (rb'^\{"type"', b'\xa0{"type"')),
    *((rb"$", b"\0"), (rb"$", b"{}"), (rb"\}$", b""), (rb"\}", b",}")),
    (rb'("\w+":)([^,{\[]+)', rb"\1\2,\1\2"),
    *((rb'"x":', b'"y":'), (rb'"time"', b'"tims"'), (rb'("seq":7),("slot":2)', rb"\2,\1")),
]


def in_short(payload: bytes) -> Message | None:
    return plain_frame(payload) or plain_pose(payload)


def with_care(payload: bytes) -> Message | None:
    """What the careful way makes of a payload, None if it refuses."""
    try:
        message = Field(parse_object(payload), "", "")
        kind = message.member("type").value
        if kind == "frame":
            return from_server.frame(message)
        return from_client.on_message_channel(kind, message)
    except ProtocolError:
        return None


def assert_agreement(payload: bytes) -> None:
    assert in_short(payload) in (None, with_care(payload)), payload


@given(
    strategies.plain_poses | strategies.plain_frames,
    st.sampled_from([(",", ":"), (", ", ": "), ("\n,\t", " :\r\n")]),
)
def test_every_spacing_of_a_plain_message_is_taken(message, separators):
    payload = json.dumps(message_object(message), separators=separators).encode()
    assert in_short(payload) == in_short(b" \n" + payload + b"\t ") == message
    assert repr(in_short(payload)) == repr(message)  # −0.0 equals 0.0, and 1 equals 1.0
    assert_agreement(payload)


@pytest.mark.parametrize("payload", PLAIN)
def test_what_is_sent_most_is_plain_and_nothing_that_is_wrong_in_one_place(payload):
    assert in_short(payload) is not None
    assert_agreement(payload)
    damage = [(VALUE, other.replace(b"\\", rb"\\")) for other in IN_ITS_PLACE] + DAMAGE
    for pattern, other in damage:
        for found in re.finditer(pattern, payload):
            start, end = found.span()
            assert_agreement(payload[:start] + found.expand(other) + payload[end:])


@pytest.mark.parametrize("text", [b'{"type":"frame",' * 9, b"1" * 100_000, b" " * 100_000])
def test_a_hostile_text_costs_no_time(text):
    for payload in (text, FRAME[:-1] + text, BARE_FRAME.replace(b"[0.5", b"[" + text)):
        assert in_short(payload) is None
