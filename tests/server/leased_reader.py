"""A process that reads leased images and checks every pixel; prints what it found as JSON.

The server writes image n with the colour n / 2²⁴ and the depth n everywhere, and says n as the
time of the frame: whatever is torn, mixed or stale shows.

    python -m tests.server.leased_reader PORT READS HOLD_SECONDS
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np

from tests.peers.raw_client import Reader

COLOR_STEP = 2.0**-24


def read(port: int, reads: int, hold_seconds: float) -> dict[str, int]:
    """Counts images that were not whole, and those whose colour and depth were of two images."""
    found = {"reads": 0, "torn": 0, "mixed": 0, "first": 0, "last": 0}
    with Reader(port) as reader:
        reader.open()
        while found["reads"] < reads:
            frame = reader.frame()
            number = int(frame["time"])
            for _ in range(2 if hold_seconds else 1):
                color, depth = reader.color(frame), reader.depth(frame)
                whole = (color == color[0, 0, 0]).all() and (depth == depth[0, 0]).all()
                same = color[0, 0, 0] == np.float32(number * COLOR_STEP) and depth[0, 0] == number
                found["torn"] += not whole
                found["mixed"] += not same
                time.sleep(hold_seconds)
            reader.release(frame)
            found["reads"] += 1
            found["first"] = found["first"] or number
            found["last"] = number
    return found


if __name__ == "__main__":
    print(json.dumps(read(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))))
