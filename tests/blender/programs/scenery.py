"""The meshes that pictures show in the garden, and from where."""

import bpy
from mathutils import Vector

EYE, MIDDLE = Vector((-1.0, -3.2, 1.4)), Vector((0, 0, 0.52))
"""From where to where one looks."""


def in_the_garden():
    """A ring about the tree, and a monkey's head beside it, instead of what there was."""
    for each in [*bpy.data.objects]:
        bpy.data.objects.remove(each)
    bpy.ops.mesh.primitive_torus_add(
        location=(0, 0, 0.85), rotation=(0.45, 0.3, 0), major_radius=0.62, minor_radius=0.05
    )
    bpy.ops.mesh.primitive_monkey_add(
        location=(0.5, -0.42, 0.14), rotation=(-0.5, 0, -0.45), size=0.4
    )
    bpy.context.object.select_set(False)
    bpy.context.view_layer.objects.active = None


def looking():
    """The rotation of a camera there."""
    return (MIDDLE - EYE).to_track_quat("-Z", "Y")
