"""A server of SplatBus 1.0 on asyncio that takes three seconds to load its scene.

It serves one client at a time on the message channel. A further one waits for two seconds for the
place, and is closed if it does not become free. Its images are in no CUDA memory, so nothing is
sent on the IPC channel (CHN-5).
"""

import asyncio
import contextlib
import json
import math
import os
import re
import struct
import time

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
IPC_PORT = int(os.environ.get("SPLATBUS_IPC_PORT", "6001"))
MSG_PORT = int(os.environ.get("SPLATBUS_MSG_PORT", "6000"))
SIZE = [640, 480]
CAMERAS = [
    ([0.0, 0.0, -4.0], [0.0, 0.0, 0.0, 1.0]),
    ([1.25, -0.5, -3.0], [0.0, 0.6, 0.0, 0.8]),
    ([-1.0153546333312988, 1.998, -2.5], [0.5, -0.5, 0.5, 0.5]),
]
LARGEST = 1 << 20
DEEPEST = 64
SAFE = 2**53 - 1
FLOAT_MAX = 3.4028234663852886e38
COMPLETE_SECONDS = 10.0
SEND_SECONDS = 5.0
PLACE_SECONDS = 2.0
MOST_WAITING = 4
MOST_READERS = 8


class Refused(Exception):
    """What arrived is no message."""


def no_constant(name):
    raise Refused(name)


def members(pairs):
    found = dict(pairs)
    if len(found) != len(pairs):
        raise Refused("a name twice")
    return found


def finite(text):
    value = float(text)
    if not math.isfinite(value):
        raise Refused(text)
    return value


def integer(text):
    finite(text)
    return int(text)


def understood(payload):
    """The object in a payload, by JSN-1 to JSN-5."""
    text = payload.decode("utf-8")
    depth = deepest = 0
    for bracket in re.findall(r"[][{}]", re.sub(r'"(?:[^"\\]|\\.)*"', "", text, flags=re.S)):
        depth += 1 if bracket in "[{" else -1
        deepest = max(deepest, depth)
    if deepest > DEEPEST:
        raise Refused("too deep")
    value = json.loads(
        text,
        object_pairs_hook=members,
        parse_constant=no_constant,
        parse_float=finite,
        parse_int=integer,
    )
    json.dumps(value, ensure_ascii=False).encode("utf-8")  # half a surrogate pair fails here
    if not isinstance(value, dict):
        raise Refused("no object")
    return value


def is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def numbers(value, names):
    if not isinstance(value, dict) or not all(is_number(value.get(name)) for name in names):
        raise Refused("a member of a pose")
    return [float(value[name]) for name in names]


class Scene:
    """Where camera and Gaussians are, by the client that has control."""

    def __init__(self):
        self.poses = {}

    def apply(self, message):
        position = numbers(message.get("position"), "xyz")
        rotation = numbers(message.get("rotation"), "xyzw")
        if any(abs(each) > FLOAT_MAX for each in position):
            raise Refused("beyond single precision")
        if abs(math.hypot(*rotation) - 1.0) > 0.01:
            raise Refused("no rotation")
        self.poses[message["type"]] = position, rotation


def reply_to(message, scene):
    kind = message.get("type")
    if kind in ("camera_pose", "point_cloud_pose"):
        scene.apply(message)
    elif kind == "get_viewport_size":
        return {"viewport_size": SIZE}
    elif kind == "get_camera_pose":
        index = message.get("cam_idx")
        if not is_number(index) or index != int(index) or abs(index) > SAFE:
            raise Refused("cam_idx")
        position, rotation = CAMERAS[int(index) % len(CAMERAS)]
        return {"position": position, "rotation": rotation}
    return None


async def packets(reader):
    """Payload after payload, until the stream ends or cannot be trusted any more."""
    while first := await reader.read(1):
        async with asyncio.timeout(COMPLETE_SECONDS):
            (length,) = struct.unpack("<I", first + await reader.readexactly(3))
            if not 1 <= length <= LARGEST:
                return
            payload = await reader.readexactly(length)
        yield payload


async def converse(reader, writer, scene):
    async for payload in packets(reader):
        with contextlib.suppress(Refused, ValueError, RecursionError):
            reply = reply_to(understood(payload), scene)
            if reply is not None:
                said = json.dumps(reply).encode()
                writer.write(struct.pack("<I", len(said)) + said)
        async with asyncio.timeout(SEND_SECONDS):
            await writer.drain()


async def attend(reader, writer, scene=None):
    """Serve one connection to its end; what it does wrong ends that alone."""
    try:
        if scene is None:
            async for _ in packets(reader):
                pass
        else:
            await converse(reader, writer, scene)
    except (TimeoutError, asyncio.IncompleteReadError, OSError):
        writer.transport.abort()
    finally:
        writer.close()


class Server:
    def __init__(self):
        self.place = asyncio.Lock()
        self.waiting = 0
        self.readers = 0
        self.scene = Scene()

    async def message(self, reader, writer):
        if self.waiting >= MOST_WAITING:
            writer.close()
            return
        self.waiting += 1
        try:
            await asyncio.wait_for(self.place.acquire(), PLACE_SECONDS)
        except TimeoutError:
            writer.close()
            return
        finally:
            self.waiting -= 1
        try:
            await attend(reader, writer, self.scene)
        finally:
            self.place.release()

    async def ipc(self, reader, writer):
        if self.readers >= MOST_READERS:
            writer.close()
            return
        self.readers += 1
        try:
            await attend(reader, writer)
        finally:
            self.readers -= 1


async def main():
    server = Server()
    await asyncio.start_server(server.ipc, HOST, IPC_PORT)
    await asyncio.start_server(server.message, HOST, MSG_PORT)
    await asyncio.Event().wait()


time.sleep(3.0)
asyncio.run(main())
