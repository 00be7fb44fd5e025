"""Publishes what is drawn on the processor."""

from __future__ import annotations

from collections.abc import Mapping
from time import monotonic

from splatbus_server.api import Bus
from splatbus_server.view import View

from splatbus_splats.drawing.definition import placed
from splatbus_splats.drawing.renderer import Renderer
from splatbus_splats.drawing.skips import USUAL, Skip
from splatbus_splats.gaussians import Gaussians


class Processor(Renderer):
    """See `Renderer`, and `serving.Drawing`."""

    def __init__(self, threads: int = 1, skips: Skip = USUAL) -> None:
        super().__init__(threads, skips)
        self.milliseconds = 0.0
        self._may_be_rough = Skip.MOVING in skips

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
