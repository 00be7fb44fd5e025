"""F12 of meshes and of what a server shows, as a person has it.

picture.py WHERE.png
"""

import sys
import time

import bpy
from scenery import EYE, in_the_garden, looking
from splatbus_blender import compositing, engine, nodes, properties, service

scene = bpy.context.scene
properties.register()
engine.register()
in_the_garden()
paint = bpy.data.materials.new("paint")
paint.use_nodes = True
paint.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.27, 0.03, 1)
for each in scene.objects:
    each.data.materials.append(paint)
    for face in each.data.polygons:
        face.use_smooth = True
sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
sun.data.energy, sun.rotation_euler = 3, (0.8, 0.2, 0.6)
camera = scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.location, camera.rotation_euler = EYE, looking().to_euler()
camera.data.lens = 30
for each in (sun, camera):
    scene.collection.objects.link(each)
scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
scene.cycles.samples, scene.cycles.use_denoising = 48, False
scene.render.resolution_x, scene.render.resolution_y = 800, 450
scene.view_settings.view_transform = "Standard"
bpy.context.view_layer.update()
service.connect(scene)
end = time.monotonic() + 200
while service.images() is None:
    assert time.monotonic() < end, service.complaints()
    time.sleep(0.01)
compositing.set_up(scene, encoded=service.images().semantics.color_space == "srgb")
if nodes.IS_5:
    scene.render.image_settings.media_type = "IMAGE"
scene.render.image_settings.file_format = "PNG"
scene.render.filepath = sys.argv[1]
bpy.ops.render.render(write_still=True)
service.unregister()
engine.unregister()
properties.unregister()
