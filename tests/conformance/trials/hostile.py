"""Messages with a value that nobody expects, in each place where a peer can put one."""

import json
from collections.abc import Iterator
from typing import Any

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    ASK_SIZE,
    CAMERA,
    CUDA_INIT,
    HOST_INIT,
    INIT,
    INTRINSICS,
    OBJECT_POSE,
    PONG,
    POSE,
    SCENE,
    SIZE,
    TELEMETRY,
    Json,
    about_generation,
    error,
    frame,
    hello,
    welcome,
)

VALUES = {
    "nothing": None,
    "null": "null",
    "true": "true",
    "zero": "0",
    "five": "5",
    "negative": "-1",
    "huge": "9" * 299,
    "the largest": "1e308",
    "beyond single precision": "4e38",
    "1e400": "1e400",
    "-1e400": "-1e400",
    "NaN": "NaN",
    "5,000 digits": "9" * 5000,
    "no text": '""',
    "NUL": '"\\u0000"',
    "half a pair": '"\\ud800"',
    "digits": '"' + "9" * 400 + '"',
    "no items": "[]",
    "lists in lists": "[[[[[0]]]]]",
    "strange items": '[null,{},1e400,"\\ud800",true,[]]',
    "no members": "{}",
    "an object": '{"x":{"type":[]}}',
}
"""By what it is: its text; None to leave the member out."""
_HERE = "\N{WHITE SQUARE}"

_CAPABILITIES = ("host_shm", "frames", "reinit", "subscribe")
_ON_MSG = ("intrinsics", "objects", "scene", "viewport", "time", "ping", "telemetry")
_IMAGE: Json = {**frame(), "camera": {**frame()["camera"], "tag": "a"}, "objects": [OBJECT_POSE]}
FROM_CLIENT: dict[str, tuple[str, Json]] = {
    "hello": ("ipc", {**hello(*_CAPABILITIES), "token": "secret"}),
    "hello on the message channel": ("msg", hello(*_ON_MSG)),
    "opened": ("ipc", about_generation("opened")),
    "open_failed": ("ipc", about_generation("open_failed", reason="no")),
    "closed": ("ipc", about_generation("closed")),
    "release": ("ipc", about_generation("release", seq=1)),
    "subscribe": ("ipc", {"type": "subscribe", "streams": ["color"]}),
    "camera_pose": ("msg", {**POSE, "tag": "a", "intrinsics": INTRINSICS}),
    "point_cloud_pose": ("msg", {**POSE, "type": "point_cloud_pose"}),
    "object_pose": ("msg", OBJECT_POSE),
    "set_time": ("msg", {"type": "set_time", "time": 1.0}),
    "get_viewport_size": ("msg", {**ASK_SIZE, "id": 1, "timestamp": 1.0}),
    "get_camera_pose": ("msg", {**ASK_CAMERA, "id": 1}),
    "get_scene": ("msg", {"type": "get_scene", "id": 1}),
    "set_viewport": ("msg", {"type": "set_viewport", "width": 32, "height": 16, "id": 1}),
    "ping": ("msg", {"type": "ping", "t": 1.0, "id": 1}),
    "subscribe_telemetry": ("msg", {"type": "subscribe_telemetry", "names": ["render_ms"]}),
}
"""The channel and a good message of each kind that a client sends."""
FROM_SERVER: dict[str, tuple[str, Json]] = {
    "welcome": ("ipc", welcome(*_CAPABILITIES)),
    "welcome on the message channel": ("msg", welcome(*_ON_MSG)),
    "an error": ("msg", error("internal", id=1, pointer="/id", supported=["1.1"])),
    "an error on the IPC channel": ("ipc", error("unauthorized")),
    "an init packet of 1.0": ("ipc", INIT),
    "an init packet of host memory": ("ipc", HOST_INIT),
    "an init packet of CUDA memory": ("ipc", CUDA_INIT),
    "frame": ("ipc", _IMAGE),
    "viewport_size of 1.0": ("msg", SIZE),
    "camera of 1.0": ("msg", CAMERA),
    "viewport_size": ("msg", {"type": "viewport_size", "id": 1, **SIZE}),
    "camera": ("msg", {"type": "camera", "id": 1, **CAMERA, "intrinsics": INTRINSICS}),
    "scene": ("msg", {**SCENE, "id": 1}),
    "pong": ("msg", {**PONG, "id": 1}),
    "telemetry": ("msg", TELEMETRY),
}
"""The same of a server."""


def spoiled(message: Json) -> Iterator[bytes]:
    """Payloads that differ from a good one in one place, at whatever depth: in each a third of the
    values, in the next another.
    """
    for number, path in enumerate(_paths(message)):
        for value in list(VALUES.values())[number % 3 :: 3]:
            yield _with(message, path, value)


def _paths(value: Any) -> Iterator[tuple[str | int, ...]]:
    names: list[str | int] = []
    if isinstance(value, dict):
        names = list(value)
    elif isinstance(value, list):
        names = list(range(min(len(value), 2)))
    for name in names:
        yield (name,)
        yield from ((name, *path) for path in _paths(value[name]))


def _with(message: Json, path: tuple[str | int, ...], value: str | None) -> bytes:
    copy = json.loads(json.dumps(message))
    place = copy
    for name in path[:-1]:
        place = place[name]
    if value is None:
        del place[path[-1]]
        return json.dumps(copy).encode()
    place[path[-1]] = _HERE
    return json.dumps(copy, ensure_ascii=False).replace(f'"{_HERE}"', value).encode()
