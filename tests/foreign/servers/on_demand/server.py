"""Discs that float in space, drawn when somebody or something has moved, and else never."""

import array
import base64
import ctypes
import json
import math
import os
import re
import select
import socket
import struct
import sys
import threading
import time

W, H, FOCAL, NEAR, FAR = 36, 36, 30.0, 0.01, 100.0
PLACES, LARGEST, SAFE, FLOAT = 3, 1 << 20, 2**53 - 1, 3.4028234663852886e38
OFFSET = 1 << 16
NUMBER = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?")
DISCS = (  # centre, normal, radius, colour
    ((0.0, 0.0, 5.0), (0.0, 0.0, -1.0), 1.5, (0.8, 0.3, 0.1)),
    ((1.2, -0.6, 4.0), (0.6, 0.0, -0.8), 0.7, (0.1, 0.6, 0.3)),
    ((-1.4, 0.5, 3.5), (0.0, -0.8, -0.6), 0.6, (0.2, 0.3, 0.9)),
)
RAYS = [((j + 0.5 - W / 2) / FOCAL, (i + 0.5 - H / 2) / FOCAL) for i in reversed(range(H)) for j in range(W)]
CAMERAS = (
    ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
    ((0.25, -0.5, 0.125), (0.0, 0.0, 0.28, 0.96)),
    ((-1.0, 0.1, 1e-3), (0.0, 0.2, 0.4, math.sqrt(0.8))),
)


class Handle(ctypes.Structure):
    _fields_ = [("bytes", ctypes.c_ubyte * 64)]


def called(name, *arguments):
    if status := getattr(CUDA, name)(*arguments):
        sys.exit(f"{name}: {status}")


CUDA = ctypes.CDLL("libcudart.so.12")
MEMORY, EVENT, STREAM = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_void_p()


def handles():
    called("cudaMalloc", ctypes.byref(MEMORY), ctypes.c_size_t(OFFSET + 4 * W * H))
    called("cudaStreamCreate", ctypes.byref(STREAM))
    called("cudaEventCreateWithFlags", ctypes.byref(EVENT), 4 | 2)
    memory, event = Handle(), Handle()
    called("cudaIpcGetMemHandle", ctypes.byref(memory), MEMORY)
    called("cudaIpcGetEventHandle", ctypes.byref(event), EVENT)
    return [base64.b64encode(bytes(each)).decode() for each in (memory, event)]


def show(color, depth):
    for offset, data in ((0, color), (OFFSET, depth)):
        to = ctypes.c_void_p(MEMORY.value + offset)
        called("cudaMemcpyAsync", to, data, ctypes.c_size_t(len(data)), 1, STREAM)
    called("cudaEventRecord", EVENT, STREAM)
    called("cudaStreamSynchronize", STREAM)


# ---- the picture


def matrix(q):
    x, y, z, w = q
    s = 2 / (x * x + y * y + z * z + w * w)
    return (
        (s / 2 * (w * w + x * x - y * y - z * z), s * (x * y - z * w), s * (x * z + y * w)),
        (s * (x * y + z * w), s / 2 * (w * w - x * x + y * y - z * z), s * (y * z - x * w)),
        (s * (x * z - y * w), s * (y * z + x * w), s / 2 * (w * w - x * x - y * y + z * z)),
    )


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def apply(m, v):
    return tuple(dot(row, v) for row in m)


def drawn(camera, cloud):
    into = tuple(zip(*matrix(camera[1])))
    turn, offset = matrix(cloud[1]), tuple(a - b for a, b in zip(cloud[0], camera[0]))
    seen = []
    for centre, normal, radius, colour in DISCS:
        middle = apply(into, tuple(a + b for a, b in zip(apply(turn, centre), offset)))
        up = apply(into, apply(turn, normal))
        seen.append((middle, up, radius * radius, dot(middle, up), colour))
    color, depth = array.array("f"), array.array("f")
    for x, y in RAYS:
        best, paint = FAR, None
        for (a, b, c), (u, v, w), square, height, colour in seen:
            slope = x * u + y * v + w
            z = height / slope if slope else -1.0
            if NEAR <= z < best and (z * x - a) ** 2 + (z * y - b) ** 2 + (z - c) ** 2 <= square:
                best, paint = z, colour
        color.extend((*paint, 1.0) if paint else (0.0, 0.0, 0.0, 0.0))
        depth.append(best if paint else math.inf)
    return color.tobytes(), depth.tobytes()


# ---- text


def once(pairs):
    if len(dict(pairs)) < len(pairs):
        raise ValueError("a name twice")
    return dict(pairs)


def refused(word):
    raise ValueError(word)


def number(text):
    value = float(text)
    if math.isinf(value):
        raise ValueError("too large")
    return value


def deep(value):
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return 0 if parts is None else 1 + max(map(deep, parts), default=0)


def understood(payload):
    try:
        text = payload.decode("utf-8")
        value = json.loads(text, object_pairs_hook=once, parse_int=number, parse_float=number, parse_constant=refused)
        json.dumps(value, ensure_ascii=False).encode("utf-8")
        return value if isinstance(value, dict) and deep(value) <= 64 else None
    except (ValueError, RecursionError):
        return None


def numbers(value, names):
    """What JSN-11 allows, too: a number in a string."""
    found = []
    for name in names:
        each = value.get(name) if isinstance(value, dict) else None
        if isinstance(each, str) and NUMBER.fullmatch(each):
            each = float(each)
        if not isinstance(each, float) or not math.isfinite(each):
            return None
        found.append(each)
    return tuple(found)


# ---- the server


class Server:
    def __init__(self):
        self.moved = threading.Condition()
        self.view = {"camera_pose": CAMERAS[0], "point_cloud_pose": ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))}
        self.steering = []
        self.drawn = None
        self.open = {"ipc": [], "msg": []}
        self.init = None

    def render(self):
        memory, event = handles()
        meta = {"w": W, "h": H, "fmtColor": "RGBA32F", "pitchColor": 16 * W, "fmtDepth": "R32F", "pitchDepth": 4 * W}
        meta |= {"offsetDepth": OFFSET, "device": 0, "scale": 1.0}
        while True:
            with self.moved:
                self.moved.wait_for(lambda: self.view != self.drawn)
                view = dict(self.view)
            show(*drawn(view["camera_pose"], view["point_cloud_pose"]))
            with self.moved:
                self.drawn = view
                if not self.init:
                    self.init = {"meta": meta, "mem_color": memory, "mem_depth": memory, "evt_done": event}
                    for conn in self.open["ipc"]:
                        conn.say(self.init)

    def take(self, conn, kind, message):
        place, turn = numbers(message.get("position"), "xyz"), numbers(message.get("rotation"), "xyzw")
        if not place or not turn or any(abs(each) > FLOAT for each in place):
            return
        if "timestamp" in message and not numbers(message, ("timestamp",)):
            return
        if abs(math.hypot(*turn) - 1) > 0.01:
            return
        with self.moved:
            if conn not in self.steering:
                self.steering.append(conn)
            if self.steering[0] is conn:
                self.view = {**self.view, kind: (place, turn)}
                self.moved.notify_all()

    def answer(self, conn, message):
        kind = message.get("type")
        if kind in ("camera_pose", "point_cloud_pose"):
            self.take(conn, kind, message)
        elif kind == "get_viewport_size":
            conn.say({"viewport_size": [W, H] if self.drawn else [0, 0]})
        elif kind == "get_camera_pose":
            index = message.get("cam_idx")
            if isinstance(index, float) and index.is_integer() and abs(index) <= SAFE:
                place, turn = CAMERAS[int(index) % len(CAMERAS)]
                conn.say({"position": place, "rotation": turn})

    def enter(self, conn):
        with self.moved:
            there = self.open[conn.channel]
            there.append(conn)
            if len(there) > PLACES:
                there.pop(0).cut()
            if conn.channel == "ipc" and self.init:
                conn.say(self.init)

    def leave(self, conn):
        with self.moved:
            for some in (*self.open.values(), self.steering):
                if conn in some:
                    some.remove(conn)


class Connection:
    def __init__(self, server, sock, channel):
        self.server, self.sock, self.channel = server, sock, channel
        self.writing = threading.Lock()
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def limit(self, which, seconds):
        self.sock.setsockopt(socket.SOL_SOCKET, which, struct.pack("ll", int(seconds), int(seconds % 1 * 1e6)))

    def say(self, message):
        payload = json.dumps(message).encode()
        with self.writing:
            left, end = struct.pack("<I", len(payload)) + payload, time.monotonic() + 4.0
            try:
                while left:
                    if not select.select([], [self.sock], [], max(0.0, end - time.monotonic()))[1]:
                        return self.cut()
                    left = left[self.sock.send(left, socket.MSG_DONTWAIT):]
            except OSError:
                self.cut()

    def cut(self):
        try:
            self.sock.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass

    def exactly(self, count, end=math.inf):
        got = bytearray()
        while len(got) < count:
            data = self.sock.recv(min(count - len(got), 1 << 15))
            if not data or time.monotonic() > end:
                raise ConnectionError
            got += data
        return bytes(got)

    def packet(self):
        self.limit(socket.SO_RCVTIMEO, 0)
        first = self.exactly(1)
        end = time.monotonic() + 9.9
        self.limit(socket.SO_RCVTIMEO, 9.9)
        (length,) = struct.unpack("<I", first + self.exactly(3, end))
        if not 1 <= length <= LARGEST:
            raise ConnectionError
        return self.exactly(length, end)

    def run(self):
        self.server.enter(self)
        try:
            while True:
                payload = self.packet()
                message = understood(payload) if self.channel == "msg" else None
                if message is not None:
                    self.server.answer(self, message)
        except OSError:
            pass
        self.server.leave(self)
        self.cut()
        self.sock.close()


def listen(server, channel, port):
    listener = socket.create_server(("127.0.0.1", port))
    while True:
        sock, _ = listener.accept()
        threading.Thread(target=Connection(server, sock, channel).run, daemon=True).start()


server = Server()
for channel, variable, usual in (("msg", "SPLATBUS_MSG_PORT", 6000), ("ipc", "SPLATBUS_IPC_PORT", 6001)):
    port = int(os.environ.get(variable, usual))
    threading.Thread(target=listen, args=(server, channel, port), daemon=True).start()
server.render()
