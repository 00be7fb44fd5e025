"""A renderer for tests: image n has the colour n · 2⁻²⁰ and the depth n, everywhere.

So whatever is torn, mixed of two images or read after it was freed shows in every pixel.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

import numpy as np
import splatbus_server

STEP = 2.0**-20


def painter() -> Callable[[splatbus_server.Bus, splatbus_server.View], None]:
    numbers = count(1)

    def paint(bus: splatbus_server.Bus, view: splatbus_server.View) -> None:
        number = next(numbers)
        color = np.full((view.height, view.width, 4), number * STEP, np.float32)
        depth = np.full((view.height, view.width), number, np.float32)
        color[..., 3] = 1.0
        bus.publish(view, color, depth if view.wants_depth else None, time=float(number))

    return paint


def is_whole(frame: object) -> bool:
    """Whether every pixel of a frame is of the image that its `time` names."""
    number = frame.time  # type: ignore[attr-defined]
    color, depth = frame.color, frame.depth  # type: ignore[attr-defined]
    return bool(
        (color[..., :3] == np.float32(number * STEP)).all()
        and (color[..., 3] == 1.0).all()
        and (depth == np.float32(number)).all()
    )
