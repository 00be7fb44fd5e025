"""A server of SplatBus 1.1 that sketches a coloured wall into memory of the host."""

import asyncio
import contextlib
import glob
import json
import math
import mmap
import os
import re
import signal
import struct
import time

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
IPC_PORT = int(os.environ.get("SPLATBUS_IPC_PORT", "6001"))
MSG_PORT = int(os.environ.get("SPLATBUS_MSG_PORT", "6000"))
W, H, FOCAL = 32, 24, 30.0
COLOR, DEPTH = 16 * W * H, 4 * W * H
KEPT, READERS = 8, 4
SLOTS = READERS + 2
LARGEST, DEEPEST, SAFE = 1 << 20, 64, 2**53 - 1
NAME = f"splatbus-sketch-{os.getpid()}"
REST = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
CAMERAS = [REST, ((0.5, -0.25, 1.0), (0.0, 0.28, 0.0, 0.96))]
INIT = {
    "version": "1.1",
    "generation": 1,
    "meta": {
        **{"w": W, "h": H, "fmtColor": "RGBA32F", "pitchColor": 16 * W},
        **{"fmtDepth": "R32F", "pitchDepth": 4 * W},
    },
    "memory": {"kind": "host_shm", "name": NAME, "bytes": SLOTS * (COLOR + DEPTH)},
    "ring": {
        **{"slots": SLOTS, "colorOffset": 0, "colorStride": COLOR},
        **{"depthOffset": SLOTS * COLOR, "depthStride": DEPTH},
    },
    "semantics": {
        **{"rows": "bottom_up", "alpha": "straight", "colorSpace": "srgb"},
        "depth": {"kind": "planar_z", "estimator": "median", "empty": "inf"},
        **{"unitMetres": None, "origin": [0, 0, 0]},
    },
}


class Wrong(Exception):
    """An `error`: its code and pointer."""


def number(value, pointer):
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < 1e300:
        raise Wrong("invalid_message", pointer)
    return float(value)


def integer(value, least, pointer):
    if number(value, pointer) != value // 1 or not least <= value <= SAFE:
        raise Wrong("invalid_message", pointer)
    return int(value)


def text(value, least, most, pointer):
    if not isinstance(value, str) or not least <= len(value) <= most:
        raise Wrong("invalid_message", pointer)
    return value


def understood(payload):
    try:
        said = payload.decode("utf-8")
        depth = deepest = 0
        for bracket in re.findall(r"[][{}]", re.sub(r'"(?:[^"\\]|\\.)*"', "", said, flags=re.S)):
            depth += 1 if bracket in "[{" else -1
            deepest = max(deepest, depth)
        if deepest > DEEPEST:
            raise ValueError
        message = json.loads(said)
        json.dumps(message, ensure_ascii=False).encode()
    except ValueError:
        raise Wrong("malformed_json", None) from None
    if not isinstance(message, dict):
        raise Wrong("not_an_object", None)
    return message


def pose_of(message):
    found = []
    for member, names in (("position", "xyz"), ("rotation", "xyzw")):
        value = message.get(member)
        if not isinstance(value, dict) or not all(name in value for name in names):
            raise Wrong("invalid_message", f"/{member}")
        known = [name for name in value if name in names]
        found.append(tuple(number(value[name], f"/{member}/{name}") for name in known))
    if not 0.9 <= math.hypot(*found[1]) <= 1.1:
        raise Wrong("invalid_rotation", "/rotation")
    return tuple(found)


def checked(hello):
    versions, listed = hello.get("versions"), hello.get("capabilities")
    if not isinstance(versions, list) or not 1 <= len(versions) <= 16:
        raise Wrong("invalid_message", "/versions")
    for each in versions:
        if not re.fullmatch(r"(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)", text(each, 1, 64, "/versions"), re.A):
            raise Wrong("invalid_message", "/versions")
    client = hello.get("client")
    for name in ("name", "version"):
        text(client.get(name) if isinstance(client, dict) else None, 0, 64, f"/client/{name}")
    if not isinstance(listed, list) or len(listed) > 64:
        raise Wrong("invalid_message", "/capabilities")
    if len({text(each, 0, 64, "/capabilities") for each in listed}) < len(listed):
        raise Wrong("invalid_message", "/capabilities")
    if "token" in hello:
        text(hello["token"], 1, 256, "/token")
    return versions, listed


def matrix(x, y, z, w):
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return (
        (s / 2 * (w * w + x * x - y * y - z * z), s * (x * y - z * w), s * (x * z + y * w)),
        (s * (x * y + z * w), s / 2 * (w * w - x * x + y * y - z * z), s * (y * z - x * w)),
        (s * (x * z - y * w), s * (y * z + x * w), s / 2 * (w * w - x * x - y * y + z * z)),
    )


def drawn(camera, cloud):
    """A wall at z = 6 in the axes of the object, whose colour is nowhere the same."""
    view, object_ = matrix(*camera[1]), tuple(zip(*matrix(*cloud[1])))
    away = [c - o for c, o in zip(camera[0], cloud[0])]
    px, py, pz = (sum(a * b for a, b in zip(row, away)) for row in object_)
    color, depth = [], []
    for i in range(H):
        for j in range(W):
            d = ((j + 0.5 - W / 2) / FOCAL, (i + 0.5 - H / 2) / FOCAL, 1.0)
            world = [sum(a * b for a, b in zip(row, d)) for row in view]
            x, y, z = (sum(a * b for a, b in zip(row, world)) for row in object_)
            far = (6.0 - pz) / z if z else -1.0
            u, v = px + far * x, py + far * y
            if not (0.01 <= far <= 100.0 and math.isfinite(u + v)):
                color += (0.0, 0.0, 0.0, 0.0)
                depth.append(math.inf)
                continue
            color += (0.5 + 0.5 * math.sin(0.9 * u + 0.2 * v), 0.5 + 0.5 * math.sin(0.7 * v))
            color += (0.5 + 0.5 * math.sin(0.3 * u - 0.5 * v), 1.0)
            depth.append(far)
    return struct.pack(f"<{4 * W * H}f", *color), struct.pack(f"<{W * H}f", *depth)


class Server:
    def __init__(self):
        self.due = asyncio.Event()
        self.due.set()
        self.clients = []
        self.control = []
        self.camera, self.cloud, self.tag = REST, REST, None
        self.newest = None
        for left in glob.glob("/dev/shm/splatbus-sketch-*"):
            if not os.path.exists(f"/proc/{left.rpartition('-')[2]}"):
                with contextlib.suppress(FileNotFoundError):  # another may be as quick
                    os.unlink(left)
        descriptor = os.open(f"/dev/shm/{NAME}", os.O_RDWR | os.O_CREAT | os.O_EXCL)
        os.fchmod(descriptor, 0o644)
        os.posix_fallocate(descriptor, 0, INIT["memory"]["bytes"])
        self.memory = mmap.mmap(descriptor, INIT["memory"]["bytes"])

    async def render(self):
        seq = 0
        while True:
            await self.due.wait()
            self.due.clear()
            taken = {each.lent["slot"] for each in self.clients if each.lent}
            taken |= {self.newest["slot"]} if self.newest else set()
            slot = min(set(range(SLOTS)) - taken)
            color, depth = drawn(self.camera, self.cloud)
            self.memory[slot * COLOR : (slot + 1) * COLOR] = color
            begin = SLOTS * COLOR + slot * DEPTH
            self.memory[begin : begin + DEPTH] = depth
            camera = {"position": self.camera[0], "rotation": self.camera[1], "fx": FOCAL, "fy": FOCAL}
            camera |= {"cx": W / 2, "cy": H / 2, "width": W, "height": H, "near": 0.01, "far": 100.0}
            camera |= {"tag": self.tag} if self.tag else {}
            frame = {"type": "frame", "generation": 1, "seq": seq, "slot": slot, "camera": camera}
            frame |= {"time": 0.0, "renderedAt": time.monotonic()}
            if self.cloud != REST:
                position, rotation = self.cloud
                moved = {"object": "default", "position": position, "rotation": rotation, "scale": 1}
                frame["objects"] = [moved]
            self.newest, seq = frame, seq + 1
            for each in self.clients:
                each.lend()
            await asyncio.sleep(0.001)

    def apply(self, kind, pose, tag):
        if kind == "camera_pose":
            self.camera, self.tag = pose, tag
        else:
            self.cloud = pose
        self.due.set()

    async def accept(self, ipc, reader, writer):
        client = Client(self, ipc, writer)
        if sum(each.ipc == ipc for each in self.clients) >= KEPT:
            writer.close()
            return
        self.clients.append(client)
        try:
            await client.attend(reader)
        except (TimeoutError, asyncio.IncompleteReadError, OSError):
            pass
        finally:
            self.clients.remove(client)
            if client in self.control:
                was_first = self.control[0] is client
                self.control.remove(client)
                if was_first and self.control:
                    for kind, said in self.control[0].poses.items():
                        self.apply(kind, *said)
                    self.control[0].told = False
            if client.ending and not writer.is_closing():
                await client.last_words(reader)
            writer.close()


class Client:
    def __init__(self, server, ipc, writer):
        self.server, self.ipc, self.writer = server, ipc, writer
        self.hello = self.newer = self.ending = self.opened = self.told = False
        self.granted, self.lent, self.seen, self.poses = set(), None, -1, {}

    async def attend(self, reader):
        while not self.ending and (first := await reader.read(1)):
            async with asyncio.timeout(10.0):
                (length,) = struct.unpack("<I", first + await reader.readexactly(3))
                if not 1 <= length <= LARGEST:
                    self.fail("packet_too_large" if length else "malformed_packet", None)
                    self.ending = self.newer
                    return
                payload = await reader.readexactly(length)
            message = {}
            try:
                message = understood(payload)
                self.handle(message.get("type"), message)
            except Wrong as wrong:
                self.fail(*wrong.args, message)
            async with asyncio.timeout(5.0):
                await self.writer.drain()

    async def last_words(self, reader):
        try:
            self.writer.write_eof()
            async with asyncio.timeout(5.0):
                while await reader.read(65536):
                    pass
        except (TimeoutError, OSError):
            pass

    def say(self, message):
        payload = json.dumps(message).encode()
        self.writer.write(struct.pack("<I", len(payload)) + payload)
        if self.writer.transport.get_write_buffer_size() > LARGEST:
            self.writer.transport.abort()

    def fail(self, code, pointer, message=None):
        if self.newer:
            said = {"type": "error", "code": code, "message": f"not so: {code}"}
            self.say(said | ({"pointer": pointer} if pointer else {}))

    def reply(self, kind, members):
        self.say({"type": kind, **members} if self.newer else members)

    def handle(self, kind, message):
        if kind == "hello":
            self.greet(message)
        elif self.ipc:
            self.read(kind, message)
        elif kind in ("camera_pose", "point_cloud_pose"):
            self.pose(kind, message)
        elif kind == "get_viewport_size":
            self.reply("viewport_size", {"viewport_size": [W, H]})
        elif kind == "get_camera_pose":
            index = integer(message.get("cam_idx"), -SAFE, "/cam_idx")
            position, rotation = CAMERAS[index % len(CAMERAS)]
            self.reply("camera", {"position": position, "rotation": rotation})
        else:
            known = ("get_scene", "set_viewport", "ping", "object_pose", "set_time")
            raise Wrong("unsupported" if kind in known else "unknown_type", "/type")

    def greet(self, hello):
        if self.hello:
            raise Wrong("invalid_message", "/type")
        self.hello = self.newer = self.ending = True
        versions, listed = checked(hello)
        version = next((each for each in versions if each in ("1.1", "1.0")), None)
        if version is None:
            said = {"type": "error", "code": "unsupported_version", "message": "1.1 or 1.0"}
            self.say(said | {"supported": ["1.1", "1.0"]})
            return
        self.ending, self.newer = False, version == "1.1"
        if self.newer and self.ipc:
            self.granted = {"host_shm", "frames"} & set(listed)
        said = {"type": "welcome", "version": version, "server": {"name": "sketch", "version": "1"}}
        self.say(said | {"capabilities": sorted(self.granted)})
        if sum("frames" in each.granted for each in self.server.clients) > READERS:
            self.ending = True
            raise Wrong("too_many_clients", None)
        if "host_shm" in self.granted:
            self.say(INIT)

    def read(self, kind, message):
        if kind not in ("opened", "closed", "open_failed", "release"):
            raise Wrong("unsupported" if kind == "subscribe" else "unknown_type", "/type")
        generation = integer(message.get("generation"), 1, "/generation")
        if kind == "open_failed":
            text(message.get("reason"), 1, 1024, "/reason")
        if kind == "release":
            seq = integer(message.get("seq"), 0, "/seq")
            if self.lent and self.lent["seq"] == seq and generation == 1:
                self.lent = None
        elif generation == 1 and self.granted:
            self.opened = kind == "opened" and "frames" in self.granted
            self.lent = self.lent if self.opened else None
        self.lend()

    def lend(self):
        newest = self.server.newest
        if self.opened and not self.lent and newest and newest["seq"] > self.seen:
            self.lent, self.seen = newest, newest["seq"]
            self.say(newest)

    def pose(self, kind, message):
        pose = pose_of(message)
        tag = message.get("tag") if self.newer and kind == "camera_pose" else None
        if tag is not None or (self.newer and "tag" in message and kind == "camera_pose"):
            text(tag, 1, 64, "/tag")
        self.poses[kind] = pose, tag
        if self not in self.server.control:
            self.server.control.append(self)
        if self.server.control[0] is self:
            self.server.apply(kind, pose, tag)
        elif not self.told:
            self.told = True
            raise Wrong("busy", None)


async def main():
    server = Server()
    await asyncio.start_server(lambda r, w: server.accept(True, r, w), HOST, IPC_PORT)
    await asyncio.start_server(lambda r, w: server.accept(False, r, w), HOST, MSG_PORT)
    await server.render()


if not HOST.startswith("127.") and HOST != "localhost":
    raise SystemExit("there is no token here, so only loopback addresses are listened on")
signal.signal(signal.SIGTERM, lambda *_: os._exit(0))
asyncio.run(main())
