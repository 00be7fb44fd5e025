"""Messages survive the wire; what each end makes of what it does not know, or cannot know yet."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_schemas import VERSIONS, examples, names
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import (
    DEFAULT_OBJECT,
    CameraPose,
    CameraReply,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Hello,
    Ping,
    Pong,
    Pose,
    Program,
    Scalar,
    Scene,
    SceneObject,
    SetViewport,
    Telemetry,
    Text,
    ViewportSize,
    Welcome,
    decode_from_client,
    decode_from_server_ipc,
    decode_from_server_message,
    encode,
    message_object,
)

from tests.wire.payloads import edited, payload, payload_of, refusal, with_value

UP = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
ORIGIN = {"x": 0.0, "y": 0.0, "z": 0.0}
POSE = {"type": "camera_pose", "position": ORIGIN, "rotation": UP}
AT_REST = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
SCENE = Scene((SceneObject(DEFAULT_OBJECT, "", 0, None),), None, 0, (0.0, 0.0, 0.0), 3)


def from_client(channel, said_hello):
    return lambda sent: decode_from_client(sent, channel, said_hello=said_hello)


def to_asker(request):
    return lambda sent: decode_from_server_message(sent, request)


early, late = from_client("msg", False), from_client("msg", True)
on_ipc = from_client("ipc", True)
unasked, asked = to_asker(None), to_asker(GetViewportSize(4))
every_decoder = [
    *(from_client(channel, said_hello) for channel in ("ipc", "msg") for said_hello in (0, 1)),
    *(decode_from_server_ipc, unasked, asked),
    *map(to_asker, (GetCameraPose(0), GetScene(9), Ping(12.5, 5))),
]


ANSWERS = [
    (ViewportSize(64, 48, 3), GetViewportSize),
    (ViewportSize(64, 48, 3), lambda identifier: SetViewport(1, 1, identifier)),
    (CameraReply(AT_REST, 3), lambda identifier: GetCameraPose(0, identifier)),
    (SCENE, GetScene),
    (Pong(1.0, 2.0, 3), lambda identifier: Ping(1.0, identifier)),
]


@pytest.mark.parametrize(("reply", "request_"), ANSWERS)
def test_a_reply_is_taken_by_the_type_and_the_id_of_what_was_asked(reply, request_):
    sent = payload_of(encode(reply, typed_replies=True))
    assert to_asker(request_(3))(sent) == reply
    for identifier in (None, 4):
        error = refusal(to_asker(request_(identifier)), sent)
        assert (error.requirement, error.pointer) == ("NEG-28", "/id")
    for other, asked_for in ANSWERS:
        if type(other) is not type(reply):
            error = refusal(to_asker(asked_for(3)), sent)
            assert (error.code, error.requirement) == ("invalid_message", "REQ-7")
    error = refusal(unasked, sent)
    assert (error.code, error.requirement) == ("unknown_type", "CHN-11")


@pytest.mark.parametrize(("reply", "request_"), ANSWERS[:3])
def test_a_reply_without_type_is_what_was_asked_for_and_has_no_id(reply, request_):
    plain = json.loads(payload_of(encode(reply)))
    assert "type" not in plain
    sent = payload(plain | {"id": "none", "intrinsics": "none"})
    assert to_asker(request_(3))(sent) == reply._replace(id=None)
    assert refusal(unasked, sent).requirement == "CHN-11"


def test_before_hello_what_1_1_added_is_not_known():
    added = {"tag": 1, "intrinsics": {"fx": "wide"}}
    assert early(payload(POSE | added)) == CameraPose(AT_REST)
    assert refusal(late, payload(POSE | added)).requirement == "CAM-1"
    for identifier in (3, "3"):
        request = payload({"type": "get_viewport_size", "id": identifier})
        assert early(request) == GetViewportSize()


def test_members_stand_in_the_order_of_the_specification():
    pose = Pose((1.0, -2.0, 5.0), (-0.1, 0.2, -0.3, 0.9273618495495703))
    assert payload_of(encode(CameraPose(pose, 12.5))) == (
        b'{"type":"camera_pose","timestamp":12.5,"position":{"x":1.0,"y":-2.0,"z":5.0},'
        b'"rotation":{"x":-0.1,"y":0.2,"z":-0.3,"w":0.9273618495495703}}'
    )
    assert payload_of(encode(ViewportSize(320, 240, 3), typed_replies=True)) == (
        b'{"type":"viewport_size","id":3,"viewport_size":[320,240]}'
    )


@pytest.mark.parametrize("spelling", ["1", "-0.5", "1.0e-3", "12E+1", "0"])
def test_before_hello_a_pose_may_spell_numbers_as_strings(spelling):
    message = POSE | {"position": ORIGIN | {"x": spelling}, "rotation": UP | {"w": "1.0"}}
    assert early(payload(message)) == CameraPose(
        AT_REST._replace(position=(float(spelling), 0.0, 0.0))
    )
    assert refusal(late, payload(message)).requirement == "POS-1"
    request = {"type": "get_camera_pose", "cam_idx": spelling}
    assert refusal(early, payload(request)).pointer == "/cam_idx", "only poses"


@pytest.mark.parametrize(
    "spelling",
    ["", " 1", "1_0", "nan", "+1", ".5", "1.", "01", "١", "1e400", "1e39"],
)
def test_a_string_that_is_no_number_in_json_is_refused(spelling):
    message = POSE | {"position": ORIGIN | {"x": spelling}}
    assert refusal(early, payload(message)).pointer == "/position/x"


@pytest.mark.parametrize(
    ("decode", "kind", "requirement"),
    [
        *((late, kind, "NEG-9") for kind in ("opened", "wave", "telemetry", "welcome")),
        *((on_ipc, kind, "NEG-9") for kind in ("set_time", "camera_pose", "get_viewport_size")),
        *((early, kind, "REQ-8") for kind in ("wave", 1, None, ["hello"], "x" * 100_000)),
        *((early, kind, "REQ-8") for kind in ("object_pose", "set_time", "get_scene", "ping")),
        *((early, kind, "REQ-8") for kind in ("set_viewport", "subscribe_telemetry")),
        *((asked, kind, "NEG-9") for kind in ("wave", 1, None, [])),
        *((decode_from_server_ipc, kind, "INI-11") for kind in ("wave", 1, None, [])),
    ],
)
def test_a_type_that_is_not_spoken_there_is_unknown(decode, kind, requirement):
    more = {"generation": 1, "viewport_size": [1, 1], "meta": {}}
    error = refusal(decode, payload(POSE | more | {"type": kind}))
    assert (error.code, error.requirement) == ("unknown_type", requirement)
    assert error.pointer == "/type"
    assert ("ports swapped?" in str(error)) is (decode is on_ipc or kind == "opened")
    assert len(str(error)) < 200


@pytest.mark.parametrize("decode", every_decoder[:4])
def test_a_message_without_type_is_unknown(decode):
    assert refusal(decode, payload({})).code == "unknown_type"


@pytest.mark.parametrize("kind", ["heat_map", "", "k" * 1000])
def test_a_series_of_an_unknown_kind_is_left_out(kind):
    message = examples("telemetry", "1.1")[0][0].message
    strange = {"name": "x", "kind": kind, "value": []}
    assert unasked(payload(with_value(message, "/series/1", strange))) == Telemetry(
        17, 1041.25, (Scalar("render_ms", 3.5, "ms"), Text("stage", "training"))
    )


@pytest.mark.parametrize(
    ("decode", "message", "told"),
    [
        (
            late,
            POSE | {"rotation": ORIGIN},
            "rotation.w is missing at /rotation/w [POS-1]",
        ),
        (
            late,
            POSE | {"position": ORIGIN | {"x": "1"}},
            "position.x is a string, not a number at /position/x [POS-1]",
        ),
        (
            asked,
            {"type": "error", "code": "busy", "message": "no", "supported": []},
            "supported has 0 items, not 1 or more at /supported [NEG-10]",
        ),
    ],
)
def test_an_error_says_what_is_wrong(decode, message, told):
    assert str(refusal(decode, payload(message))) == told


def test_a_token_is_not_logged():
    hello = Hello(("1.1",), Program("a", "1"), (), "secret")
    assert "secret" not in repr(hello)
    assert "token=None" in repr(hello._replace(token=None))


EXAMPLES = [
    payload(example.message)
    for version in VERSIONS
    for name in names(version)
    for example in examples(name, version)[0]
]


@given(edited(*EXAMPLES) | st.binary(max_size=60))
@settings(max_examples=500)
def test_whatever_comes_is_a_message_or_a_refusal(sent):
    for decode in every_decoder:
        try:
            message = decode(sent)
        except ProtocolError as error:
            assert len(str(error)) < 1024  # noqa: PT017
        else:
            assert isinstance(message_object(message), dict)


@pytest.mark.parametrize(
    ("message", "requirement", "pointer"),
    [
        (Pong(1.0, float("nan")), "JSN-4", "/serverTime"),
        (Welcome("1.1", Program("x" * 2**20, ""), ()), "FRM-2", None),
    ],
)
def test_what_no_packet_can_hold_is_never_encoded(message, requirement, pointer):
    error = refusal(encode, message, typed_replies=True)
    assert (error.requirement, error.pointer) == (requirement, pointer)
