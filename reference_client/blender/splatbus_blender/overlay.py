"""Has the viewport that steers the server show its images."""

from __future__ import annotations

from typing import Any

import bpy

from . import service
from .core.wanted import scene_unit
from .drawing import Canvas

_canvas: Canvas | None = None
_handle: Any = None


def register() -> None:
    """Have Blender call for each drawing of a viewport."""
    global _handle
    _handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def unregister() -> None:
    """Have it call no more, and free what is on the GPU."""
    global _handle, _canvas
    bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
    _handle = _canvas = None


def _draw() -> None:
    context = bpy.context
    found = service.viewport()
    if found is None or context.region != found[0] or not context.region_data.is_perspective:
        return
    paint(context.region_data.window_matrix, context.scene.splatbus.show)


def paint(window: Any, look: str) -> None:
    """Draw the newest image, of a server that is there, over the framebuffer that is bound.

    Args:
        window: the projection of the view, a perspective one.
        look: one of those of `drawing`.
    """
    global _canvas
    image = None if service.connection is None else service.connection.image
    if image is None or image.color is None or (image.depth is None and look != "COLOR"):
        return
    if _canvas is None:
        _canvas = Canvas()  # not before there is a GPU
    _canvas.take(image)
    rows = [tuple(row) for row in window]
    _canvas.draw(rows, look, scene_unit(image.semantics.unit_metres), overlaid=True)
