"""A small server of 1.0 whose images lie in CUDA memory, as deployed ones do.

Standard library and libcudart only. It shows a wall with stripes that move, below an empty sky.
"""

import array
import base64
import contextlib
import ctypes
import json
import math
import os
import socket
import threading
import time

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
IPC = int(os.environ.get("SPLATBUS_IPC_PORT", "6001"))
MSG = int(os.environ.get("SPLATBUS_MSG_PORT", "6000"))
WIDTH, HEIGHT, SKY = 48, 32, 8
COLOR, DEPTH = 16 * WIDTH * HEIGHT, 4 * WIDTH * HEIGHT
LIMIT, SAFE, NESTED, MOST, PACKET_SECONDS = 1 << 20, 2**53 - 1, 64, 64, 10.0
MOST_POSITION = 3.4028234663852886e38
FRAME_SECONDS = 0.03
POINTER, SIZE = ctypes.c_void_p, ctypes.c_size_t
TO_DEVICE, NON_BLOCKING, DISABLE_TIMING, INTERPROCESS = 1, 1, 2, 4
EVENT_FLAGS = INTERPROCESS | DISABLE_TIMING
CUDART = ctypes.CDLL("libcudart.so.12")
IDENTITY = {"position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0]}
ORIGIN = {"position": dict.fromkeys("xyz", 0.0), "rotation": dict.fromkeys("xyz", 0.0) | {"w": 1.0}}


class Bad(Exception):  # noqa: N818
    """What arrived, or the runtime, is of no use."""


def cuda(name, *arguments):
    """Call the runtime; Bad if it refuses."""
    if code := getattr(CUDART, f"cuda{name}")(*arguments):
        raise Bad(f"cuda{name}: {code}")


def made(name, *arguments):
    value = POINTER()
    cuda(name, ctypes.byref(value), *arguments)
    return value


def handle(what, of):
    """A handle as packets carry it."""
    found = ctypes.create_string_buffer(64)
    with contextlib.suppress(Bad):
        cuda(f"IpcGet{what}Handle", found, of)
    return base64.b64encode(found.raw).decode()


class Buffers:
    """Colour and depth in one allocation, and the event that guards them."""

    def __init__(self):
        self.memory = made("Malloc", SIZE(COLOR + DEPTH))
        self.event = made("EventCreateWithFlags", EVENT_FLAGS)
        self.stream = made("StreamCreateWithFlags", NON_BLOCKING)

    def init_packet(self):
        meta = {"w": WIDTH, "h": HEIGHT, "fmtColor": "RGBA32F", "pitchColor": 16 * WIDTH}
        meta |= {"fmtDepth": "R32F", "pitchDepth": 4 * WIDTH, "device": 0}
        memory, event = handle("Mem", self.memory), handle("Event", self.event)
        handles = {"mem_color": memory, "mem_depth": memory, "evt_done": event}
        return {"meta": meta | {"offsetColor": 0, "offsetDepth": COLOR}, **handles}

    def write(self, begin, data):
        place = POINTER(self.memory.value + begin), data, SIZE(len(data))
        cuda("MemcpyAsync", *place, TO_DEVICE, self.stream)

    def publish(self, color, depth):
        self.write(0, color)
        self.write(COLOR, depth)
        cuda("EventRecord", self.event, self.stream)
        cuda("StreamSynchronize", self.stream)

    def free(self):
        cuda("Free", self.memory)
        cuda("EventDestroy", self.event)


def draw(number, poses):
    """Colour and depth, the bottom row first; the wall is 5 units before the world's origin."""
    scene, camera = (poses.get(f"{what}_pose", ORIGIN) for what in ("point_cloud", "camera"))
    distance = max(0.5, min(5.0 + scene["position"]["z"] - camera["position"]["z"], 1e30))
    stripes = [float((column + number) // 4 % 2) for column in range(WIDTH)]
    row = [number for red in stripes for number in (red, 0.5, 1.0 - red, 1.0)]
    wall, empty = HEIGHT - SKY, [0.0] * (4 * WIDTH)
    color = array.array("f", row * wall + empty * SKY)
    depth = array.array("f", [distance] * (wall * WIDTH) + [math.inf] * (SKY * WIDTH))
    return color.tobytes(), depth.tobytes()


def fail(text):
    raise ValueError(text)


def members(pairs):
    found = dict(pairs)
    return found if len(found) == len(pairs) else fail("a name twice")


def finite(text):
    number = float(text)
    return number if math.isfinite(number) else fail(text)


def whole_number(text):
    return int(text) if len(text) < 300 else int(finite(text))


def understood(payload):
    """The object that a payload is; ValueError or RecursionError if none (JSN-1 to JSN-5)."""
    hooks = {"parse_constant": fail, "parse_float": finite, "parse_int": whole_number}
    value = json.loads(payload.decode(), object_pairs_hook=members, **hooks)
    json.dumps(value, ensure_ascii=False).encode()
    return value if isinstance(value, dict) and depth_of(value) <= NESTED else fail("no object")


def depth_of(value):
    inner = value.values() if isinstance(value, dict) else value
    return 1 + max(map(depth_of, inner), default=0) if isinstance(value, dict | list) else 0


def is_number(value):
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_whole(number):
    return number == number // 1 and abs(number) <= SAFE


def is_pose(message):
    """POS-1 to POS-3, POS-8."""
    try:
        position = [message["position"][name] for name in "xyz"]
        rotation = [message["rotation"][name] for name in "xyzw"]
        return (
            all(map(is_number, (*position, *rotation, message.get("timestamp", 0))))
            and max(map(abs, position)) <= MOST_POSITION
            and abs(math.hypot(*rotation) - 1.0) <= 0.01
        )
    except (KeyError, TypeError, OverflowError):
        return False


def send(sock, message):
    payload = json.dumps(message).encode()
    sock.sendall(len(payload).to_bytes(4, "little") + payload)


def packets(sock):
    """The payloads that arrive; Bad for what no packet can be."""
    data, since = b"", 0.0
    sock.settimeout(PACKET_SECONDS / 10)
    while True:
        with contextlib.suppress(TimeoutError):
            chunk = sock.recv(1 << 16)
            if not chunk:
                return
            since = since if data else time.monotonic()
            data += chunk
        while len(data) >= 4:
            length = int.from_bytes(data[:4], "little")
            if not 1 <= length <= LIMIT:
                raise Bad("length")
            if len(data) < 4 + length:
                break
            payload, data, since = data[4 : 4 + length], data[4 + length :], time.monotonic()
            yield payload
        if data and time.monotonic() - since > PACKET_SECONDS:
            raise Bad("unfinished")


class Server:
    """The images, the camera, and who moves it."""

    def __init__(self):
        self.images, self.controls, self.poses = Buffers(), [], {}

    def ipc(self, sock):
        send(sock, self.images.init_packet())
        for _ in packets(sock):
            pass

    def msg(self, sock):
        try:
            for payload in packets(sock):
                with contextlib.suppress(ValueError, RecursionError):
                    self.answer(sock, understood(payload))
        finally:
            if sock in self.controls:
                self.controls.remove(sock)

    def answer(self, sock, message):
        kind, index = message.get("type"), message.get("cam_idx")
        timed = is_number(message.get("timestamp", 0))
        if kind in ("camera_pose", "point_cloud_pose") and is_pose(message):
            self.controls += [sock] * (sock not in self.controls)
            if self.controls[0] is sock:
                self.poses[kind] = message
        elif kind == "get_viewport_size" and timed:
            send(sock, {"viewport_size": [WIDTH, HEIGHT]})
        elif kind == "get_camera_pose" and timed and is_number(index) and is_whole(index):
            send(sock, IDENTITY)

    def render(self):
        number = 0
        while True:
            self.images.publish(*draw(number, self.poses))
            number += 1
            time.sleep(FRAME_SECONDS)


def serve(sock, talk, crowd):
    with contextlib.suppress(OSError, Bad), sock:
        talk(sock)
    crowd.release()


def accept(port, talk):
    listener, crowd = socket.create_server((HOST, port), backlog=64), threading.Semaphore(MOST)
    while True:
        sock, _ = listener.accept()
        if not crowd.acquire(blocking=False):
            sock.close()
            continue
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        threading.Thread(target=serve, args=(sock, talk, crowd), daemon=True).start()


def run(server):
    for port, talk in ((IPC, server.ipc), (MSG, server.msg)):
        threading.Thread(target=accept, args=(port, talk), daemon=True).start()
    server.render()


if __name__ == "__main__":
    run(Server())
