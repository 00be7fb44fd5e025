"""The wire against the examples of the prose, and those that were written by hand from it."""

import json
import re
from typing import Any

import pytest
from splatbus_schemas import VERSIONS, InvalidExample, ValidExample, examples, names, prose
from splatbus_schemas.validation import violations
from splatbus_wire.framing import encode_packet
from splatbus_wire.messages import (
    Channel,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Message,
    Ping,
    decode_from_client,
    decode_from_server_ipc,
    decode_from_server_message,
    encode,
)

from tests.wire.payloads import payload_of, refusal, with_value

IPC_MESSAGES = {"hello", "opened", "open_failed", "closed", "release", "subscribe"}
FROM_SERVER_IPC = {"init_packet", "welcome", "error", "frame"}
REPLIES = {
    "viewport_size": GetViewportSize,
    "viewport_size_reply": GetViewportSize,
    "camera": lambda identifier: GetCameraPose(0, identifier),
    "camera_pose_reply": lambda identifier: GetCameraPose(0, identifier),
    "scene": GetScene,
    "pong": lambda identifier: Ping(0.0, identifier),
}
FROM_SERVER_MESSAGE = {*REPLIES, "telemetry"}
CODES = {
    "JSN-1": "not_an_object",
    "POS-2": "invalid_number",
    "POS-3": "invalid_rotation",
    "NEG-9": "unknown_type",
    "INI-11": "unknown_type",
}
MESSAGES = [(name, version) for version in VERSIONS for name in names(version)]
VALID = [(*message, example) for message in MESSAGES for example in examples(*message)[0]]
INVALID = [(*message, example) for message in MESSAGES for example in examples(*message)[1]]
UNORDERED = ("channels", "names")
WITH_MORE = re.compile("JSN-7|ignored|mean nothing|later version")
"""Examples with members that have no meaning, and are not sent again."""
SHOWN = [(version, example) for version in VERSIONS for example in prose.examples(version)]


def decode_example(name: str, message: object, *, said_hello: bool) -> Message:
    payload = json.dumps(message).encode()
    if name in FROM_SERVER_IPC:
        return decode_from_server_ipc(payload)
    if name in FROM_SERVER_MESSAGE:
        identifier = message.get("id") if isinstance(message, dict) else None
        return decode_from_server_message(payload, REPLIES.get(name, GetScene)(identifier))
    channel: Channel = "ipc" if name in IPC_MESSAGES else "msg"
    return decode_from_client(payload, channel, said_hello=said_hello)


def label(value: object) -> str | None:
    if isinstance(value, prose.Example):
        return value.name
    return value.why if isinstance(value, ValidExample | InvalidExample) else None


def message_of(example: prose.Example, version: str) -> str:
    """The message that an example shows: `init_packet_cuda` is an `init_packet`."""
    return max((name for name in names(version) if example.name.startswith(name)), key=len)


@pytest.mark.parametrize(("version", "example"), SHOWN, ids=label)
def test_what_the_prose_shows_is_what_is_sent(version, example):
    shown = json.loads(example.payload)
    said_hello = version == "1.1"
    message = decode_example(message_of(example, version), shown, said_hello=said_hello)
    sent = encode(message, typed_replies=said_hello)
    # One example spells its numbers as a deployed program does, with more digits than they need.
    spelt_briefly = json.dumps(shown, separators=(",", ":"), ensure_ascii=False).encode()
    assert sent == encode_packet(spelt_briefly)
    assert sent == example.packet or example.name == "camera_pose_reply"


def sent_again(name: str, message: Message, version: str) -> Any:
    """What is sent of a message that was taken: it is valid, and means the same."""
    said_hello = version == "1.1"
    sent = json.loads(payload_of(encode(message, typed_replies=said_hello)))
    assert violations(sent, name, version) == []
    assert decode_example(name, sent, said_hello=said_hello) == message
    return sent


def spelt_out(message: Any) -> Any:
    """With what is meant where nothing is said, and what has no order in one."""
    ordered = {name: sorted(message[name]) for name in UNORDERED if message.get(name)}
    if message.get("type") == "object_pose":
        return {"scale": 1.0} | message
    if "mem_color" in message:
        return message | {"meta": {"offsetColor": 0, "offsetDepth": 0} | message["meta"]}
    return message | ordered


@pytest.mark.parametrize(("name", "version", "example"), VALID, ids=label)
def test_valid_examples_are_taken_and_survive_the_wire(name, version, example):
    message = decode_example(name, example.message, said_hello=version == "1.1")
    sent = sent_again(name, message, version)
    if not WITH_MORE.search(example.why):
        assert sent == spelt_out(example.message)


def wanted_refusal(name: str, example: InvalidExample) -> tuple[str, str]:
    """What the wire says of an invalid example, which it meets without knowing what it is."""
    message = example.message
    if not isinstance(message, dict):
        return "JSN-1", ""
    if example.pointer == "/type" or (name == "init_packet" and "meta" not in message):
        server = "INI-11" if name in FROM_SERVER_IPC else "NEG-9"
        return server, "/type"
    if name == "init_packet" and example.pointer == "/version" and "version" not in message:
        return "INI-1", "/mem_color"  # it is an init packet of 1.0, which has handles
    return example.requirement, example.pointer


def is_borne(name: str, example: InvalidExample) -> bool:
    """Whether a client takes it although no server may send it."""
    if not isinstance(example.message, dict):
        return False
    found = example.message.get(example.pointer[1:])
    if example.pointer.endswith("/kind"):  # TEL-6: whatever it is called
        return example.why == "a kind of one's own"
    if name == "error":  # NEG-24: whatever its code
        return (example.pointer in ("/code", "/pointer") and isinstance(found, str)) or (
            example.pointer == "/supported"
            and (found is None or example.message["code"] != "unsupported_version")
        )
    return name in ("camera", "viewport_size") and example.pointer == "/type" and found is None


@pytest.mark.parametrize(("name", "version", "example"), INVALID, ids=label)
def test_invalid_examples_are_refused_where_and_why_the_example_says(name, version, example):
    if is_borne(name, example):
        decode_example(name, example.message, said_hello=True)
        return
    error = refusal(decode_example, name, example.message, said_hello=True)
    requirement, pointer = wanted_refusal(name, example)
    assert (error.requirement, error.pointer) == (requirement, pointer)
    assert error.code == CODES.get(requirement, "invalid_message")
    assert len(str(error)) < 200


@pytest.mark.parametrize(
    ("name", "why", "pointer", "value", "requirement", "at"),
    [
        *(
            (name, "intrinsics", "/intrinsics/near", 100.0, "CAM-4", "/intrinsics/far")
            for name in ("camera_pose", "camera")
        ),
        ("frame", "two objects", "/camera/rotation", [0, 0, 0, 0], "POS-3", "/camera/rotation"),
        ("frame", "two objects", "/camera/near", 100, "IMG-1", "/camera/far"),
        ("frame", "two objects", "/objects/0/object", "default", "OBJ-7", "/objects"),
        ("frame", "two objects", "/objects/0/rotation/3", 1.011, "POS-3", "/objects/0/rotation"),
        ("scene", "animated", "/objects/1/id", "default", "SCN-2", "/objects"),
        ("scene", "animated", "/objects/0/id", "garden", "SCN-2", "/objects"),
        ("scene", "animated", "/objects/0/bounds/min/2", 4.5, "SCN-2", "/objects/0/bounds"),
        ("scene", "animated", "/timeRange/1", -2.0, "SCN-2", "/timeRange"),
        ("telemetry", "each kind", "/series/1/name", "render_ms", "TEL-2", "/series"),
        ("telemetry", "each kind", "/series/1/edges/2", 0.5, "TEL-2", "/series/1/edges"),
        ("telemetry", "each kind", "/series/1/counts", [1000], "TEL-2", "/series/1/counts"),
        ("telemetry", "each kind", "/series/1/counts", [1, 2, 3], "TEL-2", "/series/1/counts"),
    ],
)
def test_what_no_schema_can_say_is_refused_too(name, why, pointer, value, requirement, at):
    message = next(each.message for each in examples(name, "1.1")[0] if why in each.why)
    decode_example(name, message, said_hello=True)
    changed = with_value(message, pointer, value)
    error = refusal(decode_example, name, changed, said_hello=True)
    assert (error.requirement, error.pointer) == (requirement, at)
    assert error.code == CODES.get(requirement, "invalid_message")
