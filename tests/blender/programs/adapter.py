"""An adapter for the harness (conformance/ADAPTER.md): cameras and empties of Blender steer.

What the extension does by a timer in Blender's window is done here after each command: in the
background, no timer of Blender's runs.
"""

import hashlib
import json
import math
import sys

import bpy
from splatbus_blender import properties, service, viewing
from splatbus_wire.semantics import semantics_object


class Adapter:
    """One method for each command: members in, members of the answer out."""

    def start(self):
        scene = bpy.context.scene
        scene.camera = None
        service.connect(scene)
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

    def init_packet(self):
        it = service.connection.session.images
        return {"images": it and it._asdict() | {"semantics": semantics_object(it.semantics)}}

    def pixels(self, at):
        if (image := service.connection.newest) is None:
            return {"seq": None}
        color = None if image.color is None else [_numbers(image.color[y, x]) for x, y in at]
        depth = None if image.depth is None else [_number(image.depth[y, x]) for x, y in at]
        return {"seq": image.seq, "color": color, "depth": depth}

    def digest(self):
        if (image := service.connection.newest) is None:
            return {"seq": None}
        return {"seq": image.seq, "color": _sha256(image.color), "depth": _sha256(image.depth)}


def _new(name, data=None):
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    thing.rotation_mode = "QUATERNION"
    return thing


def _put(thing, position, rotation):
    x, y, z, w = rotation
    thing.location, thing.rotation_quaternion = position, (w, x, y, z)
    bpy.context.view_layer.update()
    service.tell()


def _sha256(image):
    return None if image is None else hashlib.sha256(image.astype("<f4").tobytes()).hexdigest()


def _numbers(values):
    return [_number(value) for value in values]


def _number(value):
    return float(value) if math.isfinite(value) else str(float(value))


def main():
    adapter = Adapter()
    can = [name for name in dir(adapter) if not name.startswith("_")]
    client = {"name": "splatbus-blender", "version": bpy.app.version_string}
    units = {"axes": "blender", "unitsPerMetre": 1, "precision": "single"}
    print(json.dumps({"adapter": "1", "client": client, **units, "can": can}), flush=True)
    for line in sys.stdin:
        members = json.loads(line)
        number, name = members.pop("id"), members.pop("command")
        try:
            if name not in can:
                raise ValueError(f"there is no command {name!r}")
            answer = getattr(adapter, name)(**members)
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps({"id": number, **answer}, allow_nan=False), flush=True)
        if name == "stop":
            break


properties.register()
main()
