"""`intrinsics.json`: focal lengths, principal points and pixel centres."""

from typing import NamedTuple

from splatbus_conformance.oracle.intrinsics import HALF, Intrinsics, from_opencv
from splatbus_conformance.oracle.vectors.layout import (
    Json,
    Number,
    both,
    exactly,
    within,
)

EXAMPLE = Intrinsics(300.0, 300.0, 160.0, 120.0, 320, 240)
OFF_CENTRE = Intrinsics(1111.25, 1109.5, 971.3, 533.7, 1920, 1080)
ODD = Intrinsics(100.5, 99.25, 3.5, 2.5, 7, 5)
CALIBRATED = Intrinsics(532.1, 531.9, 319.5, 239.5, 640, 480)

SCALED = {
    "to its own size": (OFF_CENTRE, (1920, 1080)),
    "to half the size": (OFF_CENTRE, (960, 540)),
    "to twice the size": (EXAMPLE, (640, 480)),
    "to two thirds of the size": (OFF_CENTRE, (1280, 720)),
    "to 8K": (OFF_CENTRE, (7680, 4320)),
    "each axis on its own": (OFF_CENTRE, (1366, 768)),
    "to a single pixel": (EXAMPLE, (1, 1)),
    "from an odd size": (ODD, (1920, 1080)),
    "a calibration, once half a pixel is added": (from_opencv(CALIBRATED), (1280, 960)),
}

SHAPES = {
    "the same size": ((1920, 1080), (1920, 1080)),
    "half the size": ((1920, 1080), (960, 540)),
    "rounded up to a whole pixel": ((1920, 1080), (854, 480)),
    "rounded down to a whole pixel": ((1920, 1080), (853, 480)),
    "the images the larger ones": ((854, 480), (1920, 1080)),
    "as wide as rounding makes it": ((1920, 1080), (855, 480)),
    "wider": ((1920, 1080), (856, 480)),
    "as narrow as rounding makes it": ((1920, 1080), (852, 480)),
    "narrower": ((1920, 1080), (851, 480)),
    "upright, rounded up to a whole pixel": ((1080, 1920), (361, 641)),
    "upright, wider": ((1080, 1920), (362, 640)),
    "a row too many, of the same width": ((640, 480), (640, 481)),
    "a column too many, of the same height": ((640, 480), (641, 480)),
    "16:9 for 4:3": ((640, 480), (1920, 1080)),
    "upright for lying": ((1080, 1920), (1920, 1080)),
    "the largest": ((32768, 32768), (32768, 32768)),
    "the largest, a row less": ((32768, 32768), (32768, 32767)),
    "a single pixel for a square": ((1, 1), (512, 512)),
    "a single pixel for twice as high": ((1, 1), (512, 1024)),
    "a whole pixel is no rounding": ((2, 2), (2, 4)),
}

CALIBRATIONS = {
    "the middle of 640x480": CALIBRATED,
    "beside the middle": Intrinsics(1111.25, 1109.5, 970.8, 533.2, 1920, 1080),
    "the centre of the top-left pixel": Intrinsics(500.0, 500.0, 0.0, 0.0, 640, 480),
    "the corner of the image": Intrinsics(500.0, 500.0, -0.5, -0.5, 640, 480),
}


class PixelPlace(NamedTuple):
    """A pixel of an image."""

    column: int
    row: int


PIXELS = {
    "top left": (EXAMPLE, PixelPlace(0, 0)),
    "top right": (EXAMPLE, PixelPlace(319, 0)),
    "bottom left": (EXAMPLE, PixelPlace(0, 239)),
    "bottom right": (EXAMPLE, PixelPlace(319, 239)),
    "right and below of the middle": (EXAMPLE, PixelPlace(160, 120)),
    "left and above of the middle": (EXAMPLE, PixelPlace(159, 119)),
    "the middle pixel of an odd image": (ODD, PixelPlace(3, 2)),
    "principal point off centre": (OFF_CENTRE, PixelPlace(971, 533)),
    "principal point off centre, top left": (OFF_CENTRE, PixelPlace(0, 0)),
    "the last of 8K": (OFF_CENTRE.scaled(7680, 4320), PixelPlace(7679, 4319)),
}

IMAGE_POINTS = {
    "the upper left corner": (0.0, 0.0),
    "the centre of the top-left pixel": (0.5, 0.5),
    "just short of the next column": (0.9999999999999999, 0.5),
    "on the border between two columns": (1.0, 0.5),
    "on the border between two rows": (0.5, 1.0),
    "the middle": (160.0, 120.0),
    "just inside the right border": (319.99999999999994, 120.5),
    "the right border is outside": (320.0, 120.5),
    "the lower border is outside": (160.5, 240.0),
    "just above the upper border": (160.5, -5e-324),
    "left of the image": (-0.25, 120.5),
    "far outside": (1e300, -1e300),
}

DISTANCES = {
    "straight ahead": (ODD, PixelPlace(3, 2), 4.0),
    "towards a corner": (EXAMPLE, PixelPlace(0, 0), 4.0),
    "towards the other corner": (EXAMPLE, PixelPlace(319, 239), 4.0),
    "off centre": (OFF_CENTRE, PixelPlace(1919, 0), 123.5),
    "a thousand million units away": (OFF_CENTRE, PixelPlace(17, 1000), 1e9),
    "a millionth of a unit away": (EXAMPLE, PixelPlace(319, 0), 2.0**-20),
}


def document() -> Json:
    """Return the whole file."""
    return {
        "$schema": "vectors.schema.json",
        "name": "intrinsics",
        "version": "1.1",
        "description": "Image points (u, v) are in pixels from the upper left corner of the image,"
        " u to the right and v down; the centre of the top-left pixel is (0.5, 0.5). `scaled`:"
        " intrinsics for one size of image to the same camera's for the size `to`. `shape`: whether"
        " intrinsics for an image of the size `given` may be scaled to images of the size `to`,"
        " which have the same shape but for rounding. `calibration`:"
        " from what OpenCV says, whose pixel centres are whole numbers, to what the wire says."
        " `pixel`: from [column, row], both from 0, rows from the top, to the centre of the pixel,"
        " to the direction in which it looks in camera axes, and to OpenGL's normalised device"
        " coordinates. `image_point`: to the [column, row] of the pixel around it, null outside of"
        " the image. `ray_distance`: from the distance along the ray of a pixel's centre to planar"
        " depth.",
        "requirements": ["IMG-1", "MEM-13", "CAM-5", "CAM-6"],
        "tolerances": {
            "scaled": _reached("ulp_double", 2),
            "shape": exactly("Whole numbers only."),
            "calibration": exactly("One sum, correctly rounded."),
            "image_point": exactly("The centre of a pixel is a number of halves."),
            "ray": _reached("ulp_double", 2),
            "device_point": _reached("component", HALF**51),
            "pixel": exactly("A pixel has its left and its upper border."),
            "planar_depth": within(
                "ulp_single", 1, None, "In double precision, rounded once; no clause says more."
            ),
        },
        "cases": [
            *[_scaled(name, *given) for name, given in SCALED.items()],
            *[_shape(name, *given) for name, given in SHAPES.items()],
            *[_calibration(name, given) for name, given in CALIBRATIONS.items()],
            *[_pixel(name, *given) for name, given in PIXELS.items()],
            *[_image_point(name, *given) for name, given in IMAGE_POINTS.items()],
            *[_distance(name, *given) for name, given in DISTANCES.items()],
        ],
    }


def _reached(measure: str, bound: Number) -> Json:
    note = "What plain double precision reaches; no clause gives a budget."
    return within(measure, bound, None, note)


def stated(camera: Intrinsics) -> Json:
    """Return intrinsics as members of a case."""
    numbers = {name: both(getattr(camera, name)) for name in ("fx", "fy", "cx", "cy")}
    return {**numbers, "width": camera.width, "height": camera.height}


def _case(quantity: str, name: str, requirement: str = "IMG-1", **members: Json) -> Json:
    return {
        "name": f"{quantity}: {name}",
        "requirement": requirement,
        "quantity": quantity,
        **members,
    }


def _scaled(name: str, camera: Intrinsics, size: tuple[int, int]) -> Json:
    return _case(
        "scaled",
        name,
        "CAM-5",
        intrinsics=stated(camera),
        to=list(size),
        expected=stated(camera.scaled(*size)),
    )


def _shape(name: str, given: tuple[int, int], to: tuple[int, int]) -> Json:
    accepted = EXAMPLE._replace(width=given[0], height=given[1]).has_shape_of(*to)
    return _case(
        "shape", name, "CAM-6", given=list(given), to=list(to), expected={"accepted": accepted}
    )


def _calibration(name: str, calibration: Intrinsics) -> Json:
    return _case(
        "calibration",
        name,
        opencv=stated(calibration),
        expected=stated(from_opencv(calibration)),
    )


def _pixel(name: str, camera: Intrinsics, place: PixelPlace) -> Json:
    centre = place.column + HALF, place.row + HALF
    return _case(
        "pixel",
        name,
        intrinsics=stated(camera),
        pixel=list(place),
        expected={
            "image_point": both(centre),
            "ray": both(camera.ray(*centre)),
            "device_point": both(camera.device_point(*centre)),
        },
    )


def _image_point(name: str, u: float, v: float) -> Json:
    around = EXAMPLE.pixel(u, v)
    return _case(
        "image_point",
        name,
        size=[EXAMPLE.width, EXAMPLE.height],
        image_point=both((u, v)),
        expected={"pixel": None if around is None else list(around)},
    )


def _distance(name: str, camera: Intrinsics, place: PixelPlace, distance: float) -> Json:
    depth = camera.planar(place.column + HALF, place.row + HALF, distance)
    return _case(
        "ray_distance",
        name,
        "MEM-13",
        intrinsics=stated(camera),
        pixel=list(place),
        distance=both(distance),
        expected={"planar_depth": both(depth)},
    )
