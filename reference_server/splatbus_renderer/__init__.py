"""A small renderer: a scene whose every pixel is known exactly, and the command `splatbus-server`.

On top of `splatbus_server`, by what that gives to every renderer. It is there to try a viewer with,
and is what the harness knows as its scene (`conformance/SCENE.md`).
"""
