"""A render engine whose images are the server's: the passes that compositing is made of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from . import compositing, nodes, service, viewing
from .core.passes import bottom_up, fitted, passes
from .core.wanted import scene_unit

_IMAGE_SECONDS = 60.0
"""How long a render waits for the server; it is not Blender's interface that does."""


class UnrenderedError(Exception):
    """There is no image for a render; says why."""


class SplatBusEngine(bpy.types.RenderEngine):  # type: ignore[misc]
    """Renders what the server shows through the camera of the scene that composites it."""

    bl_idname = compositing.ENGINE
    bl_label = "SplatBus"
    bl_use_preview = False

    def update_render_passes(self, scene: Any = None, renderlayer: Any = None) -> None:
        """Say which outputs its node of render layers has; called by Blender."""
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        self.register_pass(scene, renderlayer, "Depth", 1, "Z", "VALUE")

    def render(self, depsgraph: Any) -> None:
        """Fill colour and depth; called by Blender in a thread of its own, or in none."""
        width, height = self.resolution_x, self.resolution_y
        color = np.zeros((height, width, 4), np.float32)
        depth = np.full((height, width), np.inf, np.float32)
        try:
            color, depth = (
                fitted(each, width, height) for each in _image(depsgraph, self.test_break)
            )
        except UnrenderedError as why:
            self.report({"ERROR"}, f"SplatBus: {why}")
            self.error_set(f"SplatBus: {why}")
        result = self.begin_result(0, 0, width, height)
        for each in result.layers[0].passes:
            if each.name in ("Combined", "Depth"):
                nodes.fill(each, bottom_up(color if each.name == "Combined" else depth))
        self.end_result(result)


def _image(depsgraph: Any, cancelled: Callable[[], bool]) -> tuple[Any, Any]:
    """Return the passes of the image that the server has of this frame."""
    splats = depsgraph.scene.original
    scene = compositing.scene_of(splats)
    connection = service.connection
    if scene is None:
        raise UnrenderedError("no scene's compositor shows the splats of this one")
    if connection is None:
        raise UnrenderedError("there is no connection to a server")
    if names := compositing.missing(scene, splats):
        raise UnrenderedError(f"set up the compositor again, for {', '.join(names)}")
    wanted, problems = viewing.through_camera(scene, depsgraph)
    if wanted.camera is None:
        raise UnrenderedError("; ".join(problems))
    try:
        image = connection.image_of(wanted, _IMAGE_SECONDS, cancelled)
    except TimeoutError as why:
        raise UnrenderedError(str(why)) from None
    if image.color is None or image.depth is None:
        raise UnrenderedError("the server's images lack colour or depth")
    if (image.semantics.color_space == "srgb") != splats[compositing.ENCODED]:
        raise UnrenderedError(
            "set up the compositor again: the server's colours are of another space"
        )
    return passes(image, scene_unit(image.semantics.unit_metres))


def register() -> None:
    """Add the engine to Blender's."""
    bpy.utils.register_class(SplatBusEngine)


def unregister() -> None:
    """Take it away again."""
    bpy.utils.unregister_class(SplatBusEngine)
