"""An adapter for the harness (conformance/ADAPTER.md): cameras and empties of Blender steer.

What the extension does by a timer in Blender's window is done here after each command: in the
background, no timer of Blender's runs. What Blender has no part in is the Python client's adapter.
"""

import os
from pathlib import Path

import bpy
import numpy as np
from splatbus_blender import compositing, engine, nodes, properties, service, viewing
from splatbus_blender.core import wanted
from splatbus_viewer import adapter
from whole import rendered

# What Blender, its engines and its compositor print is no answer.
LINES = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
os.dup2(2, 1)


class Adapter(adapter.Adapter):
    """One method for each command: members in, members of the answer out."""

    def __init__(self):
        super().__init__("blender")
        self._composited = None

    @property
    def _session(self):
        return service.connection.session

    @property
    def _mirror(self):
        return service.connection

    def start(self):
        bpy.context.scene.camera = None
        service.connect(bpy.context.scene)
        return {}

    def stop(self):
        service.unregister()
        return {}

    def send_camera(self, position, rotation):
        scene = bpy.context.scene
        if scene.camera is None:
            scene.camera = _new("eye", bpy.data.cameras.new("eye"))
        _put(scene.camera, position, rotation)
        return {}

    def send_object(self, position, rotation):
        name = "splats"
        if name not in bpy.data.objects:
            setattr(_new(name), viewing.MOVES, "default")
        _put(bpy.data.objects[name], position, rotation)
        return {}

    def composite(self, color, depth, at):
        """As F12 does it, but for the wait for an image of its own view."""
        image = service.connection.newest
        if image is None or image.color is None or image.depth is None:
            return {"seq": None}
        if self._composited is None:
            self._composited = Composited()
        shown = self._composited.over(image, color, float(depth))
        return {"seq": image.seq, "color": [adapter._numbers(shown[y, x, :3]) for x, y in at]}


class Composited:
    """A scene whose compositor has the extension's node after a plane of one colour."""

    def __init__(self):
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

    def over(self, image, color, depth):
        """The image before a plane: (height, width, 4) float32."""
        self._splats[compositing.ENCODED] = image.semantics.color_space == "srgb"
        unit = wanted.scene_unit(image.semantics.unit_metres)  # the plane's is the image's own
        self._color.default_value = *color, 1
        self._depth.default_value = np.float32(depth) * np.float32(unit)
        height, width = image.depth.shape
        render = self._scene.render
        render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
        service.connection.image_of = lambda *_: image
        try:
            return rendered(self._scene, self._place)
        finally:
            # Its thread may outlive this module, and Blender has to be the last that ends.
            del service.connection.image_of


def _new(name, data=None, scene=None):
    thing = bpy.data.objects.new(name, data)
    (scene or bpy.context.scene).collection.objects.link(thing)
    thing.rotation_mode = "QUATERNION"
    return thing


def _put(thing, position, rotation):
    x, y, z, w = rotation
    thing.location, thing.rotation_quaternion = position, (w, x, y, z)
    bpy.context.view_layer.update()
    service.tell()


properties.register()
engine.register()
client = {"name": "splatbus-blender", "version": bpy.app.version_string}
adapter.serve(Adapter(), LINES, client, axes="blender", unitsPerMetre=1, precision="single")
engine.unregister()  # 4.2 crashes at its end where a class of an engine is left behind
properties.unregister()
