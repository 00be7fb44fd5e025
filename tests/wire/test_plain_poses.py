import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_schemas import LIMITS
from splatbus_wire.errors import ProtocolError
from splatbus_wire.fields import Field
from splatbus_wire.from_client import on_message_channel
from splatbus_wire.json_text import parse_object
from splatbus_wire.messages import (
    CameraPose,
    PointCloudPose,
    Pose,
    decode_from_client,
    message_object,
)
from splatbus_wire.plain_poses import plain_pose

from tests.wire import strategies
from tests.wire.payloads import edited


def careful_pose(payload: bytes) -> CameraPose | PointCloudPose | None:
    """What the careful way makes of a payload, None if it refuses."""
    try:
        message = Field(parse_object(payload), "", "")
        found = on_message_channel(message.member("type").value, message)
    except ProtocolError:
        return None
    return found if isinstance(found, CameraPose | PointCloudPose) else None


plain_tags = st.none() | st.text(
    st.characters(min_codepoint=32, max_codepoint=126, exclude_characters='"\\'),
    min_size=1,
    max_size=LIMITS["max_tag_chars"],
)
plain_poses = st.builds(
    CameraPose, strategies.poses, strategies.timestamps, plain_tags, st.none()
) | st.builds(PointCloudPose, strategies.poses, strategies.timestamps)


@given(plain_poses, st.sampled_from([(",", ":"), (", ", ": "), ("\n,\t", " :\r\n")]))
def test_every_spacing_of_a_plain_pose_is_taken(message, separators):
    payload = json.dumps(message_object(message), separators=separators).encode()
    assert plain_pose(payload) == message == careful_pose(payload)
    assert plain_pose(b" \n" + payload + b"\t ") == message


@pytest.mark.parametrize(
    "payload",
    [
        # as the Python client and Unity's write them
        b'{"type": "camera_pose", "position": {"x": 1, "y": -0, "z": 5.5},'
        b' "rotation": {"x": 0.0, "y": 0, "z": 0, "w": 1}}',
        b'{"type":"camera_pose","timestamp":0.045418000717113685,"position":{"x":1.0,"y":-0.0,'
        b'"z":5.5},"rotation":{"x":-0.0,"y":1e-7,"z":0E+0,"w":1.0}}',
    ],
)
def test_what_deployed_clients_send_is_plain(payload):
    found = plain_pose(payload)
    assert found == careful_pose(payload)
    assert found is not None
    assert found.pose.position == (1.0, 0.0, 5.5)
    assert {type(number) for vector in found.pose for number in vector} == {float}


@given(strategies.steerings)
def test_the_short_way_agrees_with_the_careful_way_or_leaves_it_the_message(message):
    payload = json.dumps(message_object(message), ensure_ascii=False).encode()
    assert plain_pose(payload) in (None, careful_pose(payload))


PLAIN = (
    b'{"type":"camera_pose","timestamp":1.5,"position":{"x":1.0,"y":-2.0,"z":5.0},'
    b'"rotation":{"x":0.6,"y":0.0,"z":-0.0,"w":0.8}}'
)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"1.5", b"NaN"),
        (b"1.5", b"1e400"),
        (b"1.5", b"null"),
        (b"1.5", b'"1.5"'),
        (b"-2.0", b"Infinity"),
        (b"-2.0", b"-02.0"),
        (b"-2.0", b"+2.0"),
        (b"-2.0", b"2."),
        (b"-2.0", b".5"),
        (b"-2.0", b"- 2"),
        (b"-2.0", b"2e"),
        (b"-2.0", b"1_0"),
        (b"-2.0", "١".encode()),
        (b"-2.0", b"9" * 400),
        (b"1.0", b"-3.5e38"),
        (b"-2.0", b"3.5e38"),
        (b"5.0", b"3.5e38"),
        (b"5.0", b"-3.5e38"),
        (b"-2.0", b"true"),
        (b"0.8", b"0.9"),
        (b'"y":-2.0', b'"x":-2.0'),
        (b'"y":-2.0', b'"y":-2.0,"y":-2.0'),
        (b'"w":0.8', b'"w":0.8,"w":0.8'),
        (b'"timestamp":1.5,', b'"timestamp":1.5,"timestamp":1.5,'),
        (b'"type"', b'"type":"camera_pose","type"'),
        (b'{"type"', b'\xef\xbb\xbf{"type"'),
        (b'{"type"', b'\xa0{"type"'),
        (b"camera_pose", b"camera_poses"),
        (b"0.8}}", b"0.8}}\0"),
        (b"0.8}}", b"0.8}}{}"),
        (b"0.8}}", b"0.8}"),
        (b"5.0}", b"5.0,}"),
    ],
)
def test_what_is_wrong_is_not_plain(old, new):
    assert plain_pose(PLAIN) is not None
    damaged = PLAIN.replace(old, new, 1)
    assert damaged != PLAIN
    assert plain_pose(damaged) is None
    assert careful_pose(damaged) is None


def with_tag(tag: bytes, payload: bytes = PLAIN) -> bytes:
    return payload[:-1] + b',"tag":' + tag + b"}"


def test_a_tag_is_taken_and_before_hello_is_none():
    tagged = with_tag(b'"7c1f-41"')
    found = plain_pose(tagged)
    assert isinstance(found, CameraPose)
    assert found.tag == "7c1f-41"
    assert decode_from_client(tagged, "msg", said_hello=True) == found
    untagged = decode_from_client(tagged, "msg", said_hello=False)
    assert untagged == found._replace(tag=None) == plain_pose(PLAIN)


def test_a_tag_of_the_gaussians_has_no_meaning():
    gaussians = PLAIN.replace(b"camera_pose", b"point_cloud_pose")
    tagged = with_tag(b'"7c1f-41"', gaussians)
    assert plain_pose(tagged) == plain_pose(gaussians) == careful_pose(tagged)


@pytest.mark.parametrize(
    "tag",
    [b'""', b'"' + 65 * b"t" + b'"', b'"a\tb"', b'"\\"', b'"\xc3\xbc"', b"41", b"null", b'"a'],
)
def test_any_other_tag_is_left_to_the_careful_way(tag):
    tagged = with_tag(tag)
    assert plain_pose(tagged) is None


@pytest.mark.parametrize("tag", [b'""', b'"' + 65 * b"t" + b'"', b"41", b"null"])
def test_a_bad_tag_is_refused_after_hello_and_ignored_before(tag):
    tagged = with_tag(tag)
    assert careful_pose(tagged) is None
    assert decode_from_client(tagged, "msg", said_hello=False) == plain_pose(PLAIN)


@given(edited(PLAIN, PLAIN.replace(b'"timestamp":1.5,', b""), with_tag(b'"7c1f-41"')))
@settings(max_examples=500)
def test_the_short_way_takes_nothing_that_the_careful_way_refuses(payload):
    found = plain_pose(payload)
    assert found is None or found == careful_pose(payload)


def test_a_pose_in_another_order_is_left_to_the_careful_way():
    payload = (
        b'{"position":{"x":1,"y":2,"z":3},"rotation":{"w":1,"x":0,"y":0,"z":0},'
        b'"type":"camera_pose"}'
    )
    assert plain_pose(payload) is None
    assert careful_pose(payload) == CameraPose(Pose((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0)))
