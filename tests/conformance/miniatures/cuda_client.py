"""A small client of 1.0 that reads images out of CUDA memory by the runtime, as deployed ones do.

Standard library and libcudart only. `python cuda_client.py [FOLDER]` keeps reading; with a folder
it writes what it read last there: `WxH.color` and `WxH.depth`, the top row first.
"""

import base64
import contextlib
import ctypes
import json
import os
import socket
import sys
import threading
import time
from pathlib import Path

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
IPC = int(os.environ.get("SPLATBUS_IPC_PORT", "6001"))
MSG = int(os.environ.get("SPLATBUS_MSG_PORT", "6000"))
LIMIT = 1 << 20
POINTER, SIZE = ctypes.c_void_p, ctypes.c_size_t
DEVICE_TO_HOST, NON_BLOCKING, LAZY_PEER_ACCESS = 2, 1, 1
FRAME_SECONDS = 0.02
CUDART = ctypes.CDLL("libcudart.so.12")


class Bad(Exception):  # noqa: N818
    """The connection, or the memory, is of no use."""


ENDS = OSError, ValueError, Bad  # a connection


class Handle(ctypes.Structure):
    _fields_ = [("reserved", ctypes.c_char * 64)]


def cuda(name, *arguments):
    """Call the runtime; Bad if it refuses."""
    if code := getattr(CUDART, f"cuda{name}")(*arguments):
        raise Bad(f"cuda{name}: {code}")


def made(name, *arguments):
    value = POINTER()
    cuda(name, ctypes.byref(value), *arguments)
    return value


class Image:
    """Colour and depth as one init packet names them."""

    def __init__(self, packet):
        meta = packet["meta"]
        self.width, self.height = int(meta["w"]), int(meta["h"])
        self.planes, self.opened, self.event = [], {}, None
        cuda("SetDevice", int(meta.get("device", 0)))
        self.stream = made("StreamCreateWithFlags", NON_BLOCKING)
        try:
            for what, pixel in (("Color", 16), ("Depth", 4)):
                base = self.open(packet[f"mem_{what.lower()}"])
                begin = base + int(meta.get(f"offset{what}", 0))
                self.planes.append((what.lower(), begin, int(meta[f"pitch{what}"]), pixel))
            self.event = made("IpcOpenEventHandle", handle(packet["evt_done"]))
        except Bad:
            self.close()
            raise

    def open(self, text):
        if text not in self.opened:
            self.opened[text] = made("IpcOpenMemHandle", handle(text), LAZY_PEER_ACCESS)
        return self.opened[text].value

    def read(self):
        found = {}
        cuda("StreamWaitEvent", self.stream, self.event, 0)
        for what, begin, pitch, pixel in self.planes:
            row = self.width * pixel
            found[what] = ctypes.create_string_buffer(row * self.height)
            place = (found[what], SIZE(row), POINTER(begin), SIZE(pitch), SIZE(row))
            cuda("Memcpy2DAsync", *place, SIZE(self.height), DEVICE_TO_HOST, self.stream)
        cuda("StreamSynchronize", self.stream)
        return {what: data.raw for what, data in found.items()}

    def close(self):
        cuda("StreamSynchronize", self.stream)
        for pointer in self.opened.values():
            cuda("IpcCloseMemHandle", pointer)
        if self.event:
            cuda("EventDestroy", self.event)
        cuda("StreamDestroy", self.stream)


def handle(text):
    return Handle.from_buffer_copy(base64.b64decode(text))


def send(sock, message):
    payload = json.dumps(message).encode()
    sock.sendall(len(payload).to_bytes(4, "little") + payload)


def packets(sock):
    """The objects that arrive; None when none does for the time of a frame."""
    data = b""
    sock.settimeout(FRAME_SECONDS)
    while True:
        try:
            chunk = sock.recv(1 << 16)
        except TimeoutError:
            yield None
            continue
        if not chunk:
            return
        data += chunk
        while len(data) >= 4:
            length = int.from_bytes(data[:4], "little")
            if not 1 <= length <= LIMIT:
                raise Bad("length")
            if len(data) < 4 + length:
                break
            payload, data = data[4 : 4 + length], data[4 + length :]
            yield json.loads(payload)


def ipc(sock):
    image = None
    try:
        for packet in packets(sock):
            if packet is None and image:
                keep(image, image.read())
            elif packet and "meta" in packet:
                if image:
                    image.close()
                    image = None
                with contextlib.suppress(Bad):
                    image = Image(packet)
    finally:
        if image:
            image.close()


def keep(image, planes):
    for what, data in planes.items() if sys.argv[1:] else ():
        row = len(data) // image.height
        rows = [data[row * r : row * (r + 1)] for r in reversed(range(image.height))]
        path = Path(sys.argv[1], f"{image.width}x{image.height}.{what}")
        path.with_suffix(".new").write_bytes(b"".join(rows))
        path.with_suffix(".new").replace(path)


def msg(sock):
    send(sock, {"type": "get_camera_pose", "cam_idx": 0})
    send(sock, {"type": "get_viewport_size"})
    for message in packets(sock):
        if message is None:
            rotation = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
            position = {"x": 0.1, "y": 0, "z": -4.0}
            send(sock, {"type": "camera_pose", "position": position, "rotation": rotation})


def stay(port, talk):
    while True:
        began = time.monotonic()
        with contextlib.suppress(*ENDS), socket.create_connection((HOST, port)) as sock:
            talk(sock)
        time.sleep(max(0.0, 0.12 - (time.monotonic() - began)))


if __name__ == "__main__":
    threading.Thread(target=stay, args=(MSG, msg), daemon=True).start()
    stay(IPC, ipc)
