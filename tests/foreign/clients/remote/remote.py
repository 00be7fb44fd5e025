"""A remote control: poses and requests, no images. Blocking sockets, one thread."""

import json
import math
import os
import re
import select
import socket
import struct
import time

ADDRESS = (
    os.environ.get("SPLATBUS_HOST", "127.0.0.1"),
    int(os.environ.get("SPLATBUS_MSG_PORT", "6000")),
)
MOST = 1 << 20
STRING = re.compile(r'"(?:[^"\\]|\\.)*"')


class Nonsense(ValueError):
    pass


def depth(text):
    now = most = 0
    for character in STRING.sub("", text):
        if character in "[{":
            now += 1
            most = max(most, now)
        elif character in "]}":
            now -= 1
    return most


def unique(pairs):
    members = dict(pairs)
    if len(members) != len(pairs):
        raise Nonsense("a name twice")
    return members


def number(text):
    value = float(text)
    if not math.isfinite(value):
        raise Nonsense(text[:20])
    return value


def refuse(text):
    raise Nonsense(text)


def parsed(payload):
    text = payload.decode("utf-8")
    if depth(text) > 64:
        raise Nonsense("too deep")
    value = json.loads(
        text, object_pairs_hook=unique, parse_float=number, parse_int=number, parse_constant=refuse
    )
    json.dumps(value, ensure_ascii=False).encode("utf-8")  # half a surrogate pair has no bytes
    if not isinstance(value, dict):
        raise Nonsense("no object")
    return value


def numbers(value, count):
    if not isinstance(value, list) or len(value) != count:
        raise Nonsense("not so many numbers")
    if not all(isinstance(each, float) and abs(each) <= 3.4028234663852886e38 for each in value):
        raise Nonsense("no numbers")
    return value


def size_in(reply):
    size = numbers(reply.get("viewport_size"), 2)
    if not all(each.is_integer() and 0 <= each <= 32768 for each in size):
        raise Nonsense("no size")
    return int(size[0]), int(size[1])


def camera_in(reply):
    position, rotation = numbers(reply.get("position"), 3), numbers(reply.get("rotation"), 4)
    if abs(math.hypot(*rotation) - 1) > 0.01:
        raise Nonsense("no rotation")
    return position, rotation


class Lost(Exception):
    pass


class Line:
    def __init__(self):
        self.socket = socket.create_connection(ADDRESS, 5)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket.settimeout(5)
        self.buffer = b""
        self.since = 0.0

    def say(self, message):
        payload = json.dumps(message).encode()
        self.socket.sendall(struct.pack("<I", len(payload)) + payload)

    def packets(self, seconds):
        """What comes within some seconds: whole payloads, perhaps none."""
        end = time.monotonic() + seconds
        while not (found := self.whole()):
            now = time.monotonic()
            if self.buffer and now > self.since + 10:
                raise Lost("half a packet")
            if now >= end:
                break
            readable, _, _ = select.select([self.socket], [], [], end - now)
            if readable:
                if not self.buffer:
                    self.since = time.monotonic()
                if not (data := self.socket.recv(65536)):
                    raise Lost("end of stream")
                self.buffer += data
        return found

    def whole(self):
        found = []
        while len(self.buffer) >= 4:
            (length,) = struct.unpack("<I", self.buffer[:4])
            if not 1 <= length <= MOST:
                raise Lost("a length of %d" % length)
            if len(self.buffer) < 4 + length:
                break
            found.append(self.buffer[4 : 4 + length])
            self.buffer = self.buffer[4 + length :]
            self.since = time.monotonic()
        return found


class Remote:
    def __init__(self):
        self.centre = None
        self.last = None
        self.turn = 0.0
        self.begun = time.monotonic()

    def pose(self):
        self.turn += 0.02
        x, y, z = self.centre
        half = self.turn / 2
        self.last = {
            "type": "camera_pose",
            "timestamp": time.monotonic() - self.begun,
            "position": {"x": x + math.sin(self.turn), "y": y, "z": z},
            "rotation": {"x": 0.0, "y": math.sin(half), "z": 0.0, "w": math.cos(half)},
        }
        return self.last

    def session(self, line):
        if self.last:
            line.say({**self.last, "timestamp": time.monotonic() - self.begun})
        waiting = None
        asked = next_ask = 0.0
        questions = 0
        while True:
            now = time.monotonic()
            if waiting is None and now >= next_ask:
                waiting = camera_in if questions % 2 == 0 else size_in
                line.say(
                    {"type": "get_camera_pose", "cam_idx": 0}
                    if waiting is camera_in
                    else {"type": "get_viewport_size"}
                )
                questions, asked, next_ask = questions + 1, now, now + 0.2
            if waiting and now > asked + 8:
                raise Lost("no reply")
            if self.centre:
                line.say(self.pose())
            for payload in line.packets(0.04):
                reply = parsed(payload)
                if waiting is None:
                    continue
                answer = waiting(reply)
                if waiting is camera_in and self.centre is None:
                    self.centre = answer[0]
                waiting = None


def main():
    remote, pause = Remote(), 0.1
    while True:
        begun = time.monotonic()
        try:
            line = Line()
        except OSError:
            pause = min(2 * pause, 4.0)
        else:
            pause = 0.15
            try:
                remote.session(line)
            except (OSError, Lost, ValueError, RecursionError):
                pass
            line.socket.close()
        time.sleep(max(0.0, begun + pause - time.monotonic()))


main()
