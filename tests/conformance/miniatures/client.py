"""The smallest clients that conform, for testing the harness without the reference client.

Standard library only. `python client.py 1.0` speaks 1.0, `python client.py 1.1` speaks 1.1.
"""

import contextlib
import itertools
import json
import mmap
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


class Bad(Exception):  # noqa: N818
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


def finite(spelling):
    if abs(float(spelling)) == float("inf"):
        raise ValueError(spelling)
    return float(spelling) if set(spelling) & set(".eE") else int(spelling)


def depth(value):
    inside = value.values() if isinstance(value, dict) else value
    return 1 + max(map(depth, inside), default=0) if isinstance(value, dict | list) else 0


def read(payload):
    """The object in a payload, or None."""
    strict = {"object_pairs_hook": unique, "parse_constant": refuse}
    with contextlib.suppress(ValueError, RecursionError):
        value = json.loads(payload.decode(), parse_float=finite, parse_int=finite, **strict)
        json.dumps(value, ensure_ascii=False).encode()  # refuses half a pair of surrogates
        return value if isinstance(value, dict) and depth(value) <= 64 else None
    return None


def number(value):
    return isinstance(value, int | float) and not isinstance(value, bool)


def whole(value, least, most=2**53 - 1):
    return number(value) and value == int(value) and least <= value <= most


def multiple(value, unit, least=0):
    return whole(value, least) and value % unit == 0


def apart(ring, color, depth):
    """No two slots overlap."""
    slots = [(ring["colorOffset"] + k * ring["colorStride"], color) for k in range(ring["slots"])]
    slots += [(ring["depthOffset"] + k * ring["depthStride"], depth) for k in range(ring["slots"])]
    slots.sort()
    return all(a + size <= b for (a, size), (b, _) in itertools.pairwise(slots))


def opened(message):
    """The memory of an init packet of 1.1, mapped; or why it cannot be."""
    try:
        meta, ring, memory, means = (message[x] for x in ("meta", "ring", "memory", "semantics"))
        w, h, slots, size = meta["w"], meta["h"], ring["slots"], memory["bytes"]
        ok = (
            message["version"] == "1.1"
            and whole(w, 1, 32768) and whole(h, 1, 32768)
            and meta["fmtColor"] == "RGBA32F" and meta["fmtDepth"] == "R32F"
            and number(meta["pitchColor"]) and meta["pitchColor"] == 16 * w
            and number(meta["pitchDepth"]) and meta["pitchDepth"] == 4 * w
            and multiple(meta.get("offsetColor", 0), 16) and multiple(meta.get("offsetDepth", 0), 4)
            and whole(meta.get("device", 0), 0)
            and memory["kind"] == "host_shm"
            and 1 <= len(memory["name"]) <= 30
            and all(c.isascii() and (c.isalnum() or c in "._-") for c in memory["name"])
            and not memory["name"].startswith(".")
            and whole(slots, 1, 1024) and whole(size, 1)
            and multiple(ring["colorOffset"], 16) and multiple(ring["depthOffset"], 16)
            and multiple(ring["colorStride"], 16, 16 * w * h)
            and multiple(ring["depthStride"], 16, 4 * w * h)
            and ring["colorOffset"] + (slots - 1) * ring["colorStride"] + 16 * w * h <= size
            and ring["depthOffset"] + (slots - 1) * ring["depthStride"] + 4 * w * h <= size
            and means["rows"] == "bottom_up"
            and means["alpha"] in ("straight", "premultiplied")
            and means["colorSpace"] in ("srgb", "linear")
            and means["depth"]["kind"] in ("planar_z", "ray_distance")
            and means["depth"]["estimator"] in ("harmonic", "expected", "median")
            and (number(means["depth"]["empty"]) or means["depth"]["empty"] == "inf")
            and (means["unitMetres"] is None or number(means["unitMetres"]))
            and (means["unitMetres"] is None or means["unitMetres"] > 0)
            and isinstance(means["origin"], list) and len(means["origin"]) == 3
            and all(map(number, means["origin"]))
        )  # fmt: skip
        ring = {name: int(value) for name, value in ring.items() if number(value)}
        ok = ok and apart(ring, 16 * w * h, 4 * w * h)
        if not ok:
            return "a rule is broken"
        with Path("/dev/shm/" + memory["name"]).open("rb") as file:
            if (real := os.fstat(file.fileno()).st_size) < size:
                return f"{real} bytes, {size} announced"
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (KeyError, TypeError, OSError, AttributeError) as error:
        return repr(error)[:200]


def ipc(sock, version):
    if version == "1.0":
        for _ in packets(sock):
            pass
        return
    capabilities = ["host_shm", "frames", "reinit"]
    hello = {"type": "hello", "versions": ["1.1", "1.0"], "capabilities": capabilities}
    send(sock, hello | {"client": {"name": "miniature", "version": "1"}})
    granted, current, last, memory = None, None, 0, None
    for message in filter(None, map(read, packets(sock))):
        kind = message.get("type")
        if kind == "welcome" and granted is None:
            if message.get("version") not in ("1.1", "1.0"):
                raise Bad("version")
            granted = message.get("capabilities", [])
        elif kind is None and "meta" in message and granted is not None:
            generation = message.get("generation")
            if not whole(generation, last + 1) or (last and "reinit" not in granted):
                continue
            last, new = generation, opened(message)
            if isinstance(new, str):
                send(sock, {"type": "open_failed", "generation": generation, "reason": new})
                continue
            send(sock, {"type": "opened", "generation": generation})
            if current is not None:
                memory.close()
                send(sock, {"type": "closed", "generation": current})
            current, slots, memory = generation, message["ring"]["slots"], new
        elif kind == "frame" and current is not None and message.get("generation") == current:
            if not whole(message.get("slot"), 0, slots - 1):
                continue
            send(sock, {"type": "release", "generation": current, "seq": message["seq"]})


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
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            talk(sock, version)
        time.sleep(max(0.0, 0.12 - (time.monotonic() - began)))


if __name__ == "__main__":
    threading.Thread(target=keep, args=(IPC, ipc, sys.argv[1]), daemon=True).start()
    keep(MSG, msg, sys.argv[1])
