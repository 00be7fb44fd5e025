"""The rules agree with the examples of the schemas, which other hands wrote from the same prose."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from splatbus_conformance.wire.json_values import is_version, whole
from splatbus_conformance.wire.recording import Entry
from splatbus_schemas import LIMITS, VERSIONS, examples, names
from splatbus_schemas.requirements import requirements

from tests.conformance.rules.talk import (
    ALL,
    ALL_MSG,
    ASK_CAMERA,
    ASK_SIZE,
    HANDLE,
    HOST_INIT,
    Json,
    about_generation,
    breaches,
    client,
    first_breach,
    frame,
    greeting,
    hello,
    server,
    session,
    talk,
)

MAX_SIZE = LIMITS["max_image_size"]
SAME_FAULT = {
    "POS-1": {"OBJ-1"},
    "POS-2": {"POS-1", "REQ-5", "IMG-1", "OBJ-1", "OBJ-7"},
    "CAM-3": {"IMG-1"},
    "OPN-1": {"OPN-13"},
    "OPN-3": {"OPN-13"},
    "OPN-5": {"OPN-13"},
    "OPN-11": {"OPN-13"},
    "NEG-6": {"NEG-30"},
    "NEG-7": {"NEG-30"},
    "NEG-30": {"NEG-7"},
    "MEM-1": {"OPN-13", "IMG-1", "IMG-12"},
    "MEM-7": {"MEM-2"},
    "IMG-1": {"IMG-12"},
    "NEG-27": {"NEG-28", "NEG-23"},
}
"""A schema names what its part of a message serves; a rule names what binds the sender of it."""


class Example(NamedTuple):
    version: str
    name: str
    why: str
    message: Any
    requirement: str = ""
    pointer: str = ""


def every_example() -> Iterator[Example]:
    for version in VERSIONS:
        for name in names(version):
            valid, invalid = examples(name, version)
            yield from (Example(version, name, e.why, e.message) for e in valid)
            yield from (
                Example(version, name, e.why, e.message, e.requirement, e.pointer) for e in invalid
            )


def around(example: Example) -> list[Entry]:
    """A session in which nothing but the message can be wrong."""
    message, members = example.message, example.message
    members = members if isinstance(members, dict) else {}
    capabilities = [c for c in ALL_MSG if c != "intrinsics" or c in members]
    negotiated = greeting(*capabilities) if example.version == "1.1" else ()
    number = whole(members.get("id"), 0)
    asked = {"id": 3 if number is None else number} if "id" in members else {}
    match example.name:
        case "hello":
            return talk("msg", client(message))
        case "welcome":
            version = members.get("version")
            wanted = {"versions": ["1.1", version if is_version(version) else "1.0"]}
            greeted = hello(*ALL) | wanted
            return talk("ipc", client(greeted), server(message))
        case "init_packet" if not negotiated:
            return talk("ipc", server(message))
        case "init_packet":
            message = with_handle(message) if example.pointer != "/memory/handle" else message
            frames = [] if members.get("ring", "none") == "none" else ["frames"]
            return talk("ipc", *greeting("host_shm", "cuda_ipc", *frames), server(message))
        case "viewport_size" | "viewport_size_reply":
            return talk("msg", *negotiated, client({**ASK_SIZE, **asked}), server(message))
        case "camera" | "camera_pose_reply":
            return talk("msg", *negotiated, client({**ASK_CAMERA, **asked}), server(message))
        case "scene":
            return talk("msg", *negotiated, client({"type": "get_scene", **asked}), server(message))
        case "pong":
            ping = {"type": "ping", "t": members.get("t") or 12.5, **asked}
            return talk("msg", *negotiated, client(ping), server(message))
        case "telemetry":
            wish = {"type": "subscribe_telemetry", "names": None}
            return talk("msg", *negotiated, client(wish), server(message))
        case "error":
            questions = [client({**ASK_SIZE, **asked})] if asked else []
            return talk("msg", *negotiated, *questions, server(message))
        case "opened" | "open_failed":
            return talk("ipc", *greeting(*ALL), server(memory_for(members)), client(message))
        case "closed":
            memory = memory_for(members)
            opened = client(about_generation("opened", memory["generation"]))
            return talk("ipc", *greeting(*ALL), server(memory), opened, client(message))
        case "frame":
            opened = client(about_generation("opened", memory_for(members)["generation"]))
            steps = (server(memory_for(members)), opened, server(message))
            return talk("ipc", *greeting(*ALL), *steps)
        case "release":
            lent = frame(members["seq"]) if members.get("seq") in (0, 2**53 - 1) else frame(7)
            return session(server(lent), client(message))
        case "subscribe":
            return session(client(message))
        case _:
            return talk("msg", *negotiated, client(message))


def with_handle(message: Any) -> Any:
    """Memory of CUDA is opened by a handle of its own, which some examples leave out."""
    memory = message.get("memory") if isinstance(message, dict) else None
    if isinstance(memory, dict) and memory.get("kind") == "cuda_ipc":
        return {**message, "memory": {"handle": HANDLE, **memory}}
    return message


def memory_for(members: Json) -> Json:
    """An init packet with the generation and the size that a message of it has."""
    camera = members.get("camera")
    camera = camera if isinstance(camera, dict) else {}
    width = whole(camera.get("width"), 1, MAX_SIZE) or 320
    height = whole(camera.get("height"), 1, MAX_SIZE) or 240
    color, depth = 16 * width * height, 4 * width * height
    return {
        **HOST_INIT,
        "generation": whole(members.get("generation"), 1) or 1,
        "meta": HOST_INIT["meta"]
        | {"w": width, "h": height, "pitchColor": 16 * width, "pitchDepth": 4 * width},
        "memory": HOST_INIT["memory"] | {"bytes": 1024 * (color + depth) + 16384},
        "ring": {
            "slots": 1024,
            "colorOffset": 0,
            "colorStride": color,
            "depthOffset": 1024 * color,
            "depthStride": -(-depth // 16) * 16,
        },
    }


EXAMPLES = list(every_example())


def title(example: Example) -> str:
    return f"{example.version} {example.name}: {example.why}"


@pytest.mark.parametrize("example", [e for e in EXAMPLES if not e.requirement], ids=title)
def test_valid_examples_break_nothing(example: Example) -> None:
    known = requirements("1.1")
    found = {name for _, name in breaches(around(example)) if known[name].level.startswith("MUST")}
    if example.name == "init_packet" and example.version == "1.0" and "version" in example.message:
        found = {name for name in found if not name.startswith("MEM")}
    assert not found


@pytest.mark.parametrize("example", [e for e in EXAMPLES if e.requirement], ids=title)
def test_invalid_examples_break_what_they_say(example: Example) -> None:
    expected = {example.requirement, *SAME_FAULT.get(example.requirement, ())}
    found = {requirement for _, requirement in breaches(around(example))} - {"EVO-4"}
    if example.name == "frame" and example.pointer == "/generation":
        found.discard("IMG-2")  # what no init packet had, was not opened either
    if not isinstance(example.message, dict):
        expected = {"JSN-1"}
    elif spells_a_number(example):
        expected = {"JSN-4"}
    elif example.pointer == "/type" and example.name in ("welcome", "frame", "error", "telemetry"):
        expected = found  # without its type, nobody can know what it was meant to be
    elif example.pointer == "/type":
        expected |= {"REQ-14", "EVO-2"}
    assert found <= expected
    assert found or not expected
    if {example.requirement} == found:
        told = first_breach(around(example)).pointer
        assert example.pointer.startswith(told) or told.startswith(example.pointer)


def spells_a_number(example: Example) -> bool:
    if example.name == "telemetry" and example.pointer.endswith("/value"):
        return False  # it may be a text
    value = example.message
    for name in example.pointer[1:].split("/"):
        value = value[int(name)] if isinstance(value, list) else value.get(name)
    return (
        isinstance(value, str)
        and value.replace(".", "", 1).lstrip("-").isdecimal()
        and (example.pointer.split("/")[1] not in ("versions", "version", "supported"))
    )
