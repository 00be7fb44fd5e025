"""Moves splats about, and looks at them: SplatBus 1.1 with asyncio and memory of the host."""

import asyncio
import itertools
import json
import math
import mmap
import os
import re
import struct
import time

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
SAFE = 2**53 - 1
NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,29}")
VERSION = re.compile(r"1\.[1-9][0-9]*")
QUOTED = re.compile(r'"(?:[^"\\]|\\.)*"')


def message_in(payload):
    """The object in a payload, or None."""
    try:
        text = payload.decode()
        depths = itertools.accumulate(
            {"{": 1, "[": 1, "}": -1, "]": -1}.get(c, 0) for c in QUOTED.sub("", text)
        )
        if max(depths, default=0) > 64:
            return None
        value = json.loads(
            text, object_pairs_hook=once, parse_int=finite, parse_float=finite, parse_constant=never
        )
        json.dumps(value, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None


def once(pairs):
    if len(dict(pairs)) < len(pairs):
        raise ValueError("a member twice")
    return dict(pairs)


def finite(text):
    value = float(text)
    if math.isinf(value):
        raise ValueError("overflow")
    return int(value) if value.is_integer() and abs(value) <= SAFE else value


def never(text):
    raise ValueError(text)


class Bad(Exception):
    pass


def need(fact, why):
    if not fact:
        raise Bad(why)


def whole(of, name, least, most=SAFE, unit=1):
    value = of.get(name)
    fits = isinstance(value, int) and not isinstance(value, bool) and least <= value <= most
    need(fits and value % unit == 0, f"{name} is not what it may be")
    return value


def real(value):
    return isinstance(value, int | float) and not isinstance(value, bool)


class Ring:
    """The memory of one init packet, mapped; Bad where it cannot or must not be."""

    def __init__(self, packet):
        for part in ("meta", "memory", "ring", "semantics"):
            need(isinstance(packet.get(part), dict), f"no {part}")
        meta, memory, ring, sense = (packet[n] for n in ("meta", "memory", "ring", "semantics"))
        version = packet.get("version")
        need(isinstance(version, str) and VERSION.fullmatch(version), "another version")
        w, h = whole(meta, "w", 1, 32768), whole(meta, "h", 1, 32768)
        whole(meta, "pitchColor", 16 * w, 16 * w)
        whole(meta, "pitchDepth", 4 * w, 4 * w)
        for name, unit in (("offsetColor", 16), ("offsetDepth", 4), ("device", 1)):
            need(name not in meta or whole(meta, name, 0, SAFE, unit) >= 0, name)
        formats = meta.get("fmtColor"), meta.get("fmtDepth")
        need(formats == ("RGBA32F", "R32F"), "another format")
        self.sense(sense)
        size = whole(memory, "bytes", 1)
        self.slots = whole(ring, "slots", 1, 1024)
        planes = []
        for name, bytes_each in (("color", 16 * w * h), ("depth", 4 * w * h)):
            at = whole(ring, name + "Offset", 0, SAFE, 16)
            stride = whole(ring, name + "Stride", bytes_each, SAFE, 16)
            need(at + (self.slots - 1) * stride + bytes_each <= size, f"{name} ends outside (MEM-10)")
            planes += [(at + slot * stride, bytes_each) for slot in range(self.slots)]
        ordered = sorted(planes)
        need(all(a + n <= b for (a, n), (b, _) in itertools.pairwise(ordered)), "planes overlap")
        self.planes = planes[: self.slots], planes[self.slots :]
        name = memory.get("name")
        need(memory.get("kind") == "host_shm", "no memory of the host")
        need(isinstance(name, str) and NAME.fullmatch(name), "no name")
        try:
            file = os.open("/dev/shm/" + name, os.O_RDONLY | os.O_NOFOLLOW)
        except OSError as error:
            raise Bad(str(error)) from None
        try:
            need(os.fstat(file).st_size >= size, "the memory is shorter than announced (MEM-6)")
            self.memory = mmap.mmap(file, size, access=mmap.ACCESS_COPY)
        finally:
            os.close(file)

    @staticmethod
    def sense(sense):
        depth = sense.get("depth")
        need(isinstance(depth, dict), "no depth")
        need(sense.get("rows") == "bottom_up", "rows")
        need(sense.get("alpha") in ("straight", "premultiplied"), "alpha")
        need(sense.get("colorSpace") in ("srgb", "linear"), "colorSpace")
        need(depth.get("kind") in ("planar_z", "ray_distance"), "kind")
        need(depth.get("estimator") in ("harmonic", "expected", "median"), "estimator")
        empty = depth.get("empty")
        need(empty == "inf" or (real(empty) and abs(empty) < 2**128 - 2**103), "empty")
        metres = sense.get("unitMetres", "absent")
        need(metres is None or (real(metres) and metres > 0), "unitMetres")
        origin = sense.get("origin")
        need(isinstance(origin, list) and len(origin) == 3 and all(map(real, origin)), "origin")

    def look(self, slot):
        """The middle of each plane, copied."""
        for plane in self.planes:
            at, size = plane[slot]
            bytes(self.memory[at + size // 2 : at + size // 2 + 64])


class Talk:
    """A connection that says hello."""

    def __init__(self, reader, writer):
        self.reader, self.writer = reader, writer
        self.version, self.granted = None, set()
        self.scolded = False

    def say(self, type_, **members):
        payload = json.dumps({"type": type_, **members}).encode()
        self.writer.write(struct.pack("<I", len(payload)) + payload)

    def hello(self, *capabilities):
        client = {"name": "splat mover", "version": "0"}
        listed = list(capabilities)
        self.say("hello", versions=["1.1", "1.0"], client=client, capabilities=listed)

    async def packets(self):
        while first := await self.reader.read(1):
            async with asyncio.timeout(10):
                header = first + await self.reader.readexactly(3)
                (length,) = struct.unpack("<I", header)
                need(1 <= length <= 1 << 20, "a length of no packet")
                payload = await self.reader.readexactly(length)
            yield message_in(payload)

    def welcomed(self, message):
        if self.version is None:
            need(message.get("version") in ("1.1", "1.0"), "a version that was not offered")
            granted = message.get("capabilities")
            need(isinstance(granted, list), "no capabilities")
            self.version = message["version"]
            self.granted = {each for each in granted if isinstance(each, str)}


class Images(Talk):
    """The IPC channel."""

    async def run(self):
        self.hello("host_shm", "frames")
        self.ring = self.generation = held = None
        async for message in self.packets():
            if message is None or self.version == "1.0":
                continue
            kind = message.get("type")
            if kind == "welcome":
                self.welcomed(message)
                if held is not None and self.version == "1.1":
                    self.open(held)
            elif kind == "error":
                self.scolded = True
            elif kind == "frame" and self.ring:
                self.frame(message)
            elif "type" not in message and "meta" in message:
                if self.version:
                    self.open(message)
                elif "version" not in message:
                    self.version = "1.0"
                elif held is None:
                    held = message

    def open(self, packet):
        generation = packet.get("generation")
        if self.generation or type(generation) is not int or generation < 1:
            return  # one a connection: reinit is not offered
        self.generation = generation
        try:
            self.ring = Ring(packet)
        except Bad as bad:
            self.say("open_failed", generation=generation, reason=str(bad))
        else:
            self.say("opened", generation=generation)

    def frame(self, message):
        slot, seq = message.get("slot"), message.get("seq")
        named = message.get("generation")
        known = type(named) is int and named == self.generation and "frames" in self.granted
        counted = type(seq) is int and 0 <= seq <= SAFE
        if known and counted and type(slot) is int and 0 <= slot < self.ring.slots:
            self.ring.look(slot)
            self.say("release", generation=self.generation, seq=seq)


class Steering(Talk):
    """The message channel."""

    turn = 0.0
    """Of the process: a connection that comes back goes on from there."""

    async def run(self):
        self.hello("objects")
        self.say("get_viewport_size")
        moving = asyncio.create_task(self.move())
        self.asked = True
        try:
            async for message in self.packets():
                kind = message.get("type") if message else None
                if kind == "welcome":
                    self.welcomed(message)
                elif kind == "error":
                    self.scolded = True
                    self.asked = self.asked and message.get("code") == "busy"
                elif self.asked and kind in (None, "viewport_size"):
                    self.asked = False
                    need(message and self.size(message.get("viewport_size")), "no reply")
                    self.version = self.version or "1.0"
        finally:
            moving.cancel()

    @staticmethod
    def size(value):
        is_pair = isinstance(value, list) and len(value) == 2
        return is_pair and all(type(each) is int and 0 <= each <= 32768 for each in value)

    async def move(self):
        began = time.monotonic()
        while True:
            await asyncio.sleep(0.04)
            if self.asked and time.monotonic() > began + 9:
                self.writer.close()
            if self.version is None:
                continue
            Steering.turn += 0.02
            half, still = Steering.turn / 2, {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
            self.say("camera_pose", position={"x": 0.0, "y": 0.0, "z": -4.0}, rotation=still)
            place = {
                "position": {"x": math.sin(half), "y": 0.0, "z": 0.5},
                "rotation": {"x": 0.0, "y": math.sin(half), "z": 0.0, "w": math.cos(half)},
            }
            if "objects" in self.granted:
                self.say("object_pose", object="default", **place, scale=1.0)
            else:
                self.say("point_cloud_pose", **place)


async def keep(kind, variable, usual):
    """One channel, for ever."""
    port, failures = int(os.environ.get(variable, usual)), 0
    while True:
        begun, talk = time.monotonic(), None
        try:
            reader, writer = await asyncio.open_connection(HOST, port, limit=1 << 21)
            talk, failures = kind(reader, writer), 0
            await talk.run()
        except (OSError, EOFError, Bad, TimeoutError):
            failures += not talk
        if talk:
            talk.writer.close()
        pause = 1.0 if talk and talk.scolded else min(0.15 * 2**failures, 4.0)
        least = 0.12 if talk and talk.scolded else 0
        await asyncio.sleep(max(begun + pause - time.monotonic(), least))


async def main():
    await asyncio.gather(
        keep(Images, "SPLATBUS_IPC_PORT", 6001), keep(Steering, "SPLATBUS_MSG_PORT", 6000)
    )


asyncio.run(main())
