"""What the extension does without Blender: functions of numbers, and a session in the background.

Nothing here imports `bpy` or takes a thing of Blender's.
"""
