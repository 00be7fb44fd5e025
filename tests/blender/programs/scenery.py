"""The meshes that pictures show among what `splatbus-server` shows."""

import bpy


def around_the_red_sphere():
    """A ring about it, and a monkey's head behind it, instead of what there was."""
    for each in [*bpy.data.objects]:
        bpy.data.objects.remove(each)
    bpy.ops.mesh.primitive_torus_add(
        location=(0, 4, 0), rotation=(0.2, 0.4, 0), major_radius=1.4, minor_radius=0.15
    )
    bpy.ops.mesh.primitive_monkey_add(location=(-0.9, 5.6, 0.5), rotation=(0, 0, 0.5), size=2)
    bpy.context.object.select_set(False)
    bpy.context.view_layer.objects.active = None
