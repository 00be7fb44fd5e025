"""An engine in Play mode: one pair of connections, as long as they last, and then the editor."""

import json
import math
import os
import re
import selectors
import signal
import socket
import sys
import time

NAMES = ("ipc", "msg")
STRINGS = re.compile(r'"(?:[^"\\]|\\.)*"')


def strict(payload):
    """The object of a payload; ValueError where it is none that may be acted upon."""
    text = payload.decode()
    level = deepest = 0
    for bracket in re.findall(r"[\[\]{}]", STRINGS.sub("", text)):
        level += 1 if bracket in "[{" else -1
        deepest = max(deepest, level)
    if deepest > 64:
        raise ValueError("too deep")

    def fits(digits):
        number = float(digits)
        if math.isinf(number):
            raise ValueError(digits)
        return number

    def members(pairs):
        if len({name for name, _ in pairs}) < len(pairs):
            raise ValueError("twice")
        return dict(pairs)

    def no(word):
        raise ValueError(word)

    value = json.loads(
        text, parse_int=fits, parse_float=fits, parse_constant=no, object_pairs_hook=members
    )
    json.dumps(value, ensure_ascii=False).encode()
    if not isinstance(value, dict):
        raise ValueError("no object")
    return value


def floats(value, count):
    if not isinstance(value, list) or len(value) != count:
        raise ValueError("another shape")
    if not all(isinstance(each, float) and abs(each) < 3.5e38 for each in value):
        raise ValueError("no numbers")
    return value


class Editor:
    def __init__(self):
        self.lines = {}
        self.buffers = dict.fromkeys(NAMES, b"")
        self.since = dict.fromkeys(NAMES, 0.0)
        self.centre = None
        self.asked = 0.0
        self.started = time.monotonic()

    def play(self):
        """Tries both channels once a quarter of a second, until each has let it in once."""
        selector = selectors.DefaultSelector()
        missing, tried = set(NAMES), -1.0
        while missing or self.lines:
            now = time.monotonic()
            if missing and now > tried + 0.25:
                tried = now
                for name in sorted(missing):
                    if line := self.open(name):
                        missing.discard(name)
                        selector.register(line, selectors.EVENT_READ, name)
            for key, _ in selector.select(0.03):
                self.read(selector, key.data)
            self.tick(selector)

    def open(self, name):
        port = int(os.environ.get(f"SPLATBUS_{name.upper()}_PORT", 6000 + (name == "ipc")))
        try:
            host = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
            line = socket.create_connection((host, port), 1)
        except OSError:
            return None
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.lines[name] = line
        if name == "msg":
            self.asked = time.monotonic()
            self.say({"type": "get_camera_pose", "cam_idx": 0})
        return line

    def say(self, message):
        payload = json.dumps(message, separators=(",", ":")).encode()
        self.lines["msg"].sendall(len(payload).to_bytes(4, "little") + payload)

    def drop(self, selector, name):
        selector.unregister(self.lines[name])
        self.lines.pop(name).close()

    def read(self, selector, name):
        try:
            if not (data := self.lines[name].recv(1 << 16)):
                raise ConnectionError
            if not self.buffers[name]:
                self.since[name] = time.monotonic()
            self.buffers[name] += data
            while len(buffer := self.buffers[name]) >= 4:
                length = int.from_bytes(buffer[:4], "little")
                if not 1 <= length <= 1 << 20:
                    raise ConnectionError
                if len(buffer) < 4 + length:
                    break
                self.buffers[name] = buffer[4 + length :]
                self.since[name] = time.monotonic()
                if name == "msg" and self.asked:
                    self.reply(strict(buffer[4 : 4 + length]))
        except (OSError, ValueError, RecursionError):
            self.drop(selector, name)

    def reply(self, answer):
        """The camera first, then the size, until there is one."""
        if self.centre is None:
            position, rotation = floats(answer.get("position"), 3), answer.get("rotation")
            if abs(math.hypot(*floats(rotation, 4)) - 1) > 0.01:
                raise ValueError("no rotation")
            self.centre = position
        elif floats(answer.get("viewport_size"), 2) != [0, 0]:
            self.asked = 0.0
            return
        else:
            time.sleep(0.15)
        self.asked = time.monotonic()
        self.say({"type": "get_viewport_size"})

    def tick(self, selector):
        now = time.monotonic()
        for name in list(self.lines):
            late = self.buffers[name] and now > self.since[name] + 10
            if late or (name == "msg" and self.asked and now > self.asked + 9):
                self.drop(selector, name)
        if "msg" in self.lines and self.centre and not self.asked:
            turn = now - self.started
            x, y, z = self.centre
            half = {"x": 0.0, "y": math.sin(turn / 2), "z": 0.0, "w": math.cos(turn / 2)}
            place = {"x": x + math.sin(turn), "y": y, "z": z}
            try:
                self.say(
                    {"type": "camera_pose", "timestamp": turn, "position": place, "rotation": half}
                )
            except OSError:
                self.drop(selector, "msg")


signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
Editor().play()
while True:
    time.sleep(60)
