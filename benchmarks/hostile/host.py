"""The server under attack, and a render loop in its process; told by lines, tells by lines.

Prints its ports; then, for each line that comes, what it has of memory, and how far the loop is, as
JSON.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # its threads wait by turning, which others would slow

import numpy as np
import splatbus_server

SIZE = (320, 240)
WORK = 160
"""Rows of the square matrices that a turn multiplies: some tenths of a millisecond."""


def resident() -> int:
    """Bytes of memory that are not shared with files or other processes' images."""
    _, pages, shared, *_ = map(int, Path("/proc/self/statm").read_text().split())
    return (pages - shared) * os.sysconf("SC_PAGESIZE")


def main(kind: str, token: str) -> None:
    """Until it is told to end."""
    bus = splatbus_server.serve(*SIZE, ipc_port=0, message_port=0, token=token or None)
    print(json.dumps(bus.address[1:]), flush=True)
    turns = 0

    def tell() -> None:
        for _ in sys.stdin:
            state = {"turns": turns, "bytes": resident(), "seconds": time.monotonic()}
            print(json.dumps(state), flush=True)

    threading.Thread(target=tell, daemon=True).start()
    matrix = np.random.default_rng(1).standard_normal((WORK, WORK)).astype(np.float32) / WORK
    color = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    depth = np.ones((SIZE[1], SIZE[0]), np.float32)
    while True:
        if kind == "numpy":
            for _ in range(8):
                matrix @ matrix
        else:
            sum(range(20_000))
        turns += 1
        view = bus.next_view(0.0)
        if view is not None:
            bus.publish(view, color, depth if view.wants_depth else None)
