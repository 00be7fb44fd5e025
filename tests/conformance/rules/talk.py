"""Made-up sessions, written as what the peers say in turn."""

import json
from collections.abc import Iterable
from functools import partial
from typing import Any, NamedTuple

from splatbus_conformance.rules import Sighting, sightings
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Direction, Entry, Event
from splatbus_schemas import examples
from splatbus_schemas.requirements import requirements

Json = dict[str, Any]
STEP = 0.01


class Step(NamedTuple):
    """What one side does, and how many seconds after the step before."""

    direction: Direction
    data: bytes | None = None
    event: Event | None = None
    pause: float = STEP


def client(message: Json | bytes, pause: float = STEP) -> Step:
    """The client sends a message, or a payload as it is."""
    return Step("c2s", packet(text(message)), pause=pause)


def server(message: Json | bytes, pause: float = STEP) -> Step:
    """The server sends a message, or a payload as it is."""
    return Step("s2c", packet(text(message)), pause=pause)


def raw(direction: Direction, data: bytes) -> Step:
    """Bytes that need not be a packet."""
    return Step(direction, data)


def ends(direction: Direction, event: Event = "eof") -> Step:
    """One side ends its stream."""
    return Step(direction, event=event)


CLIENT_ENDS, SERVER_ENDS = ends("c2s"), ends("s2c")


def talk(channel: Channel, *steps: Step, conn: int = 1, start: float = 1.0) -> list[Entry]:
    """The recording of one connection."""
    entries = [Entry(start, channel, conn, event="open")]
    now = start
    for step in steps:
        now += step.pause
        entries.append(Entry(now, channel, conn, step.direction, step.data, step.event))
    return entries


msg, ipc = partial(talk, "msg"), partial(talk, "ipc")


def joined(*recordings: list[Entry]) -> list[Entry]:
    """Several connections in one recording, in time order."""
    return sorted((e for entries in recordings for e in entries), key=lambda entry: entry.t)


def text(message: Json | bytes) -> bytes:
    """The payload of a message."""
    return message if isinstance(message, bytes) else json.dumps(message).encode()


def changed(message: Json, pointer: str, value: Any = ...) -> Json:
    """A copy with the member at a JSON Pointer replaced, or left out."""
    copy: Json = json.loads(json.dumps(message))
    *path, last = pointer.removeprefix("/").split("/")
    place: Any = copy
    for name in path:
        place = place[int(name)] if isinstance(place, list) else place[name]
    key: Any = int(last) if isinstance(place, list) else last
    if value is ...:
        del place[key]
    else:
        place[key] = value
    return copy


def breaches(entries: Iterable[Entry]) -> list[str]:
    """What is broken, as often as it is: requirements, in order, after who broke it if both can."""
    return sorted(named(it) for it in sightings(entries) if it.breach is not None)


def named(sighting: Sighting) -> str:
    """Its requirement, after the peer where it binds both."""
    known = requirements("1.1")[sighting.requirement].binds
    return f"{sighting.peer}:" * (len(known) > 1) + sighting.requirement


# Messages that break nothing

POSE: Json = {
    "type": "camera_pose",
    "timestamp": 12.5,
    "position": {"x": 1.0, "y": -2.0, "z": 5.0},
    "rotation": {"x": 0.0, "y": 0.6, "z": 0.0, "w": 0.8},
}
ASK_SIZE: Json = {"type": "get_viewport_size"}
ASK_CAMERA: Json = {"type": "get_camera_pose", "cam_idx": 0}
SIZE: Json = {"viewport_size": [64, 48]}
CAMERA: Json = {"position": [1.0, 2.0, 3.0], "rotation": [0.0, 0.6, 0.0, 0.8]}

INTRINSICS: Json = {
    "fx": 1500.0,
    "fy": 1500.0,
    "cx": 960.0,
    "cy": 540.0,
    "width": 1920,
    "height": 1080,
    "near": 0.01,
    "far": 100.0,
}
OBJECT_POSE: Json = {**POSE, "type": "object_pose", "object": "chair", "scale": 0.5}
SCENE: Json = changed(examples("scene", "1.1")[0][0].message, "/id")
TELEMETRY: Json = examples("telemetry", "1.1")[0][0].message
PONG: Json = {"type": "pong", "t": 12.5, "serverTime": 1041.375}

HANDLE = "A" * 86 + "=="
INIT: Json = {
    "meta": {
        "w": 64,
        "h": 48,
        "fmtColor": "RGBA32F",
        "pitchColor": 1024,
        "fmtDepth": "R32F",
        "pitchDepth": 256,
        "offsetColor": 0,
        "offsetDepth": 49152,
        "device": 0,
    },
    "mem_color": HANDLE,
    "mem_depth": HANDLE,
    "evt_done": HANDLE,
}
RING: Json = {
    "slots": 3,
    "colorOffset": 0,
    "colorStride": 49152,
    "depthOffset": 147456,
    "depthStride": 12288,
}
ADDED: Json = {
    "version": "1.1",
    "generation": 1,
    "semantics": {
        "rows": "bottom_up",
        "alpha": "straight",
        "colorSpace": "srgb",
        "depth": {"kind": "planar_z", "estimator": "expected", "empty": "inf"},
        "unitMetres": None,
        "origin": [0.0, 0.0, 0.0],
    },
}
HOST_INIT: Json = {
    **ADDED,
    "meta": {k: v for k, v in INIT["meta"].items() if k[:6] not in ("offset", "device")},
    "memory": {"kind": "host_shm", "name": "splatbus-1", "bytes": 184320},
    "ring": RING,
}
UUID = "GPU-01234567-89ab-cdef-0123-456789abcdef"
CUDA_INIT: Json = {
    **ADDED,
    **INIT,
    "memory": {"kind": "cuda_ipc", "deviceUuid": UUID, "handle": HANDLE, "bytes": 184320},
    "ring": {**RING, "events": [HANDLE] * 3},
}
ALL = ["host_shm", "cuda_ipc", "frames", "reinit", "subscribe"]
ALL_MSG = ["intrinsics", "objects", "scene", "viewport", "time", "ping", "telemetry"]
PROGRAM = {"name": "example", "version": "0.1"}


def hello(*capabilities: str) -> Json:
    """A `hello` that lists these capabilities."""
    return {
        "type": "hello",
        "versions": ["1.1", "1.0"],
        "client": PROGRAM,
        "capabilities": list(capabilities),
    }


def welcome(*capabilities: str) -> Json:
    """A `welcome` that lists these capabilities."""
    return {
        "type": "welcome",
        "version": "1.1",
        "server": PROGRAM,
        "capabilities": list(capabilities),
    }


def error(code: str, **members: Any) -> Json:
    """An `error`."""
    return {"type": "error", "code": code, "message": "no", **members}


def about_generation(kind: str, generation: int = 1, **members: Any) -> Json:
    """`opened`, `open_failed`, `closed` or `release`; of a `reason`, what has none has none."""
    if kind != "open_failed":
        members.pop("reason", None)
    return {"type": kind, "generation": generation, **members}


def frame(seq: int = 1, generation: int = 1) -> Json:
    """A `frame` in the ring of `HOST_INIT`."""
    return {
        "type": "frame",
        "generation": generation,
        "seq": seq,
        "slot": 0,
        "camera": {
            "position": [0.0, 0.0, -4.0],
            "rotation": [0.0, 0.0, 0.0, 1.0],
            "fx": 300.0,
            "fy": 300.0,
            "cx": 32.0,
            "cy": 24.0,
            "width": 64,
            "height": 48,
            "near": 0.01,
            "far": 100.0,
        },
        "time": 0.0,
        "renderedAt": 1.25,
    }


OPENED = client(about_generation("opened"))
GREETING = (client(hello()), server(welcome()))
"""Of a message connection."""


def greeting(*capabilities: str) -> tuple[Step, Step]:
    """Of an IPC connection on which both sides have these capabilities."""
    return client(hello(*capabilities)), server(welcome(*capabilities))


def session(*steps: Step, capabilities: Iterable[str] = ALL, conn: int = 1) -> list[Entry]:
    """An IPC connection on which memory was announced and opened."""
    opened = (*greeting(*capabilities), server(HOST_INIT), OPENED)
    return talk("ipc", *opened, *steps, conn=conn)
