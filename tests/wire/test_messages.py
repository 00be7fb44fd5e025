import json
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_schemas import VERSIONS, examples, names
from splatbus_schemas.validation import violations
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import (
    CameraPose,
    CameraReply,
    Channel,
    ErrorMessage,
    Frame,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Hello,
    Message,
    Ping,
    Pose,
    Program,
    ViewportSize,
    Welcome,
    decode_from_client,
    decode_from_server_ipc,
    decode_from_server_message,
    encode,
    message_object,
)

from tests.wire import strategies
from tests.wire.payloads import payload, payload_of, refusal

UP = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
ORIGIN = {"x": 0.0, "y": 0.0, "z": 0.0}
POSE = {"type": "camera_pose", "position": ORIGIN, "rotation": UP}
REQUESTS = {
    "viewport_size": GetViewportSize,
    "camera": lambda identifier: GetCameraPose(0, identifier),
    "scene": GetScene,
    "pong": lambda identifier: Ping(0.0, identifier),
}
SCHEMAS = {CameraReply: "camera", ErrorMessage: "error"}


def from_client(message: object, channel: Channel = "msg", *, said_hello: bool = True) -> Message:
    return decode_from_client(payload(message), channel, said_hello=said_hello)


def schema_name(message: Message) -> str:
    """CameraPose is described by `camera_pose`."""
    kind = type(message)
    return SCHEMAS.get(kind) or re.sub(r"\B(?=[A-Z])", "_", kind.__name__).lower()


def assert_valid(message: Message, version: str = "1.1") -> None:
    sent = json.loads(payload_of(encode(message, typed_replies=True)))
    assert violations(sent, schema_name(message), version) == []


# Round trips, each also judged by the schemas


@given(strategies.poses_of_1_0)
def test_poses_of_1_0_survive_the_wire(message):
    for said_hello in (False, True):
        sent = payload_of(encode(message))
        assert decode_from_client(sent, "msg", said_hello=said_hello) == message
    assert_valid(message, "1.0")


@given(strategies.steerings | strategies.requests | strategies.subscriptions)
def test_what_a_client_sends_on_the_message_channel_survives_the_wire(message):
    sent = payload_of(encode(message))
    assert decode_from_client(sent, "msg", said_hello=True) == message
    assert_valid(message)


@given(strategies.requests_of_1_0)
def test_before_hello_a_request_has_no_id(message):
    sent = payload_of(encode(message))
    without_id = message._replace(id=None)
    assert decode_from_client(sent, "msg", said_hello=False) == without_id


@given(strategies.replies)
def test_replies_survive_the_wire(message):
    request = REQUESTS[schema_name(message)](message.id)
    sent = payload_of(encode(message, typed_replies=True))
    assert decode_from_server_message(sent, request) == message
    assert_valid(message)


@given(strategies.replies_of_1_0)
def test_replies_of_1_0_survive_the_wire_without_their_id(message):
    request = REQUESTS[schema_name(message)](message.id)
    plain = payload_of(encode(message))
    assert "type" not in json.loads(plain)
    assert decode_from_server_message(plain, request) == message._replace(id=None)


@given(strategies.telemetries)
def test_telemetry_survives_the_wire(message):
    sent = payload_of(encode(message))
    for request in (None, GetViewportSize(4)):
        assert decode_from_server_message(sent, request) == message
    assert_valid(message)


@given(strategies.hellos, st.sampled_from(["ipc", "msg"]), st.booleans())
def test_hello_survives_the_wire(message, channel, said_hello):
    sent = payload_of(encode(message))
    assert decode_from_client(sent, channel, said_hello=said_hello) == message
    assert_valid(message)


@given(strategies.ipc_replies)
def test_what_a_client_says_of_memory_survives_the_wire(message):
    sent = payload_of(encode(message))
    assert decode_from_client(sent, "ipc", said_hello=True) == message
    assert_valid(message)


@given(strategies.welcomes | strategies.errors)
def test_welcome_and_error_survive_the_wire_on_both_channels(message):
    sent = payload_of(encode(message))
    assert decode_from_server_ipc(sent) == message
    assert decode_from_server_message(sent, None) == message
    assert decode_from_server_message(sent, GetViewportSize(4)) == message
    assert_valid(message)


@given(strategies.frames)
def test_frames_survive_the_wire(message):
    assert decode_from_server_ipc(payload_of(encode(message))) == message
    assert_valid(message)


def test_members_stand_in_the_order_of_the_specification():
    pose = Pose((1.0, -2.0, 5.0), (-0.1, 0.2, -0.3, 0.9273618495495703))
    assert payload_of(encode(CameraPose(pose, 12.5))) == (
        b'{"type":"camera_pose","timestamp":12.5,"position":{"x":1.0,"y":-2.0,"z":5.0},'
        b'"rotation":{"x":-0.1,"y":0.2,"z":-0.3,"w":0.9273618495495703}}'
    )
    assert payload_of(encode(ViewportSize(1920, 1080, 3))) == b'{"viewport_size":[1920,1080]}'
    assert payload_of(encode(ViewportSize(320, 240, 3), typed_replies=True)) == (
        b'{"type":"viewport_size","id":3,"viewport_size":[320,240]}'
    )


# What a client sends


@pytest.mark.parametrize(
    ("change", "code", "requirement", "pointer"),
    [
        ({"position": ORIGIN | {"y": 1e39}}, "invalid_number", "POS-2", "/position/y"),
        ({"rotation": UP | {"w": 1.011}}, "invalid_rotation", "POS-3", "/rotation"),
        ({"rotation": UP | {"w": 0}}, "invalid_rotation", "POS-3", "/rotation"),
        ({"rotation": UP | {"w": 1e308, "x": 1e308}}, "invalid_rotation", "POS-3", "/rotation"),
    ],
)
def test_a_broken_pose_is_refused_with_code_requirement_and_pointer(
    change, code, requirement, pointer
):
    error = refusal(from_client, POSE | change)
    assert (error.code, error.requirement, error.pointer) == (code, requirement, pointer)


def test_an_error_says_what_is_wrong():
    rotation = {name: UP[name] for name in "xyz"}
    error = refusal(from_client, POSE | {"rotation": rotation})
    assert str(error) == "rotation.w is missing at /rotation/w [POS-1]"
    error = refusal(from_client, POSE | {"position": {"x": "1", "y": 0, "z": 0}})
    assert str(error) == "position.x is a string, not a number at /position/x [POS-1]"


@pytest.mark.parametrize("spelling", ["1", "-0.5", "1.0e-3", "12E+1", "0"])
def test_before_hello_a_pose_may_spell_numbers_as_strings(spelling):
    message = POSE | {"position": ORIGIN | {"x": spelling}, "rotation": UP | {"w": "1.0"}}
    decoded = from_client(message, said_hello=False)
    assert decoded == CameraPose(Pose((float(spelling), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    assert refusal(from_client, message, said_hello=True).requirement == "POS-1"


@pytest.mark.parametrize(
    "spelling",
    ["", " 1", "1 ", "1_0", "nan", "Infinity", "0x1", "+1", ".5", "1.", "01", "١", "1e400", "1e39"],
)
def test_a_string_that_is_no_number_in_json_is_refused(spelling):
    message = POSE | {"position": ORIGIN | {"x": spelling}}
    assert refusal(from_client, message, said_hello=False).pointer == "/position/x"


def test_only_poses_may_spell_numbers_as_strings():
    request = {"type": "get_camera_pose", "cam_idx": "0"}
    assert refusal(from_client, request, said_hello=False).pointer == "/cam_idx"


@pytest.mark.parametrize("identifier", [-1, 1.5, 2**53, "3", None, True])
def test_an_id_counts_only_after_hello(identifier):
    request = {"type": "get_viewport_size", "id": identifier}
    assert from_client(request, said_hello=False) == GetViewportSize()
    error = refusal(from_client, request, said_hello=True)
    assert (error.requirement, error.pointer) == ("NEG-27", "/id")


def test_integers_may_have_a_fraction_of_zero():
    request = {"type": "get_camera_pose", "cam_idx": -64.0, "id": 3e0}
    decoded = from_client(request)
    assert decoded == GetCameraPose(-64, 3)
    assert type(decoded.cam_idx) is type(decoded.id) is int


@pytest.mark.parametrize(
    ("channel", "kind", "said_hello", "requirement"),
    [
        ("msg", "opened", True, "NEG-9"),
        ("msg", "wave", False, "REQ-8"),
        ("msg", "wave", True, "NEG-9"),
        ("msg", 1, False, "REQ-8"),
        ("msg", None, False, "REQ-8"),
        ("msg", "object_pose", False, "REQ-8"),
        ("msg", "ping", False, "REQ-8"),
        ("msg", "telemetry", True, "NEG-9"),
        ("ipc", "set_time", True, "NEG-9"),
        ("msg", ["hello"], False, "REQ-8"),
        ("msg", "x" * 100_000, False, "REQ-8"),
        ("ipc", "camera_pose", True, "NEG-9"),
        ("ipc", "get_viewport_size", False, "NEG-9"),
    ],
)
def test_a_type_that_the_channel_does_not_know_is_unknown(channel, kind, said_hello, requirement):
    error = refusal(from_client, POSE | {"type": kind}, channel, said_hello=said_hello)
    assert (error.code, error.requirement) == ("unknown_type", requirement)
    assert error.pointer == "/type"
    assert len(str(error)) < 200


@pytest.mark.parametrize("channel", ["ipc", "msg"])
@pytest.mark.parametrize("said_hello", [False, True])
def test_a_message_without_type_is_unknown(channel, said_hello):
    assert refusal(from_client, {}, channel, said_hello=said_hello).code == "unknown_type"


def test_a_token_is_not_logged():
    hello = Hello(("1.1",), Program("a", "1"), (), "secret")
    assert "secret" not in repr(hello)
    assert "token=None" in repr(hello._replace(token=None))


# Hostile input


templates = st.sampled_from(
    [
        example.message
        for version in VERSIONS
        for name in names(version)
        for example in examples(name, version)[0]
    ]
)


@given(templates.flatmap(strategies.damaged).map(payload) | st.binary(max_size=60), st.booleans())
@settings(max_examples=300)
def test_whatever_comes_is_a_message_or_a_refusal(sent, said_hello):
    decoders = [
        lambda: decode_from_client(sent, "ipc", said_hello=said_hello),
        lambda: decode_from_client(sent, "msg", said_hello=said_hello),
        lambda: decode_from_server_ipc(sent),
        lambda: decode_from_server_message(sent, None),
        lambda: decode_from_server_message(sent, GetViewportSize(3)),
        lambda: decode_from_server_message(sent, GetCameraPose(0)),
        lambda: decode_from_server_message(sent, GetScene(9)),
        lambda: decode_from_server_message(sent, Ping(12.5, 5)),
    ]
    for decode in decoders:
        try:
            message = decode()
        except ProtocolError as error:
            assert len(str(error)) < 1024  # noqa: PT017
        else:
            assert isinstance(message_object(message), dict)


@given(strategies.frames)
def test_a_number_that_is_not_finite_is_never_encoded(frame: Frame):
    error = refusal(encode, frame._replace(time=float("nan")))
    assert (error.requirement, error.pointer) == ("JSN-4", "/time")


def test_what_does_not_fit_a_packet_is_never_encoded():
    error = refusal(encode, Welcome("1.1", Program("x" * 2**20, ""), ()))
    assert error.requirement == "FRM-2"
