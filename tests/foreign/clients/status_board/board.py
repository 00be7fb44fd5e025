"""A status board for a rack of renderers: what is running, and how large its images are."""

import base64
import binascii
import json
import math
import os
import queue
import re
import socket
import sys
import threading
import time

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
IPC_PORT = int(os.environ.get("SPLATBUS_IPC_PORT", "6001"))
MSG_PORT = int(os.environ.get("SPLATBUS_MSG_PORT", "6000"))
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 8.0
REPLY_SECONDS, ASK_SECONDS = 6.0, 1.0
SAFE = 2**53 - 1


class Bad(Exception):
    """What the renderer said is of no use."""


class Gone(Exception):
    """There is nobody there any more."""


class Wire:
    """One connection, and the packets on it."""

    def __init__(self, port):
        self.sock = socket.create_connection((HOST, port), timeout=4)
        self.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def exactly(self, count, end):
        got = bytearray()
        while len(got) < count:
            if end is not None:
                left = end - time.monotonic()
                if left <= 0:
                    raise Gone("half a packet, and no more of it")
                self.sock.settimeout(left)
            chunk = self.sock.recv(min(count - len(got), 1 << 16))
            if not chunk:
                raise Gone("end of stream")
            got += chunk
        return bytes(got)

    def packet(self):
        """The next payload; waits for its first byte without end."""
        self.sock.settimeout(None)
        first = self.exactly(1, None)
        end = time.monotonic() + 9
        length = int.from_bytes(first + self.exactly(3, end), "little")
        if not 0 < length <= 1 << 20:
            raise Gone(f"a packet of {length} bytes")
        return self.exactly(length, end)

    def say(self, message):
        text = json.dumps(message, separators=(",", ":")).encode()
        self.sock.settimeout(4)
        self.sock.sendall(len(text).to_bytes(4, "little") + text)

    def close(self):
        try:
            self.sock.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        self.sock.close()


TOKENS = re.compile(r'"(?:[^"\\]|\\.)*"|[\[{]|[\]}]')


def understood(payload):
    """The object in a payload."""
    try:
        text = payload.decode("utf-8")
        level = 0
        for match in TOKENS.finditer(text):
            token = match.group()
            level += (token in "[{") - (token in "]}")
            if level > 64:
                raise Bad("too deep")
        value = json.loads(
            text, object_pairs_hook=pairs, parse_constant=constant, parse_float=real, parse_int=real
        )
        json.dumps(value, ensure_ascii=False).encode("utf-8")
    except (ValueError, RecursionError) as error:
        raise Bad(str(error)) from None
    if not isinstance(value, dict):
        raise Bad("no object")
    return value


def pairs(members):
    if len({name for name, _ in members}) < len(members):
        raise Bad("a name twice")
    return dict(members)


def constant(word):
    raise Bad(word)


def real(text):
    value = float(text)
    if math.isinf(value):
        raise Bad(f"{text[:20]} is too large")
    return value


def whole(value, low, high, step=1):
    if not isinstance(value, float) or not value.is_integer() or not low <= value <= high:
        raise Bad(f"{value!r:.30} is out of range")
    if int(value) % step:
        raise Bad(f"{value!r:.30} is no multiple of {step}")
    return int(value)


def handle(text):
    try:
        if isinstance(text, str) and len(text) == 88 and len(base64.b64decode(text, validate=True)) == 64:
            return
    except (binascii.Error, ValueError):
        pass
    raise Bad("a handle that is none")


def described(packet):
    """Width and height that an init packet has, after a look at all of it."""
    meta = packet.get("meta")
    if "type" in packet or not isinstance(meta, dict):
        return None
    size = whole(meta.get("w"), 1, 32768), whole(meta.get("h"), 1, 32768)
    if (meta.get("fmtColor"), meta.get("fmtDepth")) != ("RGBA32F", "R32F"):
        raise Bad("formats")
    whole(meta.get("pitchColor"), 16 * size[0], 16 * size[0])
    whole(meta.get("pitchDepth"), 4 * size[0], 4 * size[0])
    whole(meta.get("offsetColor", 0.0), 0, SAFE, 16)
    whole(meta.get("offsetDepth", 0.0), 0, SAFE, 4)
    whole(meta.get("device", 0.0), 0, SAFE)
    for name in ("mem_color", "mem_depth", "evt_done"):
        handle(packet.get(name))
    return size


class Board:
    def __init__(self):
        self.lines = queue.Queue()

    def images(self, wire):
        while True:
            try:
                if size := described(understood(wire.packet())):
                    self.lines.put(("images", "%d x %d" % size))
            except Bad as bad:
                self.lines.put(("images", f"unusable: {bad}"))

    def questions(self, wire):
        incoming = queue.Queue()
        threading.Thread(target=self.hear, args=(wire, incoming), daemon=True).start()
        while True:
            wire.say({"type": "get_viewport_size"})
            try:
                payload = incoming.get(timeout=REPLY_SECONDS)
            except queue.Empty:
                raise Gone("no reply") from None
            if isinstance(payload, Exception):
                raise Gone(str(payload))
            try:
                size = understood(payload).get("viewport_size")
                if not isinstance(size, list) or len(size) != 2:
                    raise Bad("no size")
                text = "%d x %d" % tuple(whole(each, 0, 32768) for each in size)
            except Bad as bad:
                raise Gone(f"a reply that is none: {bad}") from None
            self.lines.put(("view", text))
            try:
                left = incoming.get(timeout=ASK_SECONDS)
            except queue.Empty:
                continue
            raise Gone(str(left) if isinstance(left, Exception) else "a reply to no question")

    def hear(self, wire, incoming):
        while True:
            try:
                incoming.put(wire.packet())
            except (OSError, Gone) as error:
                incoming.put(error)
                return

    def watch(self, name, port, session):
        pause = FIRST_PAUSE
        while True:
            wire = None
            try:
                wire = Wire(port)
                pause = FIRST_PAUSE
                session(wire)
            except (OSError, Gone) as error:
                self.lines.put((name, f"{error}; again in {pause} s"))
            finally:
                if wire:
                    wire.close()
            time.sleep(pause)
            pause = min(2 * pause, LONGEST_PAUSE)


def main():
    board = Board()
    for name, port, session in (("images", IPC_PORT, board.images), ("view", MSG_PORT, board.questions)):
        threading.Thread(target=board.watch, args=(name, port, session), daemon=True).start()
    shown = {}
    while True:
        name, text = board.lines.get()
        if shown.get(name) != text:
            shown[name] = text
            print(f"{name:>8}: {text}", file=sys.stderr, flush=True)


main()
