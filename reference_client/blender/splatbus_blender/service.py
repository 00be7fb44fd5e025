"""The one connection of this Blender, asked from a timer of Blender's.

The timer finds scene and viewports anew each time, and keeps none: a file that is opened, an undo
or a window that is closed leaves nothing behind that points to what is gone.
"""

from __future__ import annotations

from typing import Any

import bpy
from splatbus_client.reading import ImagesOpen

from . import compositing, viewing
from .core.connection import Connection
from .core.wanted import Wanted
from .properties import where

_TURN_SECONDS = 1 / 60
_SEARCH_TURNS = 30
"""How often all objects are looked at for empties that move some: of 10,000 it takes 2 ms."""

connection: Connection | None = None
"""That of this Blender, while there is one."""
problems: tuple[str, ...] = ()
"""What is wrong with what Blender shows, in words."""
_drawn: tuple[Any, ...] = ()
"""What viewport and panel showed when they were drawn last."""
_movers: list[str] = []
_turns = 0


def connect(scene: Any) -> None:
    """Begin a session with the server of the scene's settings, in the place of any other."""
    global connection
    disconnect()
    connection = Connection(*where(scene.splatbus))
    if not bpy.app.timers.is_registered(_turn):
        bpy.app.timers.register(_turn, persistent=True)  # also when another file is opened


def disconnect() -> None:
    """End the session, if there is one."""
    global connection
    if connection is not None:
        connection.close()
    connection = None
    _redraw()


def tell(*, search: bool = True) -> None:
    """Say what the largest viewport shows, or where there is none, the scene's camera.

    Args:
        search: whether to look which empties move objects; else those that did.
    """
    global problems, _movers
    if connection is None:
        return
    if search:
        _movers = [each.name for each in viewing.movers_of(bpy.context.scene)]
    wanted, wrong = _wanted()
    problems = tuple(wrong)
    connection.tell(wanted)


def images() -> ImagesOpen | None:
    """Return what the server has said of its images; None while there are none."""
    session = None if connection is None else connection.session
    return None if session is None else session.images


def told() -> list[str]:
    """Return in words how the connection fares."""
    status = None if connection is None else connection.status
    if connection is None or status is None:
        return []
    lines = [
        f"{name}: {' '.join(each.server or ('a server',))}, {each.version or 'connecting'}"
        for name, each in (("Images", status.ipc), ("Messages", status.message))
        if each.connected
    ]
    if (now := images()) is not None:
        lines.append(f"{now.width} × {now.height} pixels")
    return lines


def complaints() -> tuple[str, ...]:
    """Return in words what is wrong."""
    return () if connection is None else connection.problems + problems


def unregister() -> None:
    """End everything that would go on by itself."""
    if bpy.app.timers.is_registered(_turn):
        bpy.app.timers.unregister(_turn)
    disconnect()


def viewport() -> tuple[Any, Any] | None:
    """Return region and space of the largest 3D viewport of all windows."""
    found = [
        (region, area.spaces.active)
        for window in bpy.context.window_manager.windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
        for region in area.regions
        if region.type == "WINDOW" and region.width > 1 and region.height > 1
    ]
    return max(found, key=lambda each: each[0].width * each[0].height, default=None)


def looks_at_depth(scene: Any) -> bool:
    """Whether a scene shows where splats are among its meshes, or its renders do."""
    return scene.splatbus.show != "COLOR" or compositing.splats_of(scene) is not None


def _wanted() -> tuple[Wanted, list[str]]:
    scene = bpy.context.scene
    found = None if bpy.app.background else viewport()
    if found is None:
        return viewing.through_camera(scene, movers=_movers)
    wanted, wrong = viewing.through_region(scene, *found, _movers)
    return wanted._replace(depth=looks_at_depth(scene)), wrong


def _turn() -> float | None:
    global _drawn, _turns, problems
    if connection is None:
        return None  # no further turn
    try:
        tell(search=_turns % _SEARCH_TURNS == 0)
        _turns += 1
    except Exception as wrong:  # a timer that raises is never called again
        problems = (f"{type(wrong).__name__}: {wrong}",)
    image = connection.image
    shown = None if image is None else image.seq, told(), complaints()
    if shown != _drawn:
        _drawn = shown
        _redraw()
    return _TURN_SECONDS


def _redraw() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
