"""A small client of 1.0 that reads images out of CUDA memory, as deployed ones do.

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


ENDS = OSError, ValueError, RecursionError, Bad  # a connection


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


def whole(value, least, most=2**53 - 1, unit=1):
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and value == value // 1 and least <= value <= most and value % unit == 0


def is_good(packet):
    """INI-1 to INI-7."""
    try:
        meta = packet["meta"]
        w, h = meta["w"], meta["h"]
        handles = [packet[name] for name in ("mem_color", "mem_depth", "evt_done")]
        return (
            whole(w, 1, 32768) and whole(h, 1, 32768)
            and (meta["fmtColor"], meta["fmtDepth"]) == ("RGBA32F", "R32F")
            and whole(meta["pitchColor"], 16 * w, 16 * w)
            and whole(meta["pitchDepth"], 4 * w, 4 * w)
            and whole(meta.get("offsetColor", 0), 0, unit=16)
            and whole(meta.get("offsetDepth", 0), 0, unit=4) and whole(meta.get("device", 0), 0)
            and all(len(h) == 88 and len(base64.b64decode(h, validate=True)) == 64 for h in handles)
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError):
        return False


def refuse(spelling):
    raise ValueError(spelling)


def finite(spelling):
    if abs(float(spelling)) == float("inf"):
        raise ValueError(spelling)
    return float(spelling) if set(spelling) & set(".eE") else int(spelling)


def unique(pairs):
    return dict(pairs) if len(pairs) == len(dict(pairs)) else refuse("twice")


def depth(value):
    inside = value.values() if isinstance(value, dict) else value
    return 1 + max(map(depth, inside), default=0) if isinstance(value, dict | list) else 0


def read(payload):
    """The value in a payload that keeps to JSN-1 to JSN-5; ValueError, RecursionError."""
    strict = {"object_pairs_hook": unique, "parse_constant": refuse}
    value = json.loads(payload.decode(), parse_float=finite, parse_int=finite, **strict)
    json.dumps(value, ensure_ascii=False).encode()  # refuses half a pair of surrogates
    return value if depth(value) <= 64 else refuse("deep")


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
            with contextlib.suppress(ValueError, RecursionError):
                if isinstance(message := read(payload), dict):
                    yield message


def ipc(sock):
    image = None
    try:
        for packet in packets(sock):
            if packet is None and image:
                keep(image, image.read())
            elif packet and "meta" in packet and "type" not in packet and is_good(packet):
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


def saw(seq, planes, rows):
    """An adapter that wants to know replaces this."""


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
