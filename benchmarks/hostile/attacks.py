"""What three clients at once do to a server, each in a process of its own, as fast as they can."""

from __future__ import annotations

import contextlib
import os
import random
import socket
import struct
import time
from collections.abc import Callable, Iterator

from benchmarks._shared import hello, packet

LONGEST = 1 << 20
VALUES = 4096
RESET = struct.pack("ii", 1, 0)
Attack = Callable[["Target"], None]


class Target:
    """A server, and what an attacker knows of it.

    Attributes:
        ports: of the IPC and of the message channel.
        token: empty for none.
        until: seconds of the monotonic clock.
    """

    def __init__(self, ipc: int, message: int, token: str, seconds: float) -> None:
        self.ports = {"ipc": ipc, "msg": message}
        self.token = token
        self.until = time.monotonic() + seconds

    def goes_on(self) -> bool:
        """Whether there is time left; waits a moment, for nobody can attack faster than it runs."""
        return time.monotonic() < self.until

    @contextlib.contextmanager
    def connected(self, channel: str = "msg") -> Iterator[socket.socket]:
        """A connection. Raises OSError, when the server has ended it above all."""
        with socket.socket() as connection:
            connection.settimeout(5.0)
            connection.connect(("127.0.0.1", self.ports[channel]))
            yield connection

    def hello(self, *capabilities: str) -> bytes:
        """As a client of 1.1 says it."""
        return hello(*capabilities, token=self.token)


def filled(unit: bytes, begin: bytes = b'{"u":[', end: bytes = b"0]}") -> bytes:
    """The longest packet that is made of this."""
    count = (LONGEST - len(begin) - len(end)) // len(unit)
    return packet(begin + unit * count + end)


def pose(x: float) -> bytes:
    turned = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    return packet(
        {"type": "camera_pose", "position": {"x": x, "y": 0.0, "z": -2.0}, "rotation": turned}
    )


def sends_again_and_again(data: bytes, channel: str = "msg", *, greets: bool = True) -> Attack:
    """Says hello, and then this, until it is closed."""

    def attack(target: Target) -> None:
        with target.connected(channel) as connection:
            if greets:
                connection.sendall(target.hello("viewport", "telemetry", "ping"))
            while target.goes_on():
                connection.sendall(data)

    return attack


def knocks(target: Target) -> None:
    with target.connected("msg"), target.connected("ipc"):
        pass


def takes_places(target: Target) -> None:
    with contextlib.ExitStack() as stack:
        for _ in range(20):
            for channel in target.ports:
                stack.enter_context(target.connected(channel))
        time.sleep(0.05)


def leaves_replies_unread(target: Target) -> None:
    with target.connected() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.sendall(target.hello())
        request = packet({"type": "get_camera_pose", "cam_idx": 0, "id": 1})
        while target.goes_on():
            connection.sendall(request * 100)


def resets(target: Target) -> None:
    with target.connected() as connection:
        connection.sendall(target.hello() + packet({"type": "get_scene", "id": 1}) * 50)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)


def dribbles(target: Target) -> None:
    with target.connected() as connection:
        connection.sendall(target.hello() + (LONGEST).to_bytes(4, "little"))
        while target.goes_on():
            connection.sendall(b" ")


def says_anything(target: Target) -> None:
    with target.connected(random.choice(("ipc", "msg"))) as connection:
        connection.sendall(random.randbytes(random.randrange(1, 200)))
        connection.sendall(random.randbytes(2000))
        connection.recv(100)


def guesses(target: Target) -> None:
    with target.connected() as connection:
        connection.sendall(hello(token="guessed"))
        connection.recv(4096)


def drags_a_corner(target: Target) -> None:
    with target.connected() as connection:
        connection.sendall(target.hello("viewport"))
        for size in range(1, 100_000):
            wish = {"type": "set_viewport", "width": 64 + size % 4000, "height": 4000, "id": size}
            connection.sendall(packet(wish))
            connection.recv(65536)
            if not target.goes_on():
                break


def reads_and_keeps(target: Target) -> None:
    """Opens the memory, has an image lent, and goes."""
    with target.connected("ipc") as connection:
        connection.sendall(target.hello("host_shm", "frames", "reinit"))
        connection.sendall(packet({"type": "opened", "generation": 1}))
        connection.recv(65536)
        time.sleep(0.005)


ATTACKS: dict[str, tuple[str, Attack]] = {
    "values": ("mebibytes of small values", sends_again_and_again(filled(b"{},"))),
    "strings": (
        "mebibytes of escapes",
        sends_again_and_again(filled(rb"\\[", b'{"u":"', b'"}')),
    ),
    "strings on IPC": (
        "the same on the IPC channel, before hello",
        sends_again_and_again(filled(rb"\u0041", b'{"u":"', b'"}'), "ipc", greets=False),
    ),
    "as many values as may be": (
        "packets of 4,000 numbers",
        sends_again_and_again(packet({"u": [0.1] * (VALUES - 2)})),
    ),
    "poses": ("poses without a pause", sends_again_and_again(pose(0.5) * 100)),
    "unknown": (
        "errors without a pause",
        sends_again_and_again(packet({"type": "nothing"}) * 100),
    ),
    "unread": ("requests whose replies are never read", leaves_replies_unread),
    "telemetry": (
        "subscriptions without a pause",
        sends_again_and_again(packet({"type": "subscribe_telemetry", "names": None}) * 100),
    ),
    "knocks": ("connections that end at once", knocks),
    "places": ("twenty silent connections on each channel", takes_places),
    "resets": ("connections that are reset with replies unread", resets),
    "dribbles": ("a packet that comes byte by byte", dribbles),
    "anything": ("random bytes", says_anything),
    "guesses": ("wrong tokens", guesses),
    "sizes": ("another size of the images, again and again", drags_a_corner),
    "readers": ("readers that come and go with an image", reads_and_keeps),
}


def main(name: str, ipc: int, message: int, token: str, seconds: float) -> None:
    os.nice(10)  # what is measured is the server, not who of all processes gets a core
    target = Target(ipc, message, token, seconds)
    while target.goes_on():
        with contextlib.suppress(OSError):
            ATTACKS[name][1](target)
