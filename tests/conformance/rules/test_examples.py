"""The rules agree with the examples of the schemas, which other hands wrote from the same prose."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from splatbus_conformance.rules import sightings
from splatbus_conformance.wire.json_values import is_version, whole, within
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
    client,
    frame,
    greeting,
    hello,
    ipc,
    msg,
    server,
    session,
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
ASKED: dict[str, Json] = {
    **dict.fromkeys(("viewport_size", "viewport_size_reply"), ASK_SIZE),
    **dict.fromkeys(("camera", "camera_pose_reply"), ASK_CAMERA),
    "scene": {"type": "get_scene"},
    "pong": {"type": "ping"},
    "error": ASK_SIZE,
}
"""What each reply is to."""
UNKNOWN_WITHOUT_TYPE = ("welcome", "frame", "error", "telemetry")


class Example(NamedTuple):
    version: str
    name: str
    why: str
    message: Any
    requirement: str = ""
    pointer: str = ""

    def __str__(self) -> str:
        return f"{self.version} {self.name}: {self.why}"


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
    memory = memory_for(members)
    announced = (*greeting(*ALL), server(memory))
    opened = client(about_generation("opened", memory["generation"]))
    match example.name:
        case "hello":
            return msg(client(message))
        case "welcome":
            version = members.get("version")
            wanted = {"versions": ["1.1", version if is_version(version) else "1.0"]}
            return ipc(client(hello(*ALL) | wanted), server(message))
        case "init_packet" if not negotiated:
            return ipc(server(message))
        case "init_packet":
            if (
                example.pointer != "/memory/handle"
                and within(members, "memory", "kind") == "cuda_ipc"
            ):
                # It is opened by a handle of its own, which some examples leave out.
                message = {**message, "memory": {"handle": HANDLE, **members["memory"]}}
            frames = [] if members.get("ring", "none") == "none" else ["frames"]
            return ipc(*greeting("host_shm", "cuda_ipc", *frames), server(message))
        case "telemetry":
            wish = {"type": "subscribe_telemetry", "names": None}
            return msg(*negotiated, client(wish), server(message))
        case name if name in ASKED:
            number = whole(members.get("id"), 0)
            asked = {"id": 3 if number is None else number} if "id" in members else {}
            asked |= {"t": members.get("t") or 12.5} if name == "pong" else {}
            questions = [client(ASKED[name] | asked)] if asked or name != "error" else []
            return msg(*negotiated, *questions, server(message))
        case "opened" | "open_failed":
            return ipc(*announced, client(message))
        case "closed":
            return ipc(*announced, opened, client(message))
        case "frame":
            return ipc(*announced, opened, server(message))
        case "release":
            lent = frame(members["seq"]) if members.get("seq") in (0, 2**53 - 1) else frame(7)
            return session(server(lent), client(message))
        case "subscribe":
            return session(client(message))
        case _:
            return msg(*negotiated, client(message))


def memory_for(members: Json) -> Json:
    """An init packet with the generation and the size that a message of it has."""
    width = whole(within(members, "camera", "width"), 1, MAX_SIZE) or 320
    height = whole(within(members, "camera", "height"), 1, MAX_SIZE) or 240
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


@pytest.mark.parametrize("example", [*every_example()], ids=str)
def test_an_example_breaks_what_it_says(example: Example) -> None:
    known = requirements("1.1")
    breaches = [it for it in sightings(around(example)) if it.breach]
    found = {it.requirement for it in breaches} - {"EVO-4"}
    found = {it for it in found if example.requirement or known[it].level.startswith("MUST")}
    expected = {example.requirement, *SAME_FAULT.get(example.requirement, ())} - {""}
    if example.name == "init_packet" and example.version == "1.0" and "version" in example.message:
        found = {name for name in found if not name.startswith("MEM")}
    if example.name == "frame" and example.pointer == "/generation":
        found.discard("IMG-2")  # what no init packet had, was not opened either
    if not isinstance(example.message, dict):
        expected = {"JSN-1"}
    elif spells_a_number(example):
        expected = {"JSN-4"}
    elif example.pointer == "/type" and example.name in UNKNOWN_WITHOUT_TYPE:
        expected = found  # without its type, nobody can know what it was meant to be
    elif example.pointer == "/type":
        expected |= {"REQ-14", "EVO-2"}
    assert found <= expected
    assert found or not expected
    if {example.requirement} == found:
        told = breaches[0].pointer
        assert example.pointer.startswith(told) or told.startswith(example.pointer)


def spells_a_number(example: Example) -> bool:
    if example.name == "telemetry" and example.pointer.endswith("/value"):
        return False  # it may be a text
    path = example.pointer[1:].split("/")
    value = within(example.message, *(int(it) if it.isdecimal() else it for it in path))
    return (
        isinstance(value, str)
        and value.replace(".", "", 1).lstrip("-").isdecimal()
        and path[0] not in ("versions", "version", "supported")
    )
