"""The command in a process of its own, and the pictures that it has to serve."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import splatbus_client
from splatbus_client import FrameLease, Session
from splatbus_server.view import View
from splatbus_splats.drawing.definition import Image, placed
from splatbus_splats.drawing.renderer import rendered
from splatbus_splats.files import ply
from splatbus_splats.files.read import read
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import made
from splatbus_splats.made import main as make
from splatbus_splats.scene import Frames, Scene

SECONDS = 60
COMMAND = [sys.executable, "-m", "splatbus_splats"]
ENVIRONMENT = {name: value for name, value in os.environ.items() if "SPLATBUS" not in name}
FREE = ("--ipc-port", "0", "--msg-port", "0")
SIZE = (64, 48)
READY = re.compile(
    r"splatbus-server ready on \S+: IPC port (\d+), message port (\d+), (\d+)x(\d+)\n"
)


class Server(NamedTuple):
    process: subprocess.Popen[str]
    ports: tuple[int, int]
    size: tuple[int, int]


@contextmanager
def serving(*arguments: str | Path, command: list[str] = COMMAND) -> Iterator[Server]:
    with subprocess.Popen(
        [*command, *map(str, arguments), *FREE],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        match = READY.fullmatch(line)
        try:
            assert match, (line, process.stderr and process.stderr.read())
            ports, size = (int(match[1]), int(match[2])), (int(match[3]), int(match[4]))
            yield Server(process, ports, size)
        finally:
            process.kill()
            process.communicate()


@contextmanager
def serving_garden(count: int) -> Iterator[Server]:
    """The made garden, of so many Gaussians, as people see it who follow README."""
    with tempfile.TemporaryDirectory() as place:
        file, cameras = Path(place, "garden.ply"), Path(place, "cameras.json")
        words = [f"{count}", f"{file}", "--scene", "garden", "--cameras", f"{cameras}"]
        assert make(words) == 0
        with serving(file) as server:
            yield server


def connected(server: Server) -> Session:
    return splatbus_client.connect("127.0.0.1", *server.ports)


def still(*files: Path) -> Scene:
    names = ("default", "statue")
    return Scene({name: Frames((read(each).gaussians,)) for name, each in zip(names, files)})  # noqa: B905


def drawn_of(view: View, objects: Mapping[str, Gaussians]) -> Image:
    return rendered(placed(view, objects), view.intrinsics, view.width, view.height)


def compare(frame: FrameLease, image: Image, least: float = 0.2) -> None:
    np.testing.assert_array_equal(frame.color, np.clip(image.color, 0, 1))
    alpha = image.color[..., 3]
    covered = (alpha >= np.float32(1 / 255)) & (image.inverse > 0)
    assert covered.mean() > least
    right = np.full_like(alpha, np.inf)
    right[covered] = alpha[covered] / image.inverse[covered]
    np.testing.assert_array_equal(frame.depth, right)


@contextmanager
def frame_that(session: Session, fits: Callable[[FrameLease], bool]) -> Iterator[FrameLease]:
    while True:
        with session.next_frame(SECONDS) as frame:
            if fits(frame):
                yield frame
                return


def two_files(folder: Path) -> list[Path]:
    """A room, with a quaternion that is none, and a statue."""
    scene = made(1501, 2)
    scene.rotations[77] = 0
    ply.write(folder / "room.ply", scene)
    ply.write(folder / "statue.ply", made(700, 0, seed=2))
    return [folder / "room.ply", folder / "statue.ply"]
