"""What a message is meant to be, and where in it numbers belong.

A judge must know what a broken message was meant for, to name the requirement that it breaks.
"""

import re
from typing import Any

from splatbus_conformance.wire.recording import Channel, Direction

Shape = Any
"""A tree of members with NUMBER at its leaves; a list stands for an array of any length."""
NUMBER = "number"

KNOWN_VERSIONS = {"1.0", "1.1"}
POSES = ("camera_pose", "point_cloud_pose")
REQUESTS_1_0 = ("get_viewport_size", "get_camera_pose")
CLIENT_1_0 = (*POSES, *REQUESTS_1_0)
REPLY_TO = {
    "get_viewport_size": "viewport_size",
    "get_camera_pose": "camera",
    "get_scene": "scene",
    "set_viewport": "viewport_size",
    "ping": "pong",
}
"""Each request, and the type of its reply after `welcome`."""
REQUESTS, REPLIES = tuple(REPLY_TO), tuple(dict.fromkeys(REPLY_TO.values()))
_ON_MSG = ("object_pose", "set_time", "get_scene", "set_viewport", "ping", "subscribe_telemetry")
CLIENT_1_1 = ("hello", "opened", "open_failed", "closed", "release", "subscribe", *_ON_MSG)
ADDED_MEMBERS = {
    "camera_pose": ("tag", "intrinsics"),
    "get_viewport_size": ("id",),
    "get_camera_pose": ("id",),
}
"""What 1.1 adds to messages of 1.0."""


def newer(message: dict[str, Any]) -> set[str]:
    """What 1.0 does not define of a client's message on the message channel, `hello` aside: its
    type, or members of it.
    """
    kind = str(message.get("type"))
    if kind not in (*CLIENT_1_0, "hello"):
        return {kind}
    return message.keys() & set(ADDED_MEMBERS.get(kind, ()))


SERVER_1_1 = ("welcome", "error", "frame", "telemetry")
CAPABILITIES = {
    "ipc": ("host_shm", "cuda_ipc", "frames", "reinit", "subscribe"),
    "msg": ("intrinsics", "objects", "scene", "viewport", "time", "ping", "telemetry"),
}
NEEDS = {
    "closed": "reinit",
    "release": "frames",
    "subscribe": "subscribe",
    "object_pose": "objects",
    "get_scene": "scene",
    "set_viewport": "viewport",
    "set_time": "time",
    "ping": "ping",
    "subscribe_telemetry": "telemetry",
}
"""The capability that a message of a client belongs to."""
CLOSING_ERRORS = (
    *("malformed_packet", "packet_too_large", "unsupported_version"),
    *("unauthorized", "too_many_clients"),
)
OTHER_ERRORS = (
    *("malformed_json", "not_an_object", "unknown_type", "invalid_message", "invalid_rotation"),
    *("invalid_number", "unsupported", "unknown_object", "busy", "internal"),
)
INIT_MEMBERS = ("meta", "mem_color", "mem_depth", "evt_done", "memory", "ring", "semantics")

_VENDORS_NAME = re.compile(r"(x-[a-z0-9_]+)-[a-z0-9_]+")
_LETTERS = re.compile("[^a-z]")
_BY_LETTERS = {_LETTERS.sub("", name): name for name in (*CLIENT_1_0, *_ON_MSG)}
_SIGNS = {
    "viewport_size": "viewport_size",
    "timeRange": "scene",
    "serverTime": "pong",
    "position": "camera",
    "rotation": "camera",
}
"""Members that give a reply away whose type does not."""

_XYZ = dict.fromkeys("xyz", NUMBER)
_POSE: Shape = {
    "timestamp": NUMBER,
    "position": _XYZ,
    "rotation": {**_XYZ, "w": NUMBER},
}
_CAMERA: Shape = {"position": [NUMBER], "rotation": [NUMBER]}
_INTRINSICS: Shape = dict.fromkeys(
    ("fx", "fy", "cx", "cy", "width", "height", "near", "far"), NUMBER
)
_SHAPES: dict[str, Shape] = {
    "camera_pose": _POSE,
    "point_cloud_pose": _POSE,
    "get_viewport_size": {"timestamp": NUMBER},
    "get_camera_pose": {"timestamp": NUMBER, "cam_idx": NUMBER},
    "opened": {"generation": NUMBER},
    "open_failed": {"generation": NUMBER},
    "closed": {"generation": NUMBER},
    "release": {"generation": NUMBER, "seq": NUMBER},
    "viewport_size": {"viewport_size": [NUMBER]},
    "camera": _CAMERA,
    "frame": {
        **dict.fromkeys(("generation", "seq", "slot", "time", "renderedAt"), NUMBER),
        "camera": {**_CAMERA, **_INTRINSICS},
        "objects": [{**_CAMERA, "scale": NUMBER}],
    },
    "object_pose": {**_POSE, "scale": NUMBER},
    "set_time": {"time": NUMBER},
    "get_scene": {},
    "set_viewport": {"width": NUMBER, "height": NUMBER},
    "ping": {"t": NUMBER},
    "scene": {
        "objects": [{"gaussians": NUMBER, "bounds": {"min": [NUMBER], "max": [NUMBER]}}],
        "timeRange": [NUMBER],
        "cameras": NUMBER,
        "origin": [NUMBER],
    },
    "pong": {"t": NUMBER, "serverTime": NUMBER},
    "telemetry": {
        "seq": NUMBER,
        "time": NUMBER,
        "series": [{"edges": [NUMBER], "counts": [NUMBER]}],
    },
    "init_packet": {
        "generation": NUMBER,
        "meta": dict.fromkeys(
            ("w", "h", "pitchColor", "pitchDepth", "offsetColor", "offsetDepth", "device"), NUMBER
        ),
        "memory": {"bytes": NUMBER},
        "ring": dict.fromkeys(
            ("slots", "colorOffset", "colorStride", "depthOffset", "depthStride"), NUMBER
        ),
        "semantics": {"depth": {"empty": NUMBER}, "unitMetres": NUMBER, "origin": [NUMBER]},
    },
}
_AFTER_WELCOME: dict[str, Shape] = {
    **{kind: {"id": NUMBER} for kind in (*REQUESTS, *REPLIES, "error")},
    "camera_pose": {"intrinsics": _INTRINSICS},
    "camera": {"id": NUMBER, "intrinsics": _INTRINSICS},
}
"""Members that mean something after `welcome` only."""


def kind_of(channel: Channel, direction: Direction, value: dict[str, Any]) -> str | None:
    """What a message is meant to be, by its type or else by its members; None if nothing known.

    All have the name of their type, but `init_packet`, which has none.
    """
    return _from_client(value) if direction == "c2s" else _from_server(channel, value)


def shape_of(kind: str | None, *, negotiated: bool) -> Shape:
    """Where numbers belong in a message of this kind, which is one after `welcome` or not."""
    shape = _SHAPES.get(kind or "", {})
    return {**shape, **_AFTER_WELCOME.get(kind or "", {})} if negotiated else shape


def vendor(name: str) -> str | None:
    """The `x-` and the name of a vendor with which a name of theirs begins; None if it is none."""
    found = _VENDORS_NAME.fullmatch(name)
    return found and found[1]


def _from_client(value: dict[str, Any]) -> str | None:
    kind = value.get("type")
    if isinstance(kind, str):
        if kind in CLIENT_1_0 or kind in CLIENT_1_1:
            return kind
        if near := _BY_LETTERS.get(_LETTERS.sub("", kind.lower())):
            return near
    if "position" in value and "rotation" in value:
        return "object_pose" if "object" in value else "camera_pose"
    return "get_camera_pose" if "cam_idx" in value else None


def _from_server(channel: Channel, value: dict[str, Any]) -> str | None:
    kind = value.get("type")
    if kind in SERVER_1_1:
        return str(kind)
    if channel == "ipc":
        untyped = not isinstance(kind, str)
        meant = "meta" in value or (untyped and any(name in value for name in INIT_MEMBERS))
        return "init_packet" if meant else None
    given_away = [reply for sign, reply in _SIGNS.items() if sign in value]
    if kind in REPLIES and (kind in given_away or not given_away):
        return str(kind)
    return next(iter(given_away), None)
