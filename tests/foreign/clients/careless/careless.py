"""A prototype of a viewer, in an evening: asyncio, and whatever is at hand as JSON."""

import asyncio
import json
import math
import os
import time

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
NOWHERE = {"x": math.nan, "y": math.nan, "z": math.nan}


def packet(text, mark=b""):
    payload = mark + text.encode()
    return len(payload).to_bytes(4, "little") + payload


async def receive(reader):
    async with asyncio.timeout(None):
        header = await reader.readexactly(1)
    async with asyncio.timeout(10):
        header += await reader.readexactly(3)
        length = int.from_bytes(header, "little")
        if not 1 <= length <= 1 << 20:
            raise EOFError("no packet")
        return await reader.readexactly(length)


def halfway(a, b, share):
    """Between two rotations: linear, which is short of 1 in the middle."""
    return {name: (1 - share) * a[name] + share * b[name] for name in a}


class Viewer:
    def __init__(self):
        self.centre = None

    async def steer(self, reader, writer):
        listening = asyncio.create_task(self.listen(reader, writer))
        ahead = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
        aside = {"x": 0.0, "y": math.sin(0.4), "z": 0.0, "w": math.cos(0.4)}
        try:
            for count in range(1 << 60):
                if listening.done():
                    break
                pose = {
                    "type": "camera_pose",
                    "timestamp": time.time() % 1 if self.centre else math.nan,
                    "position": self.centre or NOWHERE,
                    "rotation": halfway(ahead, aside, count % 50 / 50),
                }
                writer.write(packet(json.dumps(pose)))
                if count % 20 == 7:
                    scene = json.dumps(ahead)
                    place = '"position": {"x": 0.0, "y": 0.0, "z": 1.0}'
                    writer.write(
                        packet(
                            f'{{"type": "point_cloud_pose", {place}, "rotation": {scene}, {place}}}'
                        )
                    )
                if count % 20 == 13:
                    log = {"type": "log", "text": f"frame {count}"}
                    writer.write(packet(json.dumps(log), b"\xef\xbb\xbf"))
                if count % 20 == 17:
                    writer.write(packet(json.dumps({"type": "log", "text": "no mark"})))
                await writer.drain()
                await asyncio.sleep(0.03)
        finally:
            listening.cancel()

    async def listen(self, reader, writer):
        """Asks once, of the first camera and of that of the slider, until there is one."""
        for index in (0, 1.5):
            writer.write(packet(json.dumps({"type": "get_camera_pose", "cam_idx": index})))
            if index == 0:
                position = self.understood(await receive(reader))
                self.centre = dict(zip("xyz", position, strict=True))
        while True:
            await receive(reader)

    @staticmethod
    def understood(payload):
        reply = json.loads(payload.decode())
        position = reply["position"]
        if len(reply["rotation"]) != 4 or not all(math.isfinite(each) for each in position):
            raise ValueError(reply)
        return [float(each) for each in position]


async def watch(reader, writer):
    """Images are for another evening."""
    while True:
        await receive(reader)


async def keep(port, talk):
    pause = 0.2
    while True:
        begun = time.monotonic()
        writer = None
        try:
            reader, writer = await asyncio.open_connection(HOST, port)
            pause = 0.2
            await talk(reader, writer)
        except (OSError, EOFError, TimeoutError, ValueError, KeyError, TypeError, RecursionError):
            pause = min(2 * pause, 3.0) if writer is None else pause
        if writer:
            writer.close()
        await asyncio.sleep(max(0, begun + pause - time.monotonic()))


async def main():
    viewer = Viewer()
    ports = [int(os.environ[f"SPLATBUS_{name}_PORT"]) for name in ("IPC", "MSG")]
    await asyncio.gather(keep(ports[0], watch), keep(ports[1], viewer.steer))


asyncio.run(main())
