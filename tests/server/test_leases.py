"""Many leased reads against a server that publishes as fast as it can: none torn, none mixed."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import splatbus_server

from tests.server.leased_reader import COLOR_STEP

ROOT = Path(__file__).parents[2]
WIDTH, HEIGHT = 32, 8
READS = 20_000
FAST_READERS = 4


@contextmanager
def publishing() -> Iterator[splatbus_server.Bus]:
    """A server whose every image differs from the one before, published without a pause."""
    stop = threading.Event()
    color = np.empty((HEIGHT, WIDTH, 4), np.float32)
    depth = np.empty((HEIGHT, WIDTH), np.float32)
    ones = np.ones_like(depth)

    def publish_on(bus: splatbus_server.Bus) -> None:
        number = 0
        while not stop.is_set():
            view = bus.next_view(0.1, contents_changed=True)
            if view is not None:
                number += 1
                color.fill(number * COLOR_STEP)
                depth.fill(number)
                bus.publish(view, color, depth, alpha=ones, time=float(number))
                time.sleep(0)  # as renderers do, it lets go of the interpreter

    switch_interval = sys.getswitchinterval()
    sys.setswitchinterval(0.00005)
    try:
        with splatbus_server.serve(
            WIDTH, HEIGHT, readers=FAST_READERS + 2, ipc_port=0, message_port=0
        ) as bus:
            renderer = threading.Thread(target=publish_on, args=(bus,))
            renderer.start()
            try:
                yield bus
            finally:
                stop.set()
                renderer.join(10)
    finally:
        sys.setswitchinterval(switch_interval)


def reader_process(port: int, reads: int, hold_seconds: float) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "tests.server.leased_reader"]
    return subprocess.Popen(
        [*command, str(port), str(reads), str(hold_seconds)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )


def test_no_leased_read_is_torn() -> None:
    """[IMG-4, IMG-5, IMG-6]: by readers that are fast, slow, and stalled in the middle of one."""
    with publishing() as bus:
        port = bus.address.ipc_port
        fast = [reader_process(port, READS // FAST_READERS, 0.0) for _ in range(FAST_READERS)]
        slow = reader_process(port, 200, 0.002)
        stalled = reader_process(port, 1, 2.0)
        found = [json.loads(p.communicate(timeout=250)[0]) for p in (*fast, slow, stalled)]
    assert sum(result["reads"] for result in found) == READS + 201
    assert sum(result["torn"] for result in found) == 0
    assert sum(result["mixed"] for result in found) == 0
    assert all(result["last"] - result["first"] >= result["reads"] - 1 for result in found)
