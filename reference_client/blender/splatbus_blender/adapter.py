"""An adapter for the harness (conformance/ADAPTER.md): cameras and empties of Blender steer.

Nothing of the extension needs it. `main` answers in a Blender without a window, where no timer
runs: what the extension does by a timer is done here after each command. What Blender has no part
in is the Python client's adapter.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray
from splatbus_client.session import Session
from splatbus_viewer import adapter
from splatbus_viewer.mirror import Copied

from . import compositing, nodes, registration, service, viewing
from .core.wanted import scene_unit

Json = dict[str, Any]
Numbers = list[float]


class Adapter(adapter.Adapter):
    """One method for each command: members in, members of the answer out."""

    # ruff: noqa: D102

    def __init__(self) -> None:
        super().__init__("blender")
        self._composited: Composited | None = None

    @property
    def _session(self) -> Session:  # type: ignore[override]
        return service.connection.session  # type: ignore[union-attr,return-value]

    @property
    def _mirror(self) -> Any:  # type: ignore[override]
        return service.connection

    def start(self) -> Json:
        bpy.context.scene.camera = None
        service.connect(bpy.context.scene)
        return {}

    def stop(self) -> Json:
        service.unregister()
        return {}

    def send_camera(self, position: Numbers, rotation: Numbers) -> Json:
        scene = bpy.context.scene
        if scene.camera is None:
            scene.camera = _new("eye", bpy.data.cameras.new("eye"))
        _put(scene.camera, position, rotation)
        return {}

    def send_object(self, position: Numbers, rotation: Numbers) -> Json:
        name = "splats"
        if name not in bpy.data.objects:
            setattr(_new(name), viewing.MOVES, "default")
        _put(bpy.data.objects[name], position, rotation)
        return {}

    def composite(self, color: Numbers, depth: float | str, at: list[list[int]]) -> Json:
        """As F12 does it, but for the wait for an image of its own view."""
        image = self._mirror.newest
        if image is None or image.color is None or image.depth is None:
            return {"seq": None}
        if self._composited is None:
            self._composited = Composited()
        shown = self._composited.over(image, color, float(depth))
        return {"seq": image.seq, "color": [adapter._numbers(shown[y, x, :3]) for x, y in at]}


class Composited:
    """A scene whose compositor has the extension's node after a plane of one colour."""

    def __init__(self) -> None:
        self._scene = scene = bpy.data.scenes.new("composited")
        scene.camera = _new("lens", bpy.data.cameras.new("lens"), scene)
        # In the space that the image has, whichever it is: nothing is to be converted.
        self._splats = compositing.set_up(scene, encoded=False)
        tree = nodes.compositor(scene)
        (group,) = (each for each in tree.nodes if each.bl_idname == "CompositorNodeGroup")
        # A plane is not rendered: no scene is, but that of the splats.
        for node in [*tree.nodes]:
            if node != group and getattr(node, "scene", None) not in (None, self._splats):
                tree.nodes.remove(node)
        for name in ("Image", "Depth"):
            for link in group.inputs[name].links:
                tree.links.remove(link)
        self._color, self._depth = group.inputs["Image"], group.inputs["Depth"]
        self._place = Path(bpy.app.tempdir) / "composited.exr"

    def over(self, image: Copied, color: Numbers, depth: float) -> NDArray[np.float32]:
        """Return the image before a plane: (height, width, 4) float32."""
        assert image.depth is not None
        self._splats[compositing.ENCODED] = image.semantics.color_space == "srgb"
        unit = scene_unit(image.semantics.unit_metres)  # the plane's is the image's own
        self._color.default_value = *color, 1
        self._depth.default_value = np.float32(depth) * np.float32(unit)
        height, width = image.depth.shape
        render = self._scene.render
        render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
        connection: Any = service.connection
        connection.image_of = lambda *_: image
        try:
            return rendered(self._scene, self._place)
        finally:
            # Its thread may outlive this module, and Blender has to be the last that ends.
            del connection.image_of


def rendered(scene: Any, place: Path) -> NDArray[np.float32]:
    """Return what F12 makes of a scene, (height, width, 4) from the top, by a file there."""
    settings = scene.render.image_settings
    if nodes.IS_5:
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode = "OPEN_EXR", "RGBA"
    settings.color_depth, settings.exr_codec = "32", "NONE"
    scene.render.filepath = str(place)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    image = bpy.data.images.load(scene.render.filepath)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    numbers = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(numbers)
    bpy.data.images.remove(image)
    return numbers.reshape(height, width, 4)[::-1]


def main() -> None:
    """Answer the harness, until it has enough; the extension need not be enabled."""
    # What Blender, its engines and its compositor print is no answer.
    lines = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
    os.dup2(2, 1)
    registration.register()
    client = {"name": "splatbus-blender", "version": bpy.app.version_string}
    adapter.serve(Adapter(), lines, client, axes="blender", unitsPerMetre=1, precision="single")
    registration.unregister()  # 4.2 crashes at its end where a class of an engine is left behind


def _new(name: str, data: Any = None, scene: Any = None) -> Any:
    thing = bpy.data.objects.new(name, data)
    (scene or bpy.context.scene).collection.objects.link(thing)
    thing.rotation_mode = "QUATERNION"
    return thing


def _put(thing: Any, position: Numbers, rotation: Numbers) -> None:
    x, y, z, w = rotation
    thing.location, thing.rotation_quaternion = position, (w, x, y, z)
    bpy.context.view_layer.update()
    service.tell()
