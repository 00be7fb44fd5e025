"""The timeline of Blender, and time in the splats' scene."""

from __future__ import annotations


def seconds(frame: float, first: float, fps: float, fps_base: float) -> float:
    """Return the time to show at a frame: 0 at the first one of the scene.

    Args:
        frame: with what a subframe adds to it.
        first: the frame that the scene starts with.
        fps: frames in a second, of Blender's settings.
        fps_base: what Blender divides them by, 1.001 for 29.97.
    """
    return (frame - first) * fps_base / fps
