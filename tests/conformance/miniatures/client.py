"""The smallest clients that conform, for testing the harness without the reference client.

Standard library only. `python client.py 1.0` speaks 1.0, `python client.py 1.1` speaks 1.1.
"""

import contextlib
import json
import os
import socket
import sys
import threading
import time

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
IPC = int(os.environ.get("SPLATBUS_IPC_PORT", "6001"))
MSG = int(os.environ.get("SPLATBUS_MSG_PORT", "6000"))
LIMIT = 1 << 20


class Bad(Exception):
    """The connection cannot go on."""


def send(sock, message):
    payload = json.dumps(message).encode()
    sock.sendall(len(payload).to_bytes(4, "little") + payload)


def packets(sock):
    data = b""
    while chunk := sock.recv(1 << 16):
        data += chunk
        while len(data) >= 4:
            length = int.from_bytes(data[:4], "little")
            if not 1 <= length <= LIMIT:
                raise Bad("length")
            if len(data) < 4 + length:
                break
            yield data[4 : 4 + length]
            data = data[4 + length :]


def unique(pairs):
    if len(pairs) != len(dict(pairs)):
        raise ValueError("twice")
    return dict(pairs)


def refuse(spelling):
    raise ValueError(spelling)


def read(payload):
    """The object in a payload, or None."""
    with contextlib.suppress(ValueError, RecursionError):
        value = json.loads(payload.decode(), object_pairs_hook=unique, parse_constant=refuse)
        return value if isinstance(value, dict) else None
    return None


def whole(value, least):
    return isinstance(value, int | float) and value == int(value) and least <= value <= 2**53 - 1


def problem(message):
    """Why the memory of an init packet of 1.1 cannot be opened, or None."""
    try:
        meta, ring, memory = message["meta"], message["ring"], message["memory"]
        w, h, slots, size = meta["w"], meta["h"], ring["slots"], memory["bytes"]
        ok = (
            message["version"] == "1.1"
            and whole(w, 1) and whole(h, 1) and max(w, h) <= 32768
            and meta["fmtColor"] == "RGBA32F" and meta["fmtDepth"] == "R32F"
            and meta["pitchColor"] == 16 * w and meta["pitchDepth"] == 4 * w
            and memory["kind"] == "host_shm"
            and 1 <= len(memory["name"]) <= 30
            and all(c.isascii() and (c.isalnum() or c in "._-") for c in memory["name"])
            and not memory["name"].startswith(".")
            and whole(slots, 1) and slots <= 1024 and whole(size, 1)
            and whole(ring["colorOffset"], 0) and ring["colorOffset"] % 16 == 0
            and whole(ring["depthOffset"], 0) and ring["depthOffset"] % 16 == 0
            and whole(ring["colorStride"], 16 * w * h) and ring["colorStride"] % 16 == 0
            and whole(ring["depthStride"], 4 * w * h) and ring["depthStride"] % 16 == 0
            and ring["colorOffset"] + (slots - 1) * ring["colorStride"] + 16 * w * h <= size
            and ring["depthOffset"] + (slots - 1) * ring["depthStride"] + 4 * w * h <= size
            and message["semantics"]["rows"] == "bottom_up"
            and message["semantics"]["alpha"] in ("straight", "premultiplied")
        )
        real = os.stat("/dev/shm/" + memory["name"]).st_size if ok else 0
    except (KeyError, TypeError, OSError, AttributeError) as error:
        return repr(error)
    if not ok:
        return "a rule is broken"
    return None if real >= size else f"{real} bytes, {size} announced"


def ipc(sock, version):
    if version == "1.0":
        for _ in packets(sock):
            pass
        return
    capabilities = ["host_shm", "frames", "reinit"]
    hello = {"type": "hello", "versions": ["1.1", "1.0"], "capabilities": capabilities}
    send(sock, hello | {"client": {"name": "miniature", "version": "1"}})
    granted, current = None, None
    for message in filter(None, map(read, packets(sock))):
        kind = message.get("type")
        if kind == "welcome" and granted is None:
            if message.get("version") not in ("1.1", "1.0"):
                raise Bad("version")
            granted = message.get("capabilities", [])
        elif kind is None and "meta" in message and granted is not None:
            generation = message.get("generation")
            if not whole(generation, 1) or (current is not None and "reinit" not in granted):
                continue
            if why := problem(message):
                send(sock, {"type": "open_failed", "generation": generation, "reason": why})
                continue
            send(sock, {"type": "opened", "generation": generation})
            if current is not None:
                send(sock, {"type": "closed", "generation": current})
            current, slots = generation, message["ring"]["slots"]
        elif kind == "frame" and current is not None and message.get("generation") == current:
            if whole(message.get("slot"), 0) and message["slot"] < slots:
                release = {"type": "release", "generation": current, "seq": message["seq"]}
                send(sock, release)


def msg(sock, version):
    if version == "1.1":
        hello = {"type": "hello", "versions": ["1.1", "1.0"], "capabilities": []}
        send(sock, hello | {"client": {"name": "miniature", "version": "1"}})
    send(sock, {"type": "get_viewport_size"})
    send(sock, {"type": "get_camera_pose", "cam_idx": 0})
    over = threading.Event()

    def pose():
        with contextlib.suppress(OSError):
            while not over.wait(0.03):
                send(sock, {
                    "type": "camera_pose",
                    "position": {"x": 0.1, "y": 0.0, "z": -4.0},
                    "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
                })  # fmt: skip

    threading.Thread(target=pose, daemon=True).start()
    try:
        for payload in packets(sock):
            message = read(payload) or {}
            if message.get("type") == "welcome" and message.get("version") not in ("1.1", "1.0"):
                raise Bad("version")
    finally:
        over.set()


def keep(port, talk, version):
    while True:
        began = time.monotonic()
        with contextlib.suppress(OSError, Bad), socket.create_connection((HOST, port)) as sock:
            talk(sock, version)
        time.sleep(max(0.0, 0.12 - (time.monotonic() - began)))


if __name__ == "__main__":
    threading.Thread(target=keep, args=(IPC, ipc, sys.argv[1]), daemon=True).start()
    keep(MSG, msg, sys.argv[1])
