"""F12, beside a server: the picture of meshes and splats, and what it has to be made of.

    render.py WHERE.npz "engine of the meshes" frame

writes the render, and by themselves the colour and depth of the meshes that were composited.
"""

import sys
import time
from pathlib import Path

import bpy
import numpy as np
from splatbus_blender import compositing, engine, nodes, properties, service
from splatbus_blender.adapter import rendered
from splatbus_blender.viewing import MOVES

place, meshes, frame = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
WIDTH, HEIGHT = 64, 48

scene = bpy.context.scene
properties.register()
engine.register()


def stage():
    """The cube of Blender's first scene before splats, cut by them and behind them."""
    scene.render.engine = meshes
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    scene.render.use_sequencer = False
    scene.frame_start = 1
    if meshes == "CYCLES":
        scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.device = 1, False, "CPU"
        scene.cycles.pixel_filter_type = "BOX"
    scene.camera.keyframe_insert("location", frame=1)
    scene.camera.location.x += 1
    scene.camera.keyframe_insert("location", frame=11)
    scene.frame_set(frame)
    empty = bpy.data.objects.new("mover", None)
    setattr(empty, MOVES, "default")
    empty.location = (1, 2, 3)
    scene.collection.objects.link(empty)
    bpy.context.view_layer.update()


def picture(socket, name):
    """What the compositor makes of a socket."""
    tree = nodes.compositor(scene)
    tree.links.new(socket, nodes.shown(tree))
    return rendered(scene, place.with_name(f"{name}.exr"))


stage()
service.connect(scene)
end = time.monotonic() + 60
while (session := service.connection.session) is None or session.images is None:
    assert time.monotonic() < end, service.connection.problems
    time.sleep(0.01)
encoded = session.images.semantics.color_space == "srgb"
compositing.set_up(scene, encoded=encoded)
compositing.set_up(scene, encoded=encoded)  # once more changes nothing
tree = nodes.compositor(scene)
(group,) = (each for each in tree.nodes if each.bl_idname == "CompositorNodeGroup")
final = picture(group.outputs[0], "final")
behind, depth = (group.inputs[name].links[0].from_socket for name in ("Image", "Depth"))
shown = {
    "final": final,
    "meshes": picture(behind, "meshes"),
    "depth": picture(depth, "depth")[..., 0],
}
image = service.connection.newest
camera = image.camera
np.savez(
    place,
    color=image.color,
    splats=image.depth,
    position=camera.pose.position,
    rotation=camera.pose.rotation,
    lens=camera.intrinsics,
    moved=[each.pose.position for each in image.objects],
    **shown,
)
service.unregister()
engine.unregister()  # 4.2 crashes at its end where a class of an engine is left behind
properties.unregister()
