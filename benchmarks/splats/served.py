"""The whole path: `splatbus-server scene.ply` and a client, each in a process of its own."""

from __future__ import annotations

import os
import re
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import splatbus_client
from splatbus_client import Session
from splatbus_splats.files import ply
from splatbus_splats.gaussians import COEFFICIENTS
from splatbus_splats.made import garden, poses
from splatbus_viewer.view import orbit

from benchmarks import _shared

SECONDS = 60.0
"""No wait is longer."""
IMAGES, STILL_SECONDS = 200, 20.0
FLOATS = 14 + 3 * COEFFICIENTS[3]
"""Of a Gaussian in a file of degree 3, its normal among them."""


def measure(rounds: int) -> dict[str, Any]:
    """Images a second and latencies of 100,000 Gaussians, the cost of a still scene, memory."""
    del rounds
    with tempfile.TemporaryDirectory() as folder:
        path, large = Path(folder) / "scene.ply", Path(folder) / "large.ply"
        ply.write(path, garden(100_000))
        found: dict[str, Any] = {"gaussians": 100_000, "size": "640x480"}
        with serving(path) as (process, session):
            found["moving"] = followed(session)
            session.next_frame(SECONDS).release()
            time.sleep(1.0)
            found["still_core"] = round(still(process), 5)
        with serving(path, "--skips", "exact") as (_, session):
            found["resting"] = followed(session)
        ply.write(large, garden(1_000_000))
        with serving(large) as (process, session):
            followed(session, 10)
            found["memory"] = {
                "gaussians": 1_000_000,
                "peak_bytes": peak(process),
                "times_the_floats": round(peak(process) / (4 * FLOATS * 1_000_000), 2),
            }
    return _shared.told(found)


@contextmanager
def serving(path: Path, *options: str) -> Iterator[tuple[_shared.Child, Session]]:
    """A server of a file, and a client that has its first image."""
    ports = ("--ipc-port", 0, "--msg-port", 0)
    with (
        _shared.python("-m", "splatbus_splats", path, "--quiet", *options, *ports) as process,
        splatbus_client.connect("127.0.0.1", *_shared.ports(process)) as session,
    ):
        session.next_frame(SECONDS).release()
        yield process, session


def followed(session: Session, images: int = IMAGES) -> dict[str, float]:
    """A camera that goes on as soon as its image has come: images a second, latencies, ms."""
    waits, began = [], time.monotonic()
    for i in range(1, images + 1):
        pose = orbit(poses()[0], i / 60.0)
        sent = time.monotonic()
        session.send_camera(pose)
        while True:
            with session.next_frame(SECONDS) as image:
                if image.camera.pose == pose:
                    break
        waits.append(1e3 * (time.monotonic() - sent))
    found = _shared.percentiles(waits)
    return found | {"images_per_second": round(images / (time.monotonic() - began), 1)}


def still(process: _shared.Child) -> float:
    """Of one core, what a server takes while nothing changes."""
    before = processor_seconds(process.pid)
    time.sleep(STILL_SECONDS)
    return (processor_seconds(process.pid) - before) / STILL_SECONDS


def processor_seconds(pid: int) -> float:
    """That a process has taken, of user and system."""
    fields = Path(f"/proc/{pid}/stat").read_text("utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def peak(process: _shared.Child) -> int:
    """The most memory that a process has had, bytes."""
    status = Path(f"/proc/{process.pid}/status").read_text("utf-8")
    match = re.search(r"VmHWM:\s+(\d+) kB", status)
    assert match
    return 1024 * int(match[1])
