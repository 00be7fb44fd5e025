"""What clients for engines are tried beside: a server of images that tell one pose from another."""

import json
import os
import struct
import subprocess
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import splatbus_server
from splatbus_server import View
from splatbus_wire.poses import Pose

WIDTH, HEIGHT = 64, 48
Answer = dict[str, Any]


@contextmanager
def serving(
    render: Callable[[View], Any], *, on_and_on: bool = False, **settings: Any
) -> Iterator[dict[str, str]]:
    """A server whose images these are; where its clients are to connect."""
    with splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=0, **settings) as bus:
        done = threading.Event()

        def publish() -> None:
            while not done.is_set():
                if view := bus.next_view(0.1, contents_changed=on_and_on):
                    bus.publish(view, *render(view))

        thread = threading.Thread(target=publish)
        thread.start()
        ports = {"IPC": bus.address.ipc_port, "MSG": bus.address.message_port}
        try:
            yield os.environ | {f"SPLATBUS_{name}_PORT": str(port) for name, port in ports.items()}
        finally:
            done.set()
            thread.join()


def planes(pose: Pose, width: int = WIDTH, height: int = HEIGHT) -> tuple[Any, Any]:
    """Colour and depth that are others wherever a bit of the pose is."""
    noise = np.random.default_rng(list(struct.pack("<7d", *pose.position, *pose.rotation)))
    color = 0.5 + noise.random((height, width, 4), np.float32) / 2  # covered: no depth is left out
    return color, 1 + noise.random((height, width), np.float32)


@contextmanager
def asked(line: Sequence[str], where: dict[str, str]) -> Iterator[Callable[[str], Answer]]:
    """A program that answers each line with one of JSON."""
    pipe = subprocess.PIPE
    with subprocess.Popen(line, env=where, stdin=pipe, stdout=pipe, text=True) as process:
        told, heard = process.stdin, process.stdout
        assert told
        assert heard

        def ask(text: str) -> Answer:
            told.write(text + "\n")
            told.flush()
            answer: Answer = json.loads(heard.readline())
            return answer

        yield ask
        told.close()
    assert process.returncode == 0
