"""Three panels: colour, depth in false colour with its scale, and a composite with a mesh."""

from typing import Union

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.compositing import over_straight

from splatbus_viewer.display import RAMP, Float32Array, Shown, range_of
from splatbus_viewer.mesh import ring_around

try:
    from PIL import Image, ImageDraw, ImageFont
except ImportError as problem:  # pragma: no cover
    extra = "install it with: pip install 'splatbus-protocol[client]'"
    raise ImportError(f"pictures need Pillow; {extra}") from problem

_RAMP = np.array(RAMP) / np.float32(255)
_PAPER, _INK, _FAINT = (250, 250, 248), (30, 32, 36), (120, 124, 130)
_BLUISH = np.array([0.9, 1.0, 1.2], np.float32)
_Font = Union[ImageFont.FreeTypeFont, ImageFont.ImageFont]
_Bytes = NDArray[np.uint8]


def three_panels(image: Shown, caption: str) -> Image.Image:
    """Return the picture; each panel shows the image at its own size, pixel for pixel.

    Args:
        image: what was rendered.
        caption: a line below the panels.
    """
    height, width = image.depth.shape
    near, far = range_of(image.depth)
    nothing = np.full_like(image.depth, np.inf)
    panels = {
        "colour": over_straight(image.color, image.depth, _squares(height, width), nothing),
        "depth, in scene units": _false_color(image.depth, near, far),
        "with a mesh between": _composite(image),
    }
    gap = min(max(height // 18, 11), 28)
    font, line = ImageFont.load_default(gap), round(1.5 * gap)
    picture = Image.new("RGB", (3 * width + 4 * gap, height + 4 * line + 3 * gap), _PAPER)
    draw = ImageDraw.Draw(picture)
    for index, (title, panel) in enumerate(panels.items()):
        left = gap + index * (width + gap)
        draw.text((left, gap), title, _INK, font)
        picture.paste(Image.fromarray(_bytes(panel)), (left, gap + line))
    below = 2 * gap + line + height
    picture.paste(_scale(width, 2 * line, near, far, font), (width + 2 * gap, below - gap // 2))
    draw.text((gap, below + 2 * line), caption, _FAINT, font)
    return picture


def _composite(image: Shown) -> Float32Array:
    """The image over the ring over a plain background [ACC-10]."""
    color, depth = ring_around(image)
    height, width = depth.shape
    shade = np.linspace(0.13, 0.30, height, dtype=np.float32)[:, None, None]
    background = np.broadcast_to(shade, (height, width, 3)) * _BLUISH
    background = np.where(np.isfinite(depth)[..., None], color, background)
    return over_straight(image.color, image.depth, background, depth)


def _false_color(depth: Float32Array, near: float, far: float) -> Float32Array:
    """Near is bright; where nothing is, the hatching of `_hatched`."""
    height, width = depth.shape
    surface = np.isfinite(depth)
    place = (np.where(surface, depth, near) - near) / (far - near)
    return np.where(surface[..., None], _ramp(place), _hatched(height, width))


def _ramp(place: NDArray[np.floating]) -> Float32Array:
    """Colours of places from 0 (near) to 1 (far), and of the nearer end beyond."""
    stops = np.linspace(0.0, 1.0, len(_RAMP))
    channels = [np.interp(place, stops, channel) for channel in _RAMP.T]
    return np.stack(channels, axis=-1).astype(np.float32)


def _hatched(height: int, width: int) -> Float32Array:
    rows, columns = np.indices((height, width))
    stripe = ((rows + columns) % 10 < 2)[..., None]
    return np.where(stripe, np.float32(0.72), np.float32(0.9)) * np.ones(3, np.float32)


def _squares(height: int, width: int) -> Float32Array:
    rows, columns = np.indices((height, width)) // 8
    dark = ((rows + columns) % 2 == 1)[..., None]
    return np.where(dark, np.float32(0.86), np.float32(0.94)) * np.ones(3, np.float32)


def _scale(width: int, height: int, near: float, far: float, font: _Font) -> Image.Image:
    """The legend of the depth panel: a bar with its ends and middle, and the empty pixels' sign."""
    scale = Image.new("RGB", (width, height), _PAPER)
    draw = ImageDraw.Draw(scale)
    bar, swatch, thick = round(0.72 * width), round(0.1 * width), height // 3
    ramp = _ramp(np.broadcast_to(np.linspace(0, 1, bar), (thick, bar)))
    scale.paste(Image.fromarray(_bytes(ramp)), (0, 0))
    scale.paste(Image.fromarray(_bytes(_hatched(thick, swatch))), (width - swatch, 0))
    text = thick + thick // 4
    for place, anchor in ((0.0, "la"), (0.5, "ma"), (1.0, "ra")):
        depth = f"{near + place * (far - near):.3g}"
        draw.text((place * bar, text), depth, _INK, font, anchor)
    draw.text((width, text), "empty", _INK, font, "ra")
    return scale


def _bytes(color: Float32Array) -> _Bytes:
    """Eight bits a channel, rounded: truncation would darken by half a step."""
    return np.rint(np.clip(color, 0.0, 1.0) * 255).astype(np.uint8)
