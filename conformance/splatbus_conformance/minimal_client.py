"""A whole client for SplatBus 1.1 in plain Python, made by the steps of write-a-client.md.

It needs nothing but the standard library. It sways around the server's first camera, writes the
first image to a file if one is named (`minimal_client.py picture.ppm`), and tells of the others.
"""

# ruff: noqa: D102, D103

import itertools
import json
import math
import mmap
import os
import re
import socket
import sys
import threading
import time
from pathlib import Path

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
IPC_PORT = int(os.environ.get("SPLATBUS_IPC_PORT", "6001"))
MSG_PORT = int(os.environ.get("SPLATBUS_MSG_PORT", "6000"))
VERSIONS = ["1.1", "1.0"]
MAX_PAYLOAD, MAX_DEPTH, MAX_SIZE, MAX_SLOTS = 1_048_576, 64, 32_768, 1024
PACKET_SECONDS = REPLY_SECONDS = 10.0
LARGEST = 2**53 - 1


# Step 1: packets


class Splitter:
    """Bytes in, payloads out, however TCP divides them."""

    def __init__(self):
        self.held = bytearray()

    def feed(self, data):
        self.held += data
        while len(self.held) >= 4:
            length = int.from_bytes(self.held[:4], "little")
            if not 1 <= length <= MAX_PAYLOAD:
                raise ConnectionError(f"a payload of {length} bytes is announced [FRM-3]")
            if len(self.held) < 4 + length:
                return
            payload = bytes(self.held[4 : 4 + length])
            del self.held[: 4 + length]
            yield payload


def packet(message):
    payload = json.dumps(message, allow_nan=False).encode()
    return len(payload).to_bytes(4, "little") + payload


# Step 2: text


def read(payload):
    """The object in a payload, or None if it is not to be acted on [JSN-8]."""
    try:
        value = json.loads(
            payload.decode(),
            object_pairs_hook=once,
            parse_float=finite,
            parse_int=finite,
            parse_constant=finite,
        )
        json.dumps(value, ensure_ascii=False).encode()  # refuses half a pair of surrogates
        deep = depth_of(value) > MAX_DEPTH
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) and not deep else None


def once(pairs):
    if len(dict(pairs)) < len(pairs):
        raise ValueError("a name stands twice [JSN-3]")
    return dict(pairs)


def finite(spelling):
    """The nearest double [ACC-14], as an integer where it is one that counts something."""
    number = float(spelling)
    if not math.isfinite(number):
        raise ValueError("a number is not finite [JSN-4]")
    return int(number) if number.is_integer() and abs(number) <= LARGEST else number


def depth_of(value):
    if not isinstance(value, dict | list):
        return 0
    return 1 + max(map(depth_of, value.values() if isinstance(value, dict) else value), default=0)


# Step 3: a connection, and the message channel


def keep(port, talk):
    """Connect and talk, again and again, each channel for itself [CHN-19 to CHN-23]."""
    while True:
        try:
            with socket.create_connection((HOST, port), timeout=5) as connection:
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                talk(connection)
        except OSError as problem:
            print(f"port {port}: {problem}", flush=True)
        time.sleep(0.2)  # [CHN-21, NEG-24]


def packets(connection, tick):
    """Payloads as they come, and None at least every `tick` seconds."""
    splitter, began = Splitter(), time.monotonic()
    connection.settimeout(tick)
    while True:
        try:
            data = connection.recv(1 << 16)
            if not data:
                return  # the server has ended the stream [CHN-17]
        except TimeoutError:
            data = b""
        for payload in splitter.feed(data):
            yield payload
            began = time.monotonic()
        if not splitter.held:
            began = time.monotonic()
        elif time.monotonic() > began + PACKET_SECONDS:
            raise ConnectionError("a packet does not end [FRM-5]")
        yield None


def message_channel(connection):
    connection.sendall(packet(hello([])))
    connection.sendall(packet({"type": "get_viewport_size"}))
    connection.sendall(packet({"type": "get_camera_pose", "cam_idx": 0}))
    asked, ask_again = time.monotonic(), math.inf
    welcome, size, camera, stopped = None, None, None, False
    for payload in packets(connection, 1 / 30):
        now = time.monotonic()
        message = read(payload) if payload else None
        if message and message.get("type") == "welcome" and not welcome and not size:
            welcome = accepted(message)
        elif message and message.get("type") == "error":
            print("the server says:", str(message.get("message"))[:200], flush=True)
            stopped = True
        elif message and "viewport_size" in message:
            size = checked_size(message)
            ask_again = now + 0.2 if size == [0, 0] else math.inf  # [REQ-12]
        elif message and "position" in message:
            camera = checked_pose(message)
        if now > ask_again:
            connection.sendall(packet({"type": "get_viewport_size"}))
            asked, ask_again, size = now, math.inf, None
        if not stopped and (size is None or camera is None) and now > asked + REPLY_SECONDS:
            raise ConnectionError("no reply [CHN-15]")
        if camera and payload is None:
            connection.sendall(packet(camera_pose(*camera, now)))


def checked_size(reply):
    size = reply["viewport_size"]
    if not (isinstance(size, list) and len(size) == 2 and all(whole(n, 0, MAX_SIZE) for n in size)):
        raise ConnectionError("a size that is none [REQ-13]")
    return size


def checked_pose(reply):
    position, rotation = reply.get("position"), reply.get("rotation")
    if not (numbers(position, 3) and numbers(rotation, 4)):
        raise ConnectionError("a pose that is none [REQ-13]")
    if abs(math.hypot(*rotation) - 1) > 0.01 or max(map(abs, position)) > 3.4e38:
        raise ConnectionError("a pose that is none [REQ-13]")
    return position, rotation


def whole(value, least, most=LARGEST):
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and least <= value <= most and value == int(value)


def numbers(value, count):
    return isinstance(value, list) and [type(n) in (int, float) for n in value] == [True] * count


def is_single(value):
    """A number that single precision does not round to infinity."""
    return numbers([value], 1) and abs(value) < 2**128 - 2**103


# Step 4: poses


def camera_pose(position, rotation, now):
    """Sway along x. Axes are the wire's: x right, y down, z forward; an engine converts here."""
    position = [position[0] + 0.3 * math.sin(now), *position[1:]]
    return {
        "type": "camera_pose",
        "timestamp": now,
        "position": dict(zip("xyz", position, strict=True)),
        "rotation": dict(zip("xyzw", rotation, strict=True)),
    }


# Step 5: hello and welcome


def hello(capabilities):
    client = {"name": "minimal", "version": "1"}
    return {"type": "hello", "versions": VERSIONS, "client": client, "capabilities": capabilities}


def accepted(welcome):
    if welcome.get("version") not in VERSIONS:
        raise ConnectionError("a version that we did not list [NEG-16]")
    return welcome


# Step 6: the init packet, and memory


class Images:
    """The memory of one init packet, checked, then mapped. ValueError says what is wrong."""

    def __init__(self, init):
        meta, memory, ring, semantics = (
            init[name] for name in ("meta", "memory", "ring", "semantics")
        )
        demand(re.fullmatch(r"1\.[1-9][0-9]*", init["version"]), "the version [MEM-1, MEM-18]")
        w, h = meta["w"], meta["h"]
        demand(whole(w, 1, MAX_SIZE) and whole(h, 1, MAX_SIZE), "the size [INI-2]")
        demand((meta["fmtColor"], meta["fmtDepth"]) == ("RGBA32F", "R32F"), "a format [INI-3]")
        demand(meta["pitchColor"] == 16 * w and meta["pitchDepth"] == 4 * w, "a pitch [INI-4]")
        demand(multiple(meta.get("offsetColor", 0), 16, 0), "offsetColor [INI-5]")
        demand(multiple(meta.get("offsetDepth", 0), 4, 0), "offsetDepth [INI-5]")
        demand(whole(meta.get("device", 0), 0), "the device [INI-6]")
        demand(memory["kind"] == "host_shm", "only memory of the host can be read here [NEG-4]")
        name = re.fullmatch(r"(?!\.)[A-Za-z0-9._-]{1,30}", memory["name"])
        demand(name, "the name of the memory [MEM-7]")
        demand(whole(memory["bytes"], 1), "the size of the memory [MEM-2]")
        demand(whole(ring["slots"], 1, MAX_SLOTS), "the number of slots [MEM-8]")
        ranges = []
        for plane, size in (("color", 16 * w * h), ("depth", 4 * w * h)):
            offset, stride = ring[f"{plane}Offset"], ring[f"{plane}Stride"]
            demand(multiple(offset, 16, 0) and multiple(stride, 16, size), f"{plane} [MEM-8]")
            demand(offset + (ring["slots"] - 1) * stride + size <= memory["bytes"], "[MEM-10]")
            ranges += [(offset + k * stride, size) for k in range(int(ring["slots"]))]
        ranges.sort()
        apart = all(a + size <= b for (a, size), (b, _) in itertools.pairwise(ranges))
        demand(apart, "two slots overlap [MEM-9]")
        check_semantics(semantics)
        self.width, self.height, self.ring, self.semantics = int(w), int(h), ring, semantics
        self.generation = init["generation"]
        self.memory = map_memory(memory["name"], int(memory["bytes"]))

    def rows(self, plane, slot):
        """Rows of floats, the top one first."""
        pitch = self.width * (16 if plane == "color" else 4)
        begins = [
            row_begins(self.ring, plane, slot, self.height, pitch, row)
            for row in range(self.height)
        ]
        return [memoryview(self.memory[at : at + pitch]).cast("f").tolist() for at in begins]


def row_begins(ring, plane, slot, height, pitch, row):
    """The byte where a row of the image begins; in memory the bottom one is first [BUF-1]."""
    return int(ring[f"{plane}Offset"] + slot * ring[f"{plane}Stride"] + (height - 1 - row) * pitch)


def check_semantics(semantics):
    depth, unit = semantics["depth"], semantics["unitMetres"]
    known = (
        semantics["rows"] == "bottom_up"
        and semantics["alpha"] in ("straight", "premultiplied")
        and semantics["colorSpace"] in ("srgb", "linear")
        and depth["kind"] in ("planar_z", "ray_distance")
        and depth["estimator"] in ("harmonic", "expected", "median")
        and (depth["empty"] == "inf" or is_single(depth["empty"]))
        and (unit is None or (numbers([unit], 1) and unit > 0))
        and numbers(semantics["origin"], 3)
    )
    demand(known, "what the numbers mean [MEM-11]")


def demand(holds, what):
    if not holds:
        raise ValueError(f"not as the standard says, or not for this client: {what}")


def multiple(value, unit, least):
    return whole(value, least) and value % unit == 0


def map_memory(name, size):
    """The memory, whose size is looked at before a byte of it is [MEM-6]."""
    if sys.platform == "linux":
        with Path("/dev/shm", name).open("rb") as file:
            demand(os.fstat(file.fileno()).st_size >= size, "the memory is too small [MEM-6]")
            return mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ)
    demand(sys.platform == "win32", "memory on this system is not written here")
    from multiprocessing.shared_memory import SharedMemory

    existing = SharedMemory(f"Local\\{name}")  # mmap alone would make what does not exist
    demand(existing.size >= size, "the memory is too small [MEM-6]")
    found = mmap.mmap(-1, size, tagname=f"Local\\{name}", access=mmap.ACCESS_READ)
    existing.close()
    return found


# Steps 6 to 8: the IPC channel


def ipc_channel(connection):
    connection.sendall(packet(hello(["host_shm", "frames", "reinit"])))
    granted, waiting, last, images, seen = None, None, 0, None, 0.0
    for payload in packets(connection, 1.0):
        message = read(payload) if payload else None
        kind = message.get("type") if message else None
        if kind == "welcome" and granted is None:
            accepted(message)
            granted = message.get("capabilities") if message["version"] == "1.1" else []
        elif message and "type" not in message and "meta" in message and "version" in message:
            waiting = message
        elif message and "type" not in message and "meta" in message and granted is None:
            granted = []  # a server of 1.0: say nothing more [NEG-14]
        elif kind == "frame" and images and "frames" in granted and lends(message, images):
            seen = show(images, message, seen)
            lease = {"generation": images.generation, "seq": message["seq"]}
            connection.sendall(packet({"type": "release"} | lease))
        if not (waiting and granted):
            continue
        init, waiting = waiting, None
        if not whole(init.get("generation"), last + 1) or (last and "reinit" not in granted):
            continue
        former, images, last = images, opened(connection, init), init["generation"]
        if former:
            former.memory.close()
            connection.sendall(packet({"type": "closed", "generation": former.generation}))


def opened(connection, init):
    """Map the memory and say so, or say why not, and go on without [OPN-1, OPN-4]."""
    generation = init["generation"]
    try:
        images = Images(init)
    except (ValueError, KeyError, TypeError, AttributeError, OSError) as problem:
        reason = f"{type(problem).__name__}: {problem}"[:500]
        failed = {"type": "open_failed", "generation": generation, "reason": reason}
        connection.sendall(packet(failed))
        return None
    connection.sendall(packet({"type": "opened", "generation": generation}))
    return images


# Step 7: the image


def lends(frame, images):
    """Whether the frame is of memory that is open, and of a slot that exists [IMG-15]."""
    named = whole(frame.get("generation"), 1) and whole(frame.get("seq"), 0)
    known = named and frame["generation"] == images.generation
    return known and whole(frame.get("slot"), 0, images.ring["slots"] - 1)


def show(images, frame, seen):
    """Write the first image to a file; tell of one a second. The time of the last told."""
    if len(sys.argv) > 1 and not Path(sys.argv[1]).exists():
        Path(sys.argv[1]).write_bytes(picture(images, int(frame["slot"])))
    if time.monotonic() < seen + 1:
        return seen
    depth = images.rows("depth", int(frame["slot"]))[images.height // 2][images.width // 2]
    size = f"{images.width}x{images.height}"
    print(f"image {frame['seq']}: {size}, {depth:.3f} to what is in the middle", flush=True)
    return time.monotonic()


def picture(images, slot):
    """A PPM file: the image over black."""
    straight = images.semantics["alpha"] == "straight"
    linear = images.semantics["colorSpace"] == "linear"
    out = bytearray(f"P6 {images.width} {images.height} 255\n".encode())
    for row in images.rows("color", slot):
        for j in range(0, len(row), 4):
            weight = row[j + 3] if straight else 1.0
            colors = (min(max(c * weight, 0.0), 1.0) for c in row[j : j + 3])
            out += bytes(round(255 * (encoded(c) if linear else c)) for c in colors)
    return bytes(out)


def encoded(linear):
    """The sRGB transfer function."""
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055


if __name__ == "__main__":
    threading.Thread(target=keep, args=(IPC_PORT, ipc_channel), daemon=True).start()
    keep(MSG_PORT, message_channel)
