"""The extension for Blender; what needs Blender runs in a process of its own (`running`)."""
