"""Cases of `images.json`: a pixel of splats over one of the client's own geometry."""

import math

from splatbus_conformance.oracle.images import composite
from splatbus_conformance.oracle.vectors.layout import Json, both, single

Pixel = tuple[float, ...]
Given = tuple[Pixel, float, Pixel, float]

GREY = (0.25, 0.25, 0.25)
BRIGHT = (0.9, 0.8, 0.6)
ORANGE = (1.0, 0.5, 0.0, 0.5)
NOTHING = (0.0, 0.0, 0.0, 0.0)

BLENDED: dict[str, tuple[bool, Given]] = {
    "straight over black": (False, ((0.5, 0.5, 0.5, 0.5), 4.0, (0.0, 0.0, 0.0), 10.0)),
    "straight over grey": (False, ((0.5, 0.25, 1.0, 0.5), 4.0, GREY, 10.0)),
    "premultiplied over grey": (True, ((0.25, 0.125, 0.5, 0.5), 4.0, GREY, 10.0)),
    "straight, tenths": (False, ((0.1, 0.2, 0.3, 0.7), 4.0, BRIGHT, math.inf)),
    "premultiplied, tenths": (True, ((0.07, 0.14, 0.21, 0.7), 4.0, BRIGHT, math.inf)),
    "opaque over colour": (False, ((0.1, 0.2, 0.3, 1.0), 4.0, BRIGHT, 10.0)),
    "nearly opaque": (False, ((0.1, 0.2, 0.0, 0.99999994), 4.0, (0.9, 0.8, 0.7), 10.0)),
    "a faint splat": (False, ((0.1, 0.2, 0.3, 1e-30), 4.0, (0.9, 0.0, 0.6), 10.0)),
    "behind the geometry": (False, ((0.1, 0.2, 0.3, 1.0), 10.5, GREY, 10.0)),
    "as deep as the geometry": (False, ((0.1, 0.2, 0.3, 1.0), 10.0, GREY, 10.0)),
    "premultiplied, opaque over colour": (True, ((0.1, 0.2, 0.3, 1.0), 4.0, BRIGHT, 10.0)),
    "premultiplied, nearly opaque": (True, ((0.1, 0.2, 0.0, 0.99999994), 4.0, BRIGHT, 10.0)),
    "straight, alpha 1e-7": (False, ((1.0, 0.5, 0.25, 1e-7), 4.0, BRIGHT, 10.0)),
    "premultiplied, alpha 1e-7": (True, ((1e-7, 5e-8, 2.5e-8, 1e-7), 4.0, BRIGHT, 10.0)),
    "straight, alpha 1e-7 over black": (False, ((1.0, 0.5, 0.25, 1e-7), 4.0, (0.0,) * 3, 10.0)),
    "premultiplied, behind the geometry": (True, ((0.1, 0.2, 0.3, 1.0), 10.5, GREY, 10.0)),
    "premultiplied, as deep as the geometry": (True, ((0.1, 0.2, 0.3, 1.0), 10.0, GREY, 10.0)),
    "in front by an ULP": (False, (ORANGE, 9.999999, GREY, 10.0)),
    "splats a thousand million units away": (False, (ORANGE, 1e9, GREY, math.inf)),
    "splats a millionth of a unit away": (False, (ORANGE, 1e-6, GREY, 10.0)),
}

EMPTY: dict[str, Given] = {
    "empty: depth infinite": (NOTHING, math.inf, GREY, math.inf),
    "empty: depth 100, geometry beyond": (NOTHING, 100.0, GREY, 250.0),
    "depth 100 and alpha: a surface": (ORANGE, 100.0, GREY, 250.0),
    "depth is no number": (ORANGE, math.nan, GREY, 10.0),
    "depth 0": (ORANGE, 0.0, GREY, 10.0),
    "depth negative": (ORANGE, -4.0, GREY, 10.0),
    "depth minus 0": (ORANGE, -0.0, GREY, 10.0),
    "depth minus infinity": (ORANGE, -math.inf, GREY, 10.0),
    "depth infinite, and alpha": (ORANGE, math.inf, GREY, math.inf),
    "depth infinite before geometry, and alpha": (ORANGE, math.inf, GREY, 10.0),
    "depth no number, no geometry": (ORANGE, math.nan, GREY, math.inf),
    "alpha 0 in front": (NOTHING, 4.0, GREY, 10.0),
    "alpha 0 in front, and colour": ((1.0, 0.5, 0.25, 0.0), 4.0, GREY, 10.0),
    "alpha 0, and a colour that is no number": ((math.nan, math.inf, 0.0, 0.0), 4.0, GREY, 10.0),
    "alpha 0, depth no number, colour no number": ((math.nan,) * 3 + (0.0,), math.nan, GREY, 10.0),
}

ANNOUNCED: dict[str, tuple[float, Given]] = {
    "announced as empty: 100, and alpha": (100.0, (ORANGE, 100.0, GREY, 250.0)),
    "announced as empty: 100; nearer by an ULP": (100.0, (ORANGE, 99.99999, GREY, 250.0)),
    "announced as empty: 100; farther": (100.0, (ORANGE, 101.0, GREY, 250.0)),
    "announced as empty: 100; infinite all the same": (100.0, (ORANGE, math.inf, GREY, math.inf)),
    "announced as empty: 0": (0.0, (ORANGE, 0.0, GREY, 10.0)),
    "announced as empty: -1; 100 is a surface": (-1.0, (ORANGE, 100.0, GREY, 250.0)),
}


def cases() -> list[Json]:
    """Return the cases of `composite`."""
    return [
        *[_case(name, given, premultiplied) for name, (premultiplied, given) in BLENDED.items()],
        *[_case(name, given, False) for name, given in EMPTY.items()],
        *[_case(f"premultiplied, {name}", given, True) for name, given in EMPTY.items()],
        *[_case(name, given, False, empty) for name, (empty, given) in ANNOUNCED.items()],
    ]


def _case(name: str, given: Given, premultiplied: bool, empty: float | None = None) -> Json:
    splat, depth, background, behind = given
    pixel, under = [single(a) for a in splat], [single(a) for a in background]
    z = single(depth)
    colour = composite(
        pixel,
        z,
        under,
        behind,
        premultiplied=premultiplied,
        empty=math.inf if empty is None else empty,
    )
    since = {"since": "1.1"} if premultiplied or empty is not None else {}
    return {
        "name": name,
        "requirement": "MEM-13" if since else _requirement(pixel[3], z),
        **since,
        "quantity": "composite",
        "alpha": "premultiplied" if premultiplied else "straight",
        **({} if empty is None else {"depth_empty": both(empty)}),
        "splat": both(pixel),
        "splat_depth": both(z),
        "background": both(under),
        "background_depth": both(behind),
        "expected": both(colour),
    }


def _requirement(alpha: float, depth: float) -> str:
    if alpha == 0 or depth == math.inf:
        return "BUF-8"
    return "ACC-10" if depth > 0 else "BUF-9"
