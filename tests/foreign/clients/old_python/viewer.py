"""A viewer in Python, as one writes it for a server that one trusts."""

import base64
import ctypes
import json
import math
import os
import socket
import threading
import time

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")


class Handle(ctypes.Structure):
    _fields_ = [("bytes", ctypes.c_char * 64)]


def connect(variable):
    while True:
        try:
            return socket.create_connection((HOST, int(os.environ[variable])))
        except OSError:
            time.sleep(0.5)


def receive(sock):
    header = sock.recv(4)
    if len(header) < 4:
        raise ConnectionError
    length = int.from_bytes(header, "little")
    payload = b""
    while len(payload) < length:
        data = sock.recv(length - len(payload))
        if not data:
            raise ConnectionError
        payload += data
    return json.loads(payload)


def send(sock, message):
    payload = json.dumps(message).encode()
    sock.sendall(len(payload).to_bytes(4, "little"))
    sock.sendall(payload)


class Images:
    def __init__(self):
        self.cuda = ctypes.CDLL("libcudart.so.12")
        self.planes = []

    def open(self, packet):
        meta = packet["meta"]
        width, height = meta["w"], meta["h"]
        self.cuda.cudaSetDevice(int(meta["device"]))
        planes = []
        for name, size, offset in (
            ("mem_color", 16, meta["offsetColor"]),
            ("mem_depth", 4, meta["offsetDepth"]),
        ):
            memory = ctypes.c_void_p()
            handle = Handle.from_buffer_copy(base64.b64decode(packet[name]))
            status = self.cuda.cudaIpcOpenMemHandle(ctypes.byref(memory), handle, 1)
            if status:
                print("cannot open", name, status)
                return
            room = ctypes.create_string_buffer(size * width * height)
            planes.append((memory.value + offset, room))
        self.planes = planes

    def copy(self):
        for start, room in self.planes:
            self.cuda.cudaMemcpy(room, ctypes.c_void_p(start), ctypes.c_size_t(len(room)), 2)

    def run(self):
        while True:
            sock = connect("SPLATBUS_IPC_PORT")
            try:
                while True:
                    sock.settimeout(0.03 if self.planes else None)
                    try:
                        sock.recv(1, socket.MSG_PEEK)
                    except TimeoutError:
                        self.copy()
                        continue
                    sock.settimeout(None)
                    packet = receive(sock)
                    if "mem_color" in packet and "meta" in packet:
                        self.open(packet)
            except OSError:
                self.planes = []
                sock.close()
                time.sleep(0.5)


def steer():
    sock = connect("SPLATBUS_MSG_PORT")
    try:
        send(sock, {"type": "get_camera_pose", "cam_idx": -1})
        centre = receive(sock)["position"]
        turn = 0.0
        asked = time.monotonic()
        while True:
            turn += 0.02
            position = dict(zip("xyz", (centre[0] + math.sin(turn), *centre[1:]), strict=True))
            half = turn / 2
            rotation = {"x": 0, "y": math.sin(half), "z": 0, "w": math.cos(half)}
            send(sock, {"type": "camera_pose", "position": position, "rotation": rotation})
            time.sleep(0.03)
            if time.monotonic() > asked + 0.5:
                asked = time.monotonic()
                send(sock, {"type": "get_viewport_size"})
                width, height = receive(sock)["viewport_size"]
                print(f"{width} x {height}")
    except OSError:
        sock.close()
        time.sleep(0.5)


threading.Thread(target=Images().run, daemon=True).start()
while True:
    steer()
