"""A robot's camera arm. Its JSON comes out of a generator that knows no habits."""

import asyncio
import collections
import json
import math
import os
import random
import struct

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
PORT = int(os.environ.get("SPLATBUS_MSG_PORT", "6000"))
DICE = random.Random()
WANTED = ("scene", "ping", "intrinsics", "viewport", "telemetry", "objects", "x-robot-arm_2")
SAFE = 2**53 - 1


class Refused(Exception):
    pass


# ---- writing


def space():
    return DICE.choice(("", "", "", " ", "\n", "\t ", "\r\n"))


def string(text):
    if DICE.random() < 0.7:
        return json.dumps(text)
    return '"' + "".join(f"\\u{ord(c):04X}" if c < "\x7f" and DICE.random() < 0.3 else c for c in text) + '"'


def number(value):
    if str(value) == "-0.0":
        return DICE.choice(("-0.0", "-0e0", "-0"))
    if value == int(value) and abs(value) < 1e15:
        whole = int(value)
        ways = [f"{whole}", f"{whole}.0", f"{whole}e0", f"{whole}.00e+00"]
        if whole:
            ways.append(f"{whole}0E-1")
        if whole and whole % 100 == 0:
            ways.append(f"{whole // 100}e2")
        return DICE.choice(ways)
    return DICE.choice((repr(value), f"{value:.17e}", f"{value:.20g}"))


def written(value, more=0.4):
    if isinstance(value, dict):
        members = [(name, each, more) for name, each in value.items()]
        if DICE.random() < more:
            members += [(name, each, 0.0) for name, each in EXTRA]
        DICE.shuffle(members)
        inside = [space() + string(k) + space() + ":" + space() + written(v, m) for k, v, m in members]
        return "{" + (space() + ",").join(inside) + space() + "}"
    if isinstance(value, list):
        return "[" + (space() + ",").join(space() + written(each, more) for each in value) + space() + "]"
    if isinstance(value, str):
        return string(value)
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    return number(value)


EXTRA = [("x-arm", {"joint": [1, 2.5, None], "x": {"y": True}}), ("überflüssig", "\N{ROBOT FACE}")]


# ---- reading


def once(pairs):
    if len(dict(pairs)) < len(pairs):
        raise Refused("a name twice")
    return dict(pairs)


def finite(text):
    if not math.isfinite(float(text)):
        raise Refused("too large")
    return float(text)


def refuse(word):
    raise Refused(word)


def read(payload):
    try:
        text = payload.decode()
        deep = inside = 0
        escaped = False
        for c in text:
            if inside:
                inside, escaped = (c != '"' or escaped), (c == "\\" and not escaped)
            elif c == '"':
                inside = True
            elif c in "[{":
                deep += 1
                if deep > 64:
                    raise Refused("too deep")
            elif c in "]}":
                deep -= 1
        value = json.loads(
            text, object_pairs_hook=once, parse_float=finite, parse_int=finite, parse_constant=refuse
        )
        json.dumps(value, ensure_ascii=False).encode()
    except (ValueError, RecursionError) as error:
        raise Refused(str(error)) from None
    if not isinstance(value, dict):
        raise Refused("no object")
    return value


def numbers(value, count, low=-3.5e38, high=3.5e38):
    if not isinstance(value, list) or len(value) != count:
        raise Refused("not so many numbers")
    if not all(isinstance(each, float) and low <= each <= high for each in value):
        raise Refused("no numbers")
    return value


def check(kind, reply, asked):
    """Raises Refused if this is no reply to what was asked."""
    if kind in ("get_viewport_size", "set_viewport"):
        size = numbers(reply.get("viewport_size"), 2, 0, 32768)
        if not all(each.is_integer() for each in size):
            raise Refused("no size")
    elif kind == "get_camera_pose":
        numbers(reply.get("position"), 3)
        if abs(math.hypot(*numbers(reply.get("rotation"), 4)) - 1) > 0.01:
            raise Refused("no rotation")
        if "intrinsics" in reply:
            lens = reply["intrinsics"]
            numbers([lens.get(name) for name in ("width", "height", "fx", "fy", "near", "far")], 6, 1e-6)
            if lens["near"] >= lens["far"]:
                raise Refused("no lens")
    elif kind == "ping":
        if reply.get("t") != asked["t"] or not isinstance(reply.get("serverTime"), float):
            raise Refused("no pong")
    elif not isinstance(reply.get("objects"), list):
        raise Refused("no scene")


class Arm:
    """One connection, from hello to its end."""

    TYPES = {
        "get_viewport_size": "viewport_size",
        "set_viewport": "viewport_size",
        "get_camera_pose": "camera",
        "ping": "pong",
        "get_scene": "scene",
    }

    def __init__(self, reader, writer):
        self.reader, self.writer = reader, writer
        self.waiting = collections.deque()
        self.version, self.granted = None, frozenset()
        self.ready = asyncio.Event()
        self.not_before = 0.0
        self.clock = asyncio.get_running_loop().time

    def say(self, message):
        payload = written(message).encode()
        self.writer.write(struct.pack("<I", len(payload)) + payload)

    def ask(self, message):
        if self.version == "1.1" and DICE.random() < 0.8:
            taken = {each.get("id") for each, _ in self.waiting}
            free = {0, 7, 64, 100, SAFE, DICE.randrange(SAFE)} - taken
            message["id"] = DICE.choice(sorted(free))
        self.waiting.append((message, self.clock() + 9))
        self.say(message)

    def hello(self):
        self.say(
            {
                "type": "hello",
                "versions": ["1.1", "1.0"],
                "client": {"name": "arm", "version": ""},
                "capabilities": DICE.sample(WANTED, len(WANTED)),
            }
        )
        self.ask({"type": "get_viewport_size"})

    async def listen(self):
        while True:
            first = await self.reader.readexactly(1)
            async with asyncio.timeout(9):
                (length,) = struct.unpack("<I", first + await self.reader.readexactly(3))
                if not 1 <= length <= 1 << 20:
                    raise Refused(f"a length of {length}")
                payload = await self.reader.readexactly(length)
            try:
                message = read(payload)
            except Refused:
                if self.waiting:
                    raise
                continue
            self.take(message)

    def take(self, message):
        kind = message.get("type")
        if kind == "welcome" and self.version is None:
            self.version = message.get("version")
            if self.version not in ("1.0", "1.1"):
                raise Refused("a welcome to another version")
            if self.version == "1.1":
                listed = message.get("capabilities")
                self.granted = frozenset(each for each in listed if isinstance(each, str)) & set(WANTED)
        elif self.waiting:
            asked, _ = self.waiting[0]
            if kind == "error" and self.version != "1.0":
                if message.get("code") == "busy" and "id" not in message:
                    return
                if message.get("id") != asked.get("id"):
                    return
            elif self.version == "1.1":
                if kind not in self.TYPES.values():
                    return
                if kind != self.TYPES[asked["type"]] or message.get("id") != asked.get("id"):
                    raise Refused("a reply to something else")
                check(asked["type"], message, asked)
            elif kind is None or "viewport_size" in message or "position" in message:
                check(asked["type"], message, asked)
            else:
                return
            if message.get("viewport_size") == [0, 0]:
                self.not_before = self.clock() + 0.15
            self.waiting.popleft()
            self.version = self.version or "1.0"
            self.ready.set()

    async def watch(self):
        while not self.waiting or self.waiting[0][1] > self.clock():
            await asyncio.sleep(0.2)
        raise Refused("no reply")

    async def move(self):
        self.hello()
        await self.ready.wait()
        begun, turn = self.clock(), 0.0
        while True:
            turn += DICE.choice((0.05, 0.1, 0.25))
            half = turn / 2
            now = round(self.clock() - begun, 2)
            pose = {
                "type": "camera_pose",
                "timestamp": now,
                "position": {"x": DICE.choice((0, 1, 100, -0.0, math.sin(turn))), "y": -64, "z": math.cos(turn)},
                "rotation": {"x": 0, "y": math.sin(half), "z": 0, "w": math.cos(half)},
            }
            if "intrinsics" in self.granted and DICE.random() < 0.1:
                lens = {"fx": 100, "fy": 100.0, "cx": 32, "cy": 24, "width": 64, "height": 48}
                pose["intrinsics"] = {**lens, "near": 0.125, "far": 1e3}
            if self.version == "1.1" and DICE.random() < 0.1:
                pose["tag"] = DICE.choice(("a", "\N{ROBOT FACE}" * 64, "7"))
            self.say(pose)
            for _ in range(DICE.choice((0, 0, 0, 1, 3)) if len(self.waiting) < 4 else 0):
                self.ask(self.question(now))
            await self.writer.drain()
            await asyncio.sleep(DICE.choice((0.02, 0.03, 0.1)))

    def question(self, now):
        asks = [
            {"type": "get_camera_pose", "cam_idx": DICE.choice((0, -1, 1, 100, SAFE, -SAFE))},
        ]
        if self.clock() > self.not_before:
            asks.append({"type": "get_viewport_size", "timestamp": now})
        if "ping" in self.granted:
            asks.append({"type": "ping", "t": now + 1e2})
        if "scene" in self.granted:
            asks.append({"type": "get_scene"})
        if "viewport" in self.granted:
            asks.append({"type": "set_viewport", "width": 64, "height": 48})
        return DICE.choice(asks)


async def main():
    while True:
        try:
            arm = Arm(*await asyncio.wait_for(asyncio.open_connection(HOST, PORT), 4))
            tasks = [asyncio.ensure_future(it) for it in (arm.listen(), arm.watch(), arm.move())]
            try:
                done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                print(repr(done.pop().exception()), flush=True)
            finally:
                for task in tasks:
                    task.cancel()
                arm.writer.transport.abort()
        except (OSError, TimeoutError) as error:
            print(error, flush=True)
        await asyncio.sleep(DICE.uniform(0.3, 2))


asyncio.run(main())
