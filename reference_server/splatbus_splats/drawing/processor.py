"""Publishes what is drawn on the processor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from time import monotonic

import numpy as np
from splatbus_server.api import Bus
from splatbus_server.view import Intrinsics, View

from splatbus_splats.drawing.definition import Placed, placed
from splatbus_splats.drawing.renderer import Renderer
from splatbus_splats.drawing.skips import USUAL, Skip
from splatbus_splats.gaussians import Gaussians

ONE_PIXEL = Intrinsics(1.0, 1.0, 0.5, 0.5, 0.1, 10.0)


class Processor(Renderer):
    """See `Renderer`, and `serving.Drawing`."""

    def __init__(self, threads: int = 1, skips: Skip = USUAL) -> None:
        super().__init__(threads, skips)
        self.milliseconds = 0.0
        self._may_be_rough = Skip.MOVING in skips

    def prepare(self, objects: Iterable[Gaussians]) -> None:
        """Loads or compiles the loops for such objects, so that nobody waits for that later."""
        for each in objects:
            before = Placed(each[:1], np.eye(3), np.array((0.0, 0.0, -1.0)))
            for is_moving in (True, False):
                self.draw([before], ONE_PIXEL, 1, 1, is_moving=is_moving)

    def show(
        self,
        bus: Bus,
        view: View,
        objects: Mapping[str, Gaussians],
        time: float | None,
        *,
        is_moving: bool,
    ) -> bool:
        """Draws and publishes a view; whether it had fewer pixels."""
        began = monotonic()
        lens = (view.intrinsics, view.width, view.height)
        image = self.draw(placed(view, objects), *lens, view.wants, is_moving=is_moving)
        depth = image.inverse if view.wants_depth else None
        bus.publish(view, image.color, depth, depth_kind="inverse", time=time)
        self.milliseconds = (monotonic() - began) * 1e3
        return is_moving and self._may_be_rough
