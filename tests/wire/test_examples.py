"""The wire against the examples of the prose, and those that were written by hand from it."""

import json

import pytest
from splatbus_schemas import VERSIONS, InvalidExample, ValidExample, examples, names, prose
from splatbus_wire.errors import ProtocolError
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
MESSAGES = [(name, version) for version in VERSIONS for name in names(version)]
VALID = [(*message, example) for message in MESSAGES for example in examples(*message)[0]]
INVALID = [(*message, example) for message in MESSAGES for example in examples(*message)[1]]
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


@pytest.mark.parametrize(("name", "version", "example"), VALID, ids=label)
def test_valid_examples_are_taken(name, version, example):
    decode_example(name, example.message, said_hello=version == "1.1")


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
    with pytest.raises(ProtocolError) as caught:
        decode_example(name, example.message, said_hello=True)
    assert (caught.value.requirement, caught.value.pointer) == wanted_refusal(name, example)
    assert len(str(caught.value)) < 200
