"""A small server of 1.1 that lends frames in CUDA memory, and shows those of 1.0 beside them."""

import contextlib
import re
import threading
import time

import cuda_server
from cuda_server import (
    COLOR,
    DEPTH,
    EVENT_FLAGS,
    HEIGHT,
    ORIGIN,
    SIZE,
    WIDTH,
    Bad,
    Buffers,
    Server,
    cuda,
    draw,
    handle,
    made,
    packets,
    send,
    understood,
)

SLOTS = 8
IPC, MSG = ["cuda_ipc", "frames"], []
SEMANTICS = {
    "rows": "bottom_up",
    "alpha": "straight",
    "colorSpace": "srgb",
    "depth": {"kind": "planar_z", "estimator": "expected", "empty": "inf"},
    "unitMetres": None,
    "origin": [0.0, 0.0, 0.0],
}
CAMERA = {"fx": 40.0, "fy": 40.0, "cx": WIDTH / 2, "cy": HEIGHT / 2, "width": WIDTH}
CAMERA |= {"height": HEIGHT, "near": 0.01, "far": 1000.0}


class Ring(Buffers):
    """Slots in one allocation, an event for each, and the legacy slot beside them."""

    def __init__(self):
        self.legacy = Buffers()
        self.stream = self.legacy.stream
        self.memory = made("Malloc", SIZE(SLOTS * (COLOR + DEPTH)))
        self.events = [made("EventCreateWithFlags", EVENT_FLAGS) for _ in range(SLOTS)]

    def init_packet(self):
        ring = {"slots": SLOTS, "colorOffset": 0, "colorStride": COLOR, "depthStride": DEPTH}
        ring |= {"depthOffset": SLOTS * COLOR, "events": [handle("Event", e) for e in self.events]}
        memory = {"kind": "cuda_ipc", "handle": handle("Mem", self.memory)}
        memory |= {"deviceUuid": "GPU-00000000-0000-4000-8000-000000000000"}
        memory |= {"bytes": SLOTS * (COLOR + DEPTH)}
        added = {"memory": memory, "ring": ring, "semantics": SEMANTICS}
        return {"version": "1.1", "generation": 1, **self.legacy.init_packet(), **added}

    def publish(self, slot, color, depth):
        self.write(slot * COLOR, color)
        self.write(SLOTS * COLOR + slot * DEPTH, depth)
        cuda("EventRecord", self.events[slot], self.stream)
        cuda("StreamSynchronize", self.stream)


class Reader:
    """A client on the IPC channel: what it was granted, what it has opened, what it holds."""

    def __init__(self, sock):
        self.sock, self.granted, self.opened, self.told, self.held = sock, [], False, 0, None

    def takes(self, seq):
        return self.opened and self.held is None and seq > self.told


class FrameServer(Server):
    """Also says welcome, and lends each reader one slot at a time."""

    def __init__(self):
        self.images, self.controls, self.poses = Ring(), [], {}
        self.readers, self.greeted, self.lock = [], set(), threading.Lock()
        self.newest = None, 0, None  # frame, its number, its slot

    def ipc(self, sock):
        reader = Reader(sock)
        with self.lock:
            self.readers.append(reader)
            send(sock, self.images.init_packet())
        try:
            for payload in packets(sock):
                with contextlib.suppress(ValueError, RecursionError), self.lock:
                    self.hear(reader, understood(payload))
        finally:
            with self.lock:
                self.readers.remove(reader)

    def hear(self, reader, message):
        kind, generation = message.get("type"), message.get("generation")
        if kind == "hello" and not reader.granted:
            reader.granted = welcome(reader.sock, message, IPC)
        elif generation == 1 and kind in ("opened", "open_failed", "closed"):
            reader.opened = kind == "opened" and "frames" in reader.granted
            reader.held = reader.held if reader.opened else None
        elif (kind, generation, message.get("seq")) == ("release", 1, reader.told):
            reader.held = None
        self.lend(reader)

    def lend(self, reader):
        frame, seq, slot = self.newest
        if frame and reader.takes(seq):
            reader.told, reader.held = seq, slot
            with contextlib.suppress(OSError):
                send(reader.sock, frame)

    def answer(self, sock, message):
        if message.get("type") == "hello":
            if sock not in self.greeted and welcome(sock, message, MSG) is not None:
                self.greeted.add(sock)
        elif sock in self.greeted:
            told = Typed(sock, message)
            super().answer(told, message)
            if message.get("type") in ("get_viewport_size", "get_camera_pose") and not told.said:
                send(sock, {"type": "error", "code": "invalid_message", "message": "no request"})
        else:
            super().answer(sock, message)

    def render(self):
        seq = 0
        while True:
            seq += 1
            self.show(seq)
            time.sleep(cuda_server.FRAME_SECONDS)

    def show(self, seq):
        poses = dict(self.poses)
        color, depth = draw(seq, poses)
        posed = poses.get("camera_pose", ORIGIN)
        place = {"position": [posed["position"][name] for name in "xyz"]}
        camera = {**CAMERA, **place, "rotation": [posed["rotation"][name] for name in "xyzw"]}
        with self.lock:
            taken = {reader.held for reader in self.readers} | {self.newest[2]}
            slot = next(slot for slot in range(SLOTS) if slot not in taken)
            self.images.publish(slot, color, depth)
            numbers = {"generation": 1, "seq": seq, "slot": slot}
            times = {"time": 0.0, "renderedAt": time.monotonic()}
            self.newest = {"type": "frame", **numbers, "camera": camera, **times}, seq, slot
            for reader in self.readers:
                self.lend(reader)
            if any("frames" not in reader.granted for reader in self.readers):
                self.images.legacy.publish(color, depth)


class Typed:
    """A connection that has said hello: replies to it have a type, and an id if they were asked."""

    def __init__(self, sock, request):
        self.sock, self.said = sock, False
        self.added = {name: request[name] for name in ("id",) if name in request}

    def __eq__(self, other):
        return self.sock is getattr(other, "sock", other)

    def sendall(self, data):
        message = understood(data[4:])
        kind = "viewport_size" if "viewport_size" in message else "camera"
        self.said = True
        send(self.sock, {"type": kind, **self.added, **message})


def welcome(sock, hello, offered):
    """What is granted; ValueError if this is no hello, Bad if no version of it is spoken."""
    versions, wanted = hello.get("versions"), hello.get("capabilities")
    for listed in (versions, wanted, [hello.get("token", "none")]):
        if not isinstance(listed, list) or not all(isinstance(each, str) for each in listed):
            raise ValueError("hello")
    if not all(re.fullmatch(r"(0|[1-9]\d*)\.(0|[1-9]\d*)", each) for each in versions):
        raise ValueError("hello")
    granted = [name for name in offered if name in wanted]
    version = next((v for v in versions if v in ("1.1", "1.0")), None)
    if version is None:
        supported = {"supported": ["1.1", "1.0"], "message": "none of these is spoken"}
        send(sock, {"type": "error", "code": "unsupported_version", **supported})
        raise Bad("version")
    server = {"server": {"name": "miniature", "version": "1"}, "capabilities": granted}
    send(sock, {"type": "welcome", "version": version, **server})
    return granted


if __name__ == "__main__":
    cuda_server.run(FrameServer())
