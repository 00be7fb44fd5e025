"""SplatBus in Blender.

`poses`, `lens` and `timeline` are functions of numbers; `reading` takes the numbers from Blender's
things. None of them imports `bpy`, so that they can be tried without it.
"""
