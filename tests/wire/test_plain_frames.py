import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_wire import from_server
from splatbus_wire.errors import ProtocolError
from splatbus_wire.fields import Field
from splatbus_wire.json_text import parse_object
from splatbus_wire.messages import Frame, Placement, decode_from_server_ipc, message_object
from splatbus_wire.plain_frames import plain_frame

from tests.wire import strategies
from tests.wire.payloads import edited

PLAIN = (
    b'{"type":"frame","generation":1,"seq":7,"slot":2,"camera":{"position":[0.5,-2.0,-4.0],'
    b'"rotation":[0.0,0.6,-0.0,0.8],"fx":300.0,"fy":301.0,"cx":160.0,"cy":120.0,"width":320,'
    b'"height":240,"near":0.01,"far":100.0,"tag":"a-1"},"objects":[{"object":"default","position":'
    b'[0.1,0.0,4.0],"rotation":[0.0,0.0,0.0,1.0],"scale":2.0},{"object":"chair","position":'
    b'[1.1,0.0,4.0],"rotation":[0.0,0.0,0.0,1.0],"scale":0.5}],"time":1.5,"renderedAt":1041.25}'
)
SHORT = PLAIN[: PLAIN.index(b',"objects"')].replace(b',"tag":"a-1"', b"") + (
    b',"time":1.5,"renderedAt":1041.25}'
)
names = st.text("abcXYZ0123456789 -_.,:;[]{}()'", min_size=1, max_size=20)
placements = st.lists(
    st.builds(Placement, names, strategies.poses, strategies.positive),
    max_size=3,
    unique_by=lambda placement: placement.object,
).map(tuple)
frames = st.builds(
    lambda frame, tag, objects: frame._replace(
        camera=frame.camera._replace(tag=tag), objects=objects
    ),
    strategies.frames,
    st.none() | names,
    placements,
)


def careful_frame(payload: bytes) -> Frame | None:
    """What the careful way makes of a payload, None if it refuses."""
    try:
        message = Field(parse_object(payload), "", "IMG-1")
        return from_server.frame(message) if message.value.get("type") == "frame" else None
    except ProtocolError:
        return None


@given(frames, st.sampled_from([(",", ":"), (", ", ": "), ("\n,\t", " :\r\n")]))
def test_every_spacing_of_a_plain_frame_is_taken(frame, separators):
    payload = json.dumps(message_object(frame), separators=separators).encode()
    assert plain_frame(payload) == frame == careful_frame(payload)
    assert plain_frame(b" \n" + payload + b"\t ") == frame
    assert decode_from_server_ipc(payload) == frame


@pytest.mark.parametrize("payload", [PLAIN, SHORT])
def test_what_the_reference_server_sends_is_plain(payload):
    found = plain_frame(payload)
    assert found is not None
    assert found == careful_frame(payload)
    assert repr(found) == repr(careful_frame(payload))  # -0.0 equals 0.0, and 1 equals 1.0


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"1041.25", b"NaN"),
        (b"1041.25", b"1e400"),
        (b"1041.25", b"null"),
        (b"1041.25", b'"1041.25"'),
        (b"1.5", b"-1e999"),
        (b'"cx":160.0', b'"cx":-1e999'),
        (b'"cx":160.0', b'"cx":+1.0'),
        (b'"cx":160.0', b'"cx":01.0'),
        (b'"fx":300.0', b'"fx":0.0'),
        (b'"fx":300.0', b'"fx":1e-400'),
        (b'"fy":301.0', b'"fy":-301.0'),
        (b'"fy":301.0', b'"fy":1e400'),
        (b'"near":0.01', b'"near":0.0'),
        (b'"near":0.01', b'"near":100.0'),
        (b'"far":100.0', b'"far":1e400'),
        (b'"generation":1', b'"generation":0'),
        (b'"generation":1', b'"generation":-1'),
        (b'"generation":1', b'"generation":1.5'),
        (b'"generation":1', b'"generation":9007199254740992'),
        (b'"seq":7', b'"seq":9007199254740992'),
        (b'"seq":7', b'"seq":07'),
        (b'"seq":7', b'"seq":-7'),
        (b'"slot":2', b'"slot":1024'),
        (b'"slot":2', b'"slot":true'),
        (b'"width":320', b'"width":0'),
        (b'"width":320', b'"width":32769'),
        (b'"height":240', b'"height":0'),
        (b'"height":240', b'"height":32769'),
        (b"0.5,-2.0", b"3.5e38,-2.0"),
        (b"0.5,-2.0", b"0.5,-3.5e38"),
        (b"0.5,-2.0,-4.0", b"0.5,-2.0"),
        (b"0.5,-2.0,-4.0", b"0.5,-2.0,-4.0,1.0"),
        (b"-0.0,0.8", b"-0.0,0.9"),
        (b"-0.0,0.8", b"-0.0,1e999"),
        (b'"a-1"', b'""'),
        (b'"a-1"', b'"' + b"a" * 65 + b'"'),
        (b'"chair"', b'"default"'),
        (b'"chair"', b'""'),
        (b'"chair"', b'"' + b"a" * 65 + b'"'),
        (b'"scale":0.5', b'"scale":0.0'),
        (b'"scale":0.5', b'"scale":1e400'),
        (b"[1.1,0.0,4.0]", b"[1.1,0.0,3.5e38]"),
        (b"[0.0,0.0,0.0,1.0]", b"[0.0,0.0,0.0,2.0]"),
        (b'"type"', b'"type":"frame","type"'),
        (b'"seq":7', b'"seq":7,"seq":7'),
        (b'"type":"frame"', b'"type":"frames"'),
        (b'{"type"', b'\xef\xbb\xbf{"type"'),
        (b'"time"', b'"tims"'),
        (b"1041.25}", b"1041.25}\0"),
        (b"1041.25}", b"1041.25"),
        (b"1041.25}", b"1041.25,}"),
    ],
)
def test_what_is_wrong_is_not_plain(old, new):
    damaged = PLAIN.replace(old, new, 1)
    assert damaged != PLAIN
    assert plain_frame(damaged) is None
    assert careful_frame(damaged) is None


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b'"slot":2', b'"slot":2.0'),
        (b'"slot":2', b'"slot":2e0'),
        (b'"seq":7,"slot":2', b'"slot":2,"seq":7'),
        (b'"a-1"', '"é"'.encode()),
        (b'"a-1"', b'"\\u0061"'),
        (b'"time":1.5', b'"note":null,"time":1.5'),
        (PLAIN[PLAIN.index(b'{"object":"default"') : PLAIN.index(b'],"time"')], b""),
    ],
)
def test_what_is_not_plain_may_be_right(old, new):
    other = PLAIN.replace(old, new, 1)
    assert other != PLAIN
    assert plain_frame(other) is None
    assert decode_from_server_ipc(other) == careful_frame(other) is not None


@given(edited(PLAIN, SHORT))
@settings(max_examples=500)
def test_the_short_way_takes_nothing_that_the_careful_way_refuses(payload):
    found = plain_frame(payload)
    assert found is None or found == careful_frame(payload)


@pytest.mark.parametrize("text", [b'{"type":"frame",' * 9, b"1" * 100_000, b" " * 100_000])
def test_a_hostile_text_costs_no_time(text):
    assert plain_frame(text) is None
    assert plain_frame(PLAIN[:-1] + text) is None
    assert plain_frame(SHORT.replace(b"[0.5", b"[" + text)) is None
