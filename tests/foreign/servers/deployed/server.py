"""A server of SplatBus 1.0 in the shape of the deployed one: blocking sockets, a thread a channel.

It draws a checkered wall at z = 6 into CUDA memory, by the runtime that LD_LIBRARY_PATH has.
"""

import base64
import ctypes
import json
import os
import socket
import struct
import threading
import time

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
IPC_PORT = int(os.environ.get("SPLATBUS_IPC_PORT", "6001"))
MSG_PORT = int(os.environ.get("SPLATBUS_MSG_PORT", "6000"))
W, H, FOCAL = 32, 24, 30.0
BLOCK, COLOR, DEPTH = 1 << 18, 4096, 65536
"""As an allocator has it that keeps tensors of others in the block."""
CAMERAS = [([0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]), ([0.5, -0.25, 1.0], [0.0, 0.28, 0.0, 0.96])]


class Handle(ctypes.Structure):
    _fields_ = [("bytes", ctypes.c_ubyte * 64)]


class Buffers:
    """Colour and depth on the device, and the event behind them."""

    def __init__(self):
        self.cuda = ctypes.CDLL("libcudart.so.12")
        self.memory, self.stream, self.event = (ctypes.c_void_p() for _ in range(3))
        self.call("cudaMalloc", ctypes.byref(self.memory), ctypes.c_size_t(BLOCK))
        self.call("cudaStreamCreate", ctypes.byref(self.stream))
        self.call("cudaEventCreateWithFlags", ctypes.byref(self.event), 4 | 2)
        memory, event = Handle(), Handle()
        self.call("cudaIpcGetMemHandle", ctypes.byref(memory), self.memory)
        self.call("cudaIpcGetEventHandle", ctypes.byref(event), self.event)
        self.handles = [base64.b64encode(bytes(each)).decode() for each in (memory, event)]

    def call(self, name, *arguments):
        error = getattr(self.cuda, name)(*arguments)
        if error:
            raise RuntimeError(f"{name}: {error}")

    def put(self, offset, data):
        to = ctypes.c_void_p(self.memory.value + offset)
        size = ctypes.c_size_t(len(data))
        self.call("cudaMemcpyAsync", to, data, size, 1, self.stream)

    def show(self, color, depth, others):
        self.put(0, others)
        self.put(COLOR, color)
        self.put(DEPTH, depth)
        self.call("cudaEventRecord", self.event, self.stream)
        self.call("cudaStreamSynchronize", self.stream)


def matrix(x, y, z, w):
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return (
        (1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)),
        (s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)),
        (s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)),
    )


def drawn(position, rotation):
    """Rows from the bottom up; what is not met has the depth 100."""
    m, (px, py, pz) = matrix(*rotation), position
    color, depth = [], []
    for i in reversed(range(H)):
        for j in range(W):
            d = ((j + 0.5 - W / 2) / FOCAL, (i + 0.5 - H / 2) / FOCAL, 1.0)
            x, y, z = (sum(a * b for a, b in zip(row, d)) for row in m)
            far = (6.0 - pz) / z if z else -1.0
            if not 0.01 <= far <= 100.0:
                color += (0.0, 0.0, 0.0, 0.0)
                depth.append(100.0)
                continue
            odd = (int((px + far * x) // 0.7) + int((py + far * y) // 0.7)) % 2
            color += (0.8, 0.3, 0.2, 1.0) if odd else (0.2, 0.5, 0.7, 1.0)
            depth.append(far)
    return struct.pack(f"<{len(color)}f", *color), struct.pack(f"<{len(depth)}f", *depth)


class Server:
    def __init__(self):
        self.buffers = Buffers()
        self.view = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]
        self.ipc = None
        self.images = 0

    def render(self):
        shown = None
        while True:
            view = self.view
            if view != shown:
                self.images += 1
                self.buffers.show(*drawn(*view), struct.pack("<I", self.images) * 64)
                shown = view
            time.sleep(0.01)

    def init_packet(self):
        memory, event = self.buffers.handles
        meta = {"w": W, "h": H, "fmtColor": "RGBA32F", "pitchColor": 16 * W, "fmtDepth": "R32F"}
        meta |= {"pitchDepth": 4 * W, "offsetColor": COLOR, "offsetDepth": DEPTH, "device": 0}
        return {"meta": meta, "mem_color": memory, "mem_depth": memory, "evt_done": event}

    def lend(self, listener):
        while True:
            connection, _ = listener.accept()
            if self.ipc is not None:
                self.ipc.close()
            self.ipc = connection
            try:
                send(connection, self.init_packet())
            except OSError:
                pass

    def listen(self, listener):
        while True:
            connection, _ = listener.accept()
            while (message := receive(connection)) is not None:
                reply = self.handle(message)
                if reply is not None:
                    send(connection, reply)
            connection.close()

    def handle(self, payload):
        text = payload.decode("utf-8")
        try:
            message = json.loads(text)
        except json.JSONDecodeError:
            return None
        kind = message.get("type")
        if kind == "get_viewport_size":
            return {"viewport_size": [W, H]}
        if kind == "get_camera_pose":
            position, rotation = CAMERAS[message["cam_idx"] % len(CAMERAS)]
            return {"position": position, "rotation": rotation}
        if kind == "camera_pose":
            position = [float(message["position"][name]) for name in "xyz"]
            rotation = [float(message["rotation"][name]) for name in "xyzw"]
            norm = sum(each * each for each in rotation) ** 0.5
            if abs(norm - 1.0) <= 0.01 and all(abs(each) <= 3.4e38 for each in position):
                self.view = position, rotation
        return None


def send(connection, message):
    payload = json.dumps(message).encode()
    connection.sendall(struct.pack("<I", len(payload)))
    connection.sendall(payload)


def receive(connection):
    header = exactly(connection, 4)
    if header is None:
        return None
    (length,) = struct.unpack("<I", header)
    return exactly(connection, length) if length else None


def exactly(connection, count):
    data = b""
    while len(data) < count:
        chunk = connection.recv(min(count - len(data), 65536))
        if not chunk:
            return None
        data += chunk
    return data


def listening(port):
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.bind((HOST, port))
    listener.listen(1)
    return listener


def main():
    time.sleep(3.0)  # the scene is loaded
    server = Server()
    threads = [
        threading.Thread(target=server.lend, args=(listening(IPC_PORT),), daemon=True),
        threading.Thread(target=server.listen, args=(listening(MSG_PORT),), daemon=True),
    ]
    for thread in threads:
        thread.start()
    server.render()


main()
