"""The command in a process of its own."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from splatbus_splats.made.__main__ import main as make

SECONDS = 60
COMMAND = (sys.executable, "-m", "splatbus_splats")
ENVIRONMENT = {name: value for name, value in os.environ.items() if "SPLATBUS" not in name}
FREE = ("--ipc-port", "0", "--msg-port", "0")
READY = re.compile(
    r"splatbus-server ready on \S+: IPC port (\d+), message port (\d+), (\d+)x(\d+)\n"
)


class Server(NamedTuple):
    process: subprocess.Popen[str]
    ports: tuple[int, int]
    size: tuple[int, int]


@contextmanager
def serving(*arguments: str | Path, command: tuple[str, ...] = COMMAND) -> Iterator[Server]:
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
            process.terminate()  # which has it remove its memory
            process.communicate(timeout=SECONDS)


@contextmanager
def serving_garden(count: int) -> Iterator[Server]:
    """The made garden, of so many Gaussians, as people see it who follow README."""
    with tempfile.TemporaryDirectory() as place:
        file, cameras = Path(place, "garden.ply"), Path(place, "cameras.json")
        assert make([f"{count}", f"{file}", "--cameras", f"{cameras}"]) == 0
        with serving(file) as server:
            yield server
