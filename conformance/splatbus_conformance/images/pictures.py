"""Pictures for people of an image that was judged: what came, what belongs there, what differs."""

import base64
import io
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.known_scene import COLOR_BUDGET, DEPTH_BUDGET, ExactImage
from splatbus_conformance.images.painted import Painting

WIDTH = 320
"""Of a picture, about, in pixels: smaller images are shown larger, and larger ones smaller."""
SQUARE = 8
"""Of the pattern that is seen where an image is transparent."""
NO_NUMBER = (255, 0, 255)
Bytes = NDArray[np.uint8]


class Picture(NamedTuple):
    """One of them."""

    title: str
    png: str
    """In base64."""


def pictures_of(came: CapturedFrame, exact: ExactImage | None) -> tuple[Picture, ...]:
    """What came, and beside it, where the scene is known, what belongs there and where they differ:
    in red colours, in blue depths, the brighter the more; grey is not compared.
    """
    first = Picture("what came", _png(_over_squares(came.color)))
    if exact is None:
        return (first,)
    off = exact.color_error(came.color), exact.depth_error(came.planar()) / DEPTH_BUDGET
    red, blue = (_shade(each, least) for each, least in zip(off, (COLOR_BUDGET, 1.0), strict=True))
    apart = np.stack((red, np.zeros_like(red), blue), axis=-1)
    apart[~exact.certain] = 96
    return (
        first,
        Picture("what its camera sees", _png(_over_squares(exact.color))),
        Picture("where they differ: colour red, depth blue, grey not compared", _png(apart)),
    )


def pictures_of_reading(read: Painting, lent: Painting) -> tuple[Picture, ...]:
    """What a client reads of an image, the image that it was lent, and where they differ; nothing
    where they do not.

    Painted values may lie anywhere: of each colour, black and white are the least and the most that
    was lent.
    """
    red, blue = (_unequal(*pair) for pair in zip(read, lent, strict=True))
    apart = np.stack((red.any(axis=-1), np.zeros_like(blue), blue), axis=-1)
    if not apart.any():
        return ()
    return (
        Picture("what the client shows", _png(_stretched(read.color, lent.color))),
        Picture("what it was lent", _png(_stretched(lent.color, lent.color))),
        Picture("where they differ: colour red, depth blue", _png(np.where(apart, 255, 24))),
    )


def _unequal(one: NDArray[np.floating], other: NDArray[np.floating]) -> NDArray[np.bool_]:
    unequal: NDArray[np.bool_] = (one != other) & ~(np.isnan(one) & np.isnan(other))
    return unequal


def _stretched(color: NDArray[np.floating], by: NDArray[np.floating]) -> Bytes:
    finite = np.where(np.isfinite(by), by, 0.0)[..., :3].astype(np.float64)
    least, most = finite.min(axis=(0, 1)), finite.max(axis=(0, 1))
    shown = (color[..., :3] - least) / np.where(most > least, most - least, 1.0)
    shades: Bytes = (255.0 * np.clip(np.nan_to_num(shown), 0.0, 1.0)).astype(np.uint8)
    shades[np.isnan(shown).any(axis=-1)] = NO_NUMBER
    return shades


def _over_squares(color: NDArray[np.floating]) -> Bytes:
    """(h, w, 3): premultiplied colour as it is stored, over a pattern."""
    row, column = np.indices(color.shape[:2]) // SQUARE
    under = np.where((row + column) % 2 == 0, 0.6, 0.75)[..., None]
    with np.errstate(invalid="ignore"):
        shown = color[..., :3] + (1.0 - np.clip(color[..., 3:], 0.0, 1.0)) * under
        shades: Bytes = (255.0 * np.clip(shown, 0.0, 1.0)).astype(np.uint8)
    shades[np.isnan(shown).any(axis=-1)] = NO_NUMBER
    return shades


def _shade(off: NDArray[np.floating], least: float) -> Bytes:
    """(h, w): dark where it is right, and brighter from `least` on, by its logarithm."""
    with np.errstate(divide="ignore"):
        steps = np.clip(np.log10(np.maximum(off / least, 1e-9)), 0.0, 2.0)
    return np.where(off > least, 105 + 75 * steps, 24).astype(np.uint8)


def _png(shades: NDArray[np.integer]) -> str:
    from PIL import Image  # which takes long to import

    width = shades.shape[1]
    larger, smaller = max(1, WIDTH // width), max(1, width // (2 * WIDTH))
    sized = shades[::smaller, ::smaller].repeat(larger, 0).repeat(larger, 1)
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(sized, np.uint8)).save(file, "PNG", optimize=True)
    return base64.b64encode(file.getvalue()).decode("ascii")
