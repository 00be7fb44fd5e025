"""What a message is meant to be, and where in it numbers belong.

A judge must know what a broken message was meant for, to name the requirement that it breaks.
"""

import re
from typing import Any

from splatbus_conformance.recording import Channel, Direction

Shape = Any
"""A tree of members with NUMBER at its leaves; a list stands for an array of any length."""
NUMBER = "number"

POSES = ("camera_pose", "point_cloud_pose")
REQUESTS = ("get_viewport_size", "get_camera_pose")
CLIENT_1_0 = (*POSES, *REQUESTS)
CLIENT_1_1 = ("hello", "opened", "open_failed", "closed", "release", "subscribe")
SERVER_1_1 = ("welcome", "error", "frame")
CAPABILITIES = {"ipc": ("host_shm", "cuda_ipc", "frames", "reinit", "subscribe"), "msg": ()}
CLOSING_ERRORS = (
    *("malformed_packet", "packet_too_large", "unsupported_version"),
    *("unauthorized", "too_many_clients"),
)
OTHER_ERRORS = (
    *("malformed_json", "not_an_object", "unknown_type", "invalid_message", "invalid_rotation"),
    *("invalid_number", "unsupported", "busy", "internal"),
)
REPLIES = ("viewport_size", "camera")
INIT_MEMBERS = ("meta", "mem_color", "mem_depth", "evt_done", "memory", "ring", "semantics")

_LETTERS = re.compile("[^a-z]")
_BY_LETTERS = {_LETTERS.sub("", name): name for name in CLIENT_1_0}

_XYZ = dict.fromkeys("xyz", NUMBER)
_POSE: Shape = {
    "timestamp": NUMBER,
    "position": _XYZ,
    "rotation": {**_XYZ, "w": NUMBER},
}
_CAMERA: Shape = {"position": [NUMBER], "rotation": [NUMBER]}
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
        "camera": {
            **_CAMERA,
            **dict.fromkeys(("fx", "fy", "cx", "cy", "width", "height", "near", "far"), NUMBER),
        },
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
_WITH_ID = (*REQUESTS, *REPLIES, "error")


def kind_of(channel: Channel, direction: Direction, value: dict[str, Any]) -> str | None:
    """What a message is meant to be, by its type or else by its members; None if nothing known.

    Messages of a client have the name of their type; those of a server are `init_packet`,
    `welcome`, `error`, `frame`, and the replies `viewport_size` and `camera`.
    """
    return _from_client(value) if direction == "c2s" else _from_server(channel, value)


def shape_of(kind: str | None, *, negotiated: bool) -> Shape:
    """Where numbers belong in a message of this kind; an `id` counts after `welcome` only."""
    shape = _SHAPES.get(kind or "", {})
    return {**shape, "id": NUMBER} if negotiated and kind in _WITH_ID else shape


def _from_client(value: dict[str, Any]) -> str | None:
    kind = value.get("type")
    if isinstance(kind, str):
        if kind in CLIENT_1_0 or kind in CLIENT_1_1:
            return kind
        if near := _BY_LETTERS.get(_LETTERS.sub("", kind.lower())):
            return near
    if "position" in value and "rotation" in value:
        return "camera_pose"
    return "get_camera_pose" if "cam_idx" in value else None


def _from_server(channel: Channel, value: dict[str, Any]) -> str | None:
    kind = value.get("type")
    if kind in SERVER_1_1:
        return str(kind)
    if channel == "ipc":
        untyped = not isinstance(kind, str)
        meant = "meta" in value or (untyped and any(name in value for name in INIT_MEMBERS))
        return "init_packet" if meant else None
    if "viewport_size" in value:
        return "viewport_size"
    if "position" in value or "rotation" in value:
        return "camera"
    return str(kind) if kind in REPLIES else None
