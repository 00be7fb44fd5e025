"""An image on the screen: its colour, its depth, its normals, or the viewer's geometry in it."""

from __future__ import annotations

from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray
from splatbus_client.lease import FrameLease, Image, OnDevice
from splatbus_wire.messages import FrameCamera, Placement
from splatbus_wire.semantics import Semantics

from splatbus_viewer.display import RAMP
from splatbus_viewer.window import MODES
from splatbus_viewer.window.drawing.ground import Ground, GroundDrawing, shader
from splatbus_viewer.window.drawing.uploading import Textures, Uploads

_PROBE = len(MODES)
_UNITS = ("color", "depth", "ground_color", "ground_depth")
"""Textures, as they are numbered."""
PROBED = 64, 36
"""Columns and rows of depths that are looked at for their range."""
Region = tuple[int, int, int, int]
"""Of a framebuffer, in pixels: left, bottom, width, height."""


class Taken(NamedTuple):
    """What is known of the image in the textures.

    Attributes:
        seq: its number.
        camera: what it was rendered with; None where a server of 1.0 does not say.
        semantics: how its numbers are meant.
        objects: where objects were in it, as far as they were moved.
        channels: which of `"color"` and `"depth"` it has.
        copied: bytes that were copied to show it.
    """

    seq: int
    camera: FrameCamera | None
    semantics: Semantics
    objects: tuple[Placement, ...]
    channels: frozenset[str]
    copied: int


class Picture:
    """Takes images as they come, and draws the last one.

    Attributes:
        size: width and height of the image in pixels; (0, 0) before the first.
        taken: what is known of the image; None before the first.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self.size = (0, 0)
        self.taken: Taken | None = None
        self._context = context
        self._drawings: dict[tuple[int, ...], tuple[moderngl.Program, moderngl.VertexArray]] = {}
        self._ground = GroundDrawing(context)
        self._textures: Textures | None = None
        self._is_on_device = False
        self._probe = context.framebuffer([context.texture(PROBED, 1, dtype="f4")])

    def take(self, lease: FrameLease) -> None:
        """Copy an image into the textures; what of the geometry was drawn stays."""
        image, is_on_device = _some(lease)
        height, width = image.shape[:2]
        now = (width, height), is_on_device
        if self._textures is None or now != (self.size, self._is_on_device):
            if self._textures is not None:
                self._textures.release()
            self._textures = _textures(self._context, width, height, is_on_device)
            self.size, self._is_on_device = now
        copied = self._textures.take(lease)
        camera = lease.camera if lease.has_camera else None
        self.taken = Taken(
            lease.seq, camera, lease.semantics, lease.objects, lease.channels, copied
        )

    def draw(
        self,
        target: moderngl.Framebuffer,
        region: Region,
        mode: str,
        camera: FrameCamera,
        ground: Ground,
        depths: tuple[float, float],
    ) -> None:
        """Draw the last image to a region, pixel for pixel where the region is of its size.

        Args:
            target: what is drawn to.
            region: which part of it.
            mode: one of `MODES`; those with depth show nothing where it was not subscribed to.
            camera: what it was rendered with, or what is taken for that.
            ground: the viewer's own geometry, for `"composite"`.
            depths: the nearest and the farthest of the false colours, in scene units.
        """
        if mode == "composite":
            for unit, texture in enumerate(self._ground.draw(camera, ground), 2):
                texture.use(unit)
        self._render(target, region, MODES.index(mode), camera, depths)

    def probe(self, camera: FrameCamera) -> NDArray[np.float32]:
        """Return (36, 64) float32: planar depths of pixels all over the image, 0 where none is."""
        self._render(self._probe, (0, 0, *PROBED), _PROBE, camera)
        columns, rows = PROBED
        return np.frombuffer(self._probe.read(components=1, dtype="f4"), np.float32).reshape(
            rows, columns
        )

    def _render(
        self,
        target: moderngl.Framebuffer,
        region: Region,
        mode: int,
        camera: FrameCamera,
        depths: tuple[float, float] = (0.0, 1.0),
    ) -> None:
        assert self.taken is not None
        assert self._textures is not None
        placed = 2 if region[2:] != self.size else int(region[:2] != (0, 0))
        program, triangle = self._drawing(mode, self.taken.semantics, placed)
        values: dict[str, Any] = {
            "empty": self.taken.semantics.depth_empty,
            "lens": (camera.fx, camera.fy, camera.cx, camera.cy),
            "corner": region[:2],
            "scale": (self.size[0] / region[2], self.size[1] / region[3]),
            "range": depths,
        }
        for name in values.keys() & set(program):  # the others were not needed
            program[name] = values[name]
        self._textures.color.use(0)
        self._textures.depth.use(1)
        target.use()
        self._context.viewport = region
        triangle.render(vertices=3)

    def _drawing(
        self, mode: int, semantics: Semantics, placed: int
    ) -> tuple[moderngl.Program, moderngl.VertexArray]:
        """The program of a mode, for images that mean the same."""
        is_straight, is_linear = semantics.alpha == "straight", semantics.color_space == "linear"
        key = mode, is_straight, is_linear, semantics.depth_kind == "ray_distance", placed
        if key not in self._drawings:
            told = zip(("MODE", "STRAIGHT", "LINEAR", "RAY", "PLACED"), map(int, key))
            head = ["#version 330 core", *(f"#define {name} {value}" for name, value in told)]
            text = "\n".join([*head, shader("picture.frag")])
            program = self._context.program(shader("picture.vert"), text)
            ramp = [tuple(channel / 255 for channel in stop) for stop in RAMP]
            constants: dict[str, Any] = {name: unit for unit, name in enumerate(_UNITS)}
            for name in ("ramp", *_UNITS):
                if name in program:
                    program[name] = {**constants, "ramp": ramp}[name]
            self._drawings[key] = program, self._context.vertex_array(program, [])
        return self._drawings[key]


def fitted(region: Region, size: tuple[int, int]) -> Region:
    """Return the largest part in the middle of a region that has an image's shape."""
    left, bottom, width, height = region
    scale = min(width / size[0], height / size[1])
    inner = max(round(scale * size[0]), 1), max(round(scale * size[1]), 1)
    return left + (width - inner[0]) // 2, bottom + (height - inner[1]) // 2, *inner


def _some(lease: FrameLease) -> tuple[OnDevice | Image, bool]:
    """One of its images, and whether it lies on a GPU."""
    is_color = "color" in lease.channels
    try:
        return (lease.color_on_device if is_color else lease.depth_on_device), True
    except RuntimeError:
        return (lease.color if is_color else lease.depth), False


def _textures(context: moderngl.Context, width: int, height: int, is_on_device: bool) -> Textures:
    if is_on_device:
        from splatbus_viewer.window.drawing.interop import Interop  # it needs cuda-bindings

        return Interop(context, width, height)
    return Uploads(context, width, height)
