"""Messages survive the wire; what each end makes of what it does not know, or cannot know yet."""

import json

import pytest
from splatbus_schemas import examples
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
    decode_from_client,
    decode_from_server_ipc,
    decode_from_server_message,
    encode,
)

from tests.wire.payloads import payload, payload_of, refusal, with_value

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


def test_before_hello_alone_a_pose_may_spell_numbers_as_strings():
    message = POSE | {"position": ORIGIN | {"x": "-0.5"}, "rotation": UP | {"w": "1.0e0"}}
    assert early(payload(message)) == CameraPose(AT_REST._replace(position=(-0.5, 0.0, 0.0)))
    assert refusal(late, payload(message)).requirement == "POS-1"


@pytest.mark.parametrize(
    ("decode", "kind", "swapped"),
    [
        *(
            (late, kind, kind == "opened")
            for kind in ("opened", "wave", "telemetry", "x" * 100_000)
        ),
        *((on_ipc, kind, True) for kind in ("set_time", "camera_pose", "get_viewport_size")),
        *((early, kind, False) for kind in ("object_pose", "set_time", "subscribe_telemetry")),
        *((asked, kind, False) for kind in ("wave", 1, None, [])),
        (decode_from_server_ipc, None, False),
    ],
)
def test_a_type_that_is_not_spoken_there_is_named_and_whether_ports_seem_swapped(
    decode, kind, swapped
):
    more = {"generation": 1, "viewport_size": [1, 1], "meta": {}}
    error = refusal(decode, payload(POSE | more | {"type": kind}))
    assert (error.code, error.pointer) == ("unknown_type", "/type")
    assert ("ports swapped?" in str(error)) is swapped
    assert len(str(error)) < 200


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
