"""The whole clients: judged at L1 and L2, without garbage, seeing what the Python one sees."""

import json
import os
import re
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import splatbus_server
from splatbus_server import Bus, View
from splatbus_wire.poses import Pose

from tests.conformance.harness import run
from tests.engines.built import Command, built

WIDTH, HEIGHT = 64, 48
FRAMES = 10_000
SMALL_NURSERY = {"MONO_GC_PARAMS": "nursery-size=64k"}
"""Bytes of garbage after which the collector runs: one object of 24 a frame makes 3 runs."""
PYTHON = [sys.executable, "-m", "splatbus_viewer.adapter", "--axes"]
AXES = {"csharp": ("unity",), "cpp": ("unreal", "opengl")}
W = 0.9273618495495703
ON_THE_WIRE = Pose((0.5, -1.25, -4.0), (-0.1, 0.2, -0.3, W))
IN_ENGINES = {
    "unity": {"position": [0.5, 1.25, -4.0], "rotation": [0.1, 0.2, 0.3, W]},
    "unreal": {"position": [-400.0, 50.0, 125.0], "rotation": [0.3, 0.1, 0.2, W]},
    "opengl": {"position": [0.5, 1.25, 4.0], "rotation": [-0.1, -0.2, 0.3, W]},
}
LIMIT_SECONDS = 60


@pytest.mark.parametrize(
    ("how", "name", "level"), [("--launch", "Viewer", "L1"), ("--adapter", "Adapter", "L2")]
)
def test_it_conforms(language: str, how: str, name: str, level: str, folder: Path) -> None:
    command = [*built(language, name, folder), *(AXES[language][:1] if name == "Adapter" else ())]
    status, told = run("client", how, " ".join(command), "--shrink", "0")
    assert status == 0, told
    assert f"\nconforming at {level}: " in told


@contextmanager
def serving(render: Callable[[View], Any], *, on_and_on: bool) -> Iterator[dict[str, str]]:
    """A server whose images these are; where its clients are to connect."""
    with splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=0) as bus:
        done = threading.Event()
        thread = threading.Thread(target=publish, args=(bus, render, on_and_on, done))
        thread.start()
        ports = {"IPC": bus.address.ipc_port, "MSG": bus.address.message_port}
        try:
            yield os.environ | {f"SPLATBUS_{name}_PORT": str(port) for name, port in ports.items()}
        finally:
            done.set()
            thread.join()


def publish(
    bus: Bus, render: Callable[[View], Any], on_and_on: bool, done: threading.Event
) -> None:
    while not done.is_set():
        if view := bus.next_view(0.1, contents_changed=on_and_on):
            bus.publish(view, *render(view))


def planes(pose: Pose) -> tuple[Any, Any]:
    """Colour and depth that are others wherever a bit of the pose is."""
    noise = np.random.default_rng(list(struct.pack("<7d", *pose.position, *pose.rotation)))
    color = 0.5 + noise.random((HEIGHT, WIDTH, 4), np.float32) / 2  # covered: no depth is left out
    return color, noise.random((HEIGHT, WIDTH), np.float32)


def test_the_frame_loop_leaves_no_garbage(program: Command) -> None:
    """In neither thread, with a pose for each image."""
    color, depth = np.full((HEIGHT, WIDTH, 4), 0.5), np.full((HEIGHT, WIDTH), 2.0)
    with serving(lambda _: (color, depth), on_and_on=True) as where:
        line = [*program, "--frames", str(FRAMES)]
        done = subprocess.run(
            line, capture_output=True, text=True, timeout=240, env=where | SMALL_NURSERY
        )
    found = re.match(r"(\d+) frames, (\d+) (?:collections|allocations), ", done.stdout)
    assert found, done.stdout + done.stderr
    assert (int(found[1]), int(found[2])) == (FRAMES, 0)


@contextmanager
def adapter(line: list[str], where: dict[str, str]) -> Iterator[Callable[..., dict[str, Any]]]:
    """Ask a client's adapter one command after the other."""
    pipe = subprocess.PIPE
    with subprocess.Popen(line, env=where, stdin=pipe, stdout=pipe, text=True) as process:
        to, back = process.stdin, process.stdout
        assert to
        assert back

        def ask(command: str, **members: Any) -> dict[str, Any]:
            to.write(json.dumps({"id": 1, "command": command, **members}) + "\n")
            to.flush()
            answer: dict[str, Any] = json.loads(back.readline())
            assert "error" not in answer, answer
            return answer

        json.loads(back.readline())  # the greeting
        ask("start")
        yield ask
        ask("stop")


@pytest.mark.parametrize("last", [0, -1])
def test_it_sees_what_the_python_client_sees_to_the_bit(
    language: str, last: int, folder: Path
) -> None:
    """Each sends one pose in an engine's axes, to a server whose image hangs on every bit of it."""
    axes = AXES[language][last]
    pose = IN_ENGINES[axes]
    expected = [sha256(plane.tobytes()).hexdigest() for plane in planes(ON_THE_WIRE)]
    for line in ([*PYTHON, axes], [*built(language, "Adapter", folder), axes]):
        drawn = serving(lambda view: planes(view.poses.camera), on_and_on=False)
        with drawn as where, adapter(line, where) as ask:
            ask("send_camera", **pose)
            until = time.monotonic() + LIMIT_SECONDS
            shown = None
            while shown != expected and time.monotonic() < until:
                image = ask("digest")
                shown = [image.get("color"), image.get("depth")]
        assert shown == expected, line
