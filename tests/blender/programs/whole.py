"""Renders of which every bit is kept."""

import bpy
import numpy as np
from splatbus_blender import nodes


def rendered(scene, place):
    """What F12 makes of a scene, (height, width, 4) float32 from the top, by a file there."""
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
