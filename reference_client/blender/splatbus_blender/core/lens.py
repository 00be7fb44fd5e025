"""Lenses: from a camera of Blender, or a viewport's projection, to `intrinsics` [CAM-4].

Blender measures in millimetres on a sensor, the wire in pixels of an image whose y points down.
"""

from __future__ import annotations

from typing import NamedTuple

from splatbus_wire.message_types import Intrinsics

from .poses import Rows


class Film(NamedTuple):
    """What an image is taken on.

    Attributes:
        width: in pixels.
        height: in pixels.
        aspect_x: width of a pixel, in a unit of its own.
        aspect_y: its height, in the same.
    """

    width: int
    height: int
    aspect_x: float = 1.0
    aspect_y: float = 1.0


class Optics(NamedTuple):
    """The numbers of a perspective camera, by Blender's names.

    Attributes:
        lens: focal length, millimetres.
        sensor_fit: "AUTO", "HORIZONTAL" or "VERTICAL".
        sensor_width: millimetres.
        sensor_height: millimetres.
        shift_x: as a part of the side that the sensor fits.
        shift_y: the same.
        clip_start: in Blender's units.
        clip_end: the same.
    """

    lens: float
    sensor_fit: str
    sensor_width: float
    sensor_height: float
    shift_x: float
    shift_y: float
    clip_start: float
    clip_end: float


def camera_lens(optics: Optics, film: Film) -> Intrinsics:
    """Return the lens through which Blender renders, its clipping planes in Blender's units."""
    width, height, tall = film.width, film.height, film.aspect_y / film.aspect_x
    fits = optics.sensor_fit
    # The sensor's height counts only for who asked for it: AUTO fits the width to the longer side.
    sensor = optics.sensor_height if fits == "VERTICAL" else optics.sensor_width
    if fits == "AUTO":
        fits = "HORIZONTAL" if film.aspect_x * width >= film.aspect_y * height else "VERTICAL"
    side = width if fits == "HORIZONTAL" else tall * height
    focal = optics.lens * side / sensor
    return Intrinsics(
        focal,
        focal / tall,
        width / 2 - optics.shift_x * side,
        height / 2 + optics.shift_y * side / tall,
        width,
        height,
        optics.clip_start,
        optics.clip_end,
    )


def region_lens(
    window: Rows, width: int, height: int, clip_start: float, clip_end: float
) -> Intrinsics:
    """Return the lens of a viewport that shows perspective.

    Args:
        window: its projection, from the eye's axes to −1…1, as OpenGL has it.
        width: of the region, pixels.
        height: the same.
        clip_start: in Blender's units; the matrix has it too, with few digits left.
        clip_end: the same.
    """
    return Intrinsics(
        window[0][0] * width / 2,
        window[1][1] * height / 2,
        (1 - window[0][2]) * width / 2,
        (1 + window[1][2]) * height / 2,
        width,
        height,
        clip_start,
        clip_end,
    )


def for_images(lens: Intrinsics, width: int, height: int, unit: float = 1.0) -> Intrinsics:
    """Return the same view in pixels of the server's images, which need not have its shape [CAM-6].

    They are stretched to what the lens was of when they are drawn.

    Args:
        lens: with clipping planes in Blender's units.
        width: of the images.
        height: of the images.
        unit: Blender's units to one of the splats' scene.
    """
    x, y = width / lens.width, height / lens.height
    fx, fy, cx, cy = lens.fx * x, lens.fy * y, lens.cx * x, lens.cy * y
    return Intrinsics(fx, fy, cx, cy, width, height, lens.near / unit, lens.far / unit)
