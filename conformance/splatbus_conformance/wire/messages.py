"""Messages that the harness sends when it plays the server or a client, as plain objects.

Written from the specification alone; the wire package is not used.
"""

import base64
import json
import time
from collections.abc import Collection
from itertools import cycle
from typing import Any

from splatbus_conformance.wire import message_kinds

Json = dict[str, Any]

EXAMPLE_HANDLE = base64.b64encode(
    b"splatbus-conformance: a handle that nobody can open, 64 bytes :-".ljust(64, b".")
)
CAPABILITIES = {
    "ipc": ("host_shm", "frames", "reinit", "subscribe"),
    "msg": message_kinds.CAPABILITIES["msg"],
}
SERIES: tuple[Json, ...] = (
    {"kind": "scalar", "value": 3.5, "unit": "ms"},
    {"kind": "histogram", "edges": [0.0, 0.5, 1.0], "counts": [120, 880]},
    {"kind": "text", "value": "at rest"},
)
"""One of each kind, without its name."""
NAMES = ("render_ms", "opacity", "stage")


def encode(message: Json) -> bytes:
    """The payload of a message, without white space."""
    return json.dumps(message, separators=(",", ":"), allow_nan=False).encode()


def init_packet_1_0(width: int = 64, height: int = 48) -> Json:
    """A 1.0 init packet with CUDA handles that no device knows (spec 1.0 chapter 4)."""
    handle = EXAMPLE_HANDLE.decode()
    return {
        "meta": {
            "w": width,
            "h": height,
            "fmtColor": "RGBA32F",
            "pitchColor": 16 * width,
            "fmtDepth": "R32F",
            "pitchDepth": 4 * width,
            "offsetColor": 0,
            "offsetDepth": 16 * width * height,
            "device": 0,
        },
        "mem_color": handle,
        "mem_depth": handle,
        "evt_done": handle,
    }


def ring_bytes(width: int, height: int, slots: int) -> int:
    """Bytes that `init_packet_1_1` announces for a ring."""
    depth_stride = -(-4 * width * height // 16) * 16
    return slots * (16 * width * height + depth_stride)


def init_packet_1_1(
    name: str, generation: int, width: int = 64, height: int = 48, slots: int = 3
) -> Json:
    """A 1.1 init packet for host memory (spec 1.1 chapter 3)."""
    color_stride = 16 * width * height
    depth_stride = -(-4 * width * height // 16) * 16
    return {
        "version": "1.1",
        "generation": generation,
        "meta": {
            "w": width,
            "h": height,
            "fmtColor": "RGBA32F",
            "pitchColor": 16 * width,
            "fmtDepth": "R32F",
            "pitchDepth": 4 * width,
        },
        "memory": {"kind": "host_shm", "name": name, "bytes": ring_bytes(width, height, slots)},
        "ring": {
            "slots": slots,
            "colorOffset": 0,
            "colorStride": color_stride,
            "depthOffset": slots * color_stride,
            "depthStride": depth_stride,
        },
        "semantics": {
            "rows": "bottom_up",
            "alpha": "straight",
            "colorSpace": "srgb",
            "depth": {"kind": "planar_z", "estimator": "expected", "empty": "inf"},
            "unitMetres": None,
            "origin": [0.0, 0.0, 0.0],
        },
    }


def hello(capabilities: list[str], token: str | None = None) -> Json:
    """A `hello` that offers these capabilities (spec 1.1 chapter 2)."""
    added: Json = {} if token is None else {"token": token}
    return {
        "type": "hello",
        "versions": ["1.1", "1.0"],
        "client": {"name": "splatbus-conformance", "version": "1.1"},
        "capabilities": capabilities,
        **added,
    }


def camera_pose(
    position: tuple[float, ...] = (0.0, 0.0, 0.0),
    rotation: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0),
    kind: str = "camera_pose",
) -> Json:
    """A pose with position x, y, z and rotation x, y, z, w (spec 1.0 chapter 6)."""
    return {
        "type": kind,
        "position": dict(zip("xyz", position, strict=True)),
        "rotation": dict(zip("xyzw", rotation, strict=True)),
    }


def welcome(channel: str, offered: list[str], version: str = "1.1") -> Json:
    """The answer to a `hello` that offered these capabilities (NEG-6, NEG-7)."""
    return {
        "type": "welcome",
        "version": version,
        "server": {"name": "splatbus-conformance", "version": version},
        "capabilities": [name for name in CAPABILITIES[channel] if name in offered],
    }


def intrinsics(width: int = 64, height: int = 48) -> Json:
    """The lens of the harness (spec 1.1 section 6.2)."""
    return {
        "fx": float(width),
        "fy": float(width),
        "cx": width / 2,
        "cy": height / 2,
        "width": width,
        "height": height,
        "near": 0.01,
        "far": 100.0,
    }


LISTED = (None, (), ("default",), ("default", "o" * 64, "ö"))
"""Objects at rest that a frame may list, which means the same as if it did not (OBJ-7)."""


def frame(
    generation: int,
    seq: int,
    slot: int,
    width: int = 64,
    height: int = 48,
    objects: Collection[str] | None = None,
) -> Json:
    """A `frame` (spec 1.1 section 5.1), with these objects listed at rest."""
    pose = {"position": [0.0, 0.0, -4.0], "rotation": [0.0, 0.0, 0.0, 1.0]}
    rest = {"position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0], "scale": 1.0}
    listed = [{"object": name, **rest} for name in objects or ()]
    return {
        "type": "frame",
        "generation": generation,
        "seq": seq,
        "slot": slot,
        "camera": {**pose, **intrinsics(width, height)},
        **({} if objects is None else {"objects": listed}),
        "time": 0.0,
        "renderedAt": time.monotonic(),
    }


def error(code: str, **members: Any) -> Json:
    """An `error` (spec 1.1 section 2.5)."""
    return {"type": "error", "code": code, "message": "says the harness", **members}


def telemetry(seq: int, names: Collection[str] = NAMES) -> Json:
    """A `telemetry` with a series of each name, of one kind after the other (spec 1.1 annex A)."""
    series = [{"name": name, **each} for name, each in zip(names, cycle(SERIES), strict=False)]
    return {"type": "telemetry", "seq": seq, "time": time.monotonic(), "series": series}


def reply(
    request: Json, *, typed: bool, width: int = 64, height: int = 48, lens: bool = False
) -> Json | None:
    """The reply to a request (spec 1.0 section 6.2, 1.1 section 2.6); None if it is no request.

    Args:
        request: as it came.
        typed: the connection has received `welcome`.
        width: of the images, in pixels.
        height: of the images, in pixels.
        lens: its `welcome` lists `intrinsics`.
    """
    kind = request.get("type")
    if kind not in (message_kinds.REQUESTS if typed else message_kinds.REQUESTS_1_0):
        return None
    answer = _answer(request, width, height)
    if not typed:
        return answer
    name: Json = {"id": request["id"]} if "id" in request else {}
    more: Json = {"intrinsics": intrinsics(width, height)} if lens and "position" in answer else {}
    return {"type": message_kinds.REPLY_TO[str(kind)], **name, **answer, **more}


def says_of(generation: object, kind: str) -> Json:
    """What a client says of memory: `opened`, `closed`, or `open_failed`, which has a reason."""
    reason = {"reason": "to see what comes then"} if kind == "open_failed" else {}
    return {"type": kind, "generation": generation, **reason}


def _answer(request: Json, width: int, height: int) -> Json:
    match request["type"]:
        case "get_camera_pose":
            return {"position": [0.5, -0.25, -4.0], "rotation": [0.0, 0.6, 0.0, 0.8]}
        case "get_scene":
            return _scene()
        case "ping":
            return {"t": request.get("t"), "serverTime": time.monotonic()}
    return {"viewport_size": [width, height]}


def _scene() -> Json:
    box = {"min": [-4.0, -2.0, -4.0], "max": [4.0, 1.0, 4.0]}
    return {
        "objects": [
            {"id": "default", "name": "Garden", "gaussians": 1_200_000, "bounds": box},
            {"id": "chair", "name": "", "gaussians": 0, "bounds": None},
        ],
        "timeRange": [0.0, 2.5],
        "cameras": 2,
        "origin": [0.0, 0.0, 0.0],
    }
