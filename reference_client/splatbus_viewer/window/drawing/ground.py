"""The viewer's own geometry, a grid and a ring: its colour and planar depth for one camera."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray
from splatbus_wire.messages import FrameCamera, Placement
from splatbus_wire.poses import IDENTITY, as_array
from splatbus_wire.relative import object_to_camera

Float32Array = NDArray[np.float32]
GRID_LINES = 20
"""To either side of the middle, a unit apart."""
_FINE, _AXIS_X, _AXIS_Z = (0.34, 0.36, 0.40), (0.75, 0.27, 0.25), (0.27, 0.46, 0.80)
_RING = (0.98, 0.62, 0.12)
THICKNESS = 0.14
"""Of the ring, to either side of its circle, in parts of its radius."""
_AROUND, _ACROSS = 96, 32
_NEAREST, _FARTHEST = 0.01, 1e4


class Ground(NamedTuple):
    """What there is.

    Attributes:
        grid: height of the grid on the world's y axis, which points down; None for no grid.
        ring: where the ring is, and its radius as its scale.
    """

    grid: float | None = 1.0
    ring: Placement | None = None


class GroundDrawing:
    """Colour, RGBA8 in sRGB, and planar depth, float32 and 0 where nothing is, of an image's size.

    It is drawn again only where the camera, the size or the geometry is another.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = context.program(shader("ground.vert"), shader("ground.frag"))
        self._grid = self._vertices(_grid())
        self._ring = self._vertices(_torus())
        self._frame: moderngl.Framebuffer | None = None
        self._drawn: tuple[FrameCamera, Ground] | None = None

    def draw(self, camera: FrameCamera, ground: Ground) -> tuple[moderngl.Texture, ...]:
        """Return the textures of colour and depth, as they are seen by a camera."""
        camera = camera._replace(tag=None)
        frame = self._sized(camera.width, camera.height)
        if (camera, ground) != self._drawn:
            self._drawn = camera, ground
            self._program["projection"] = _columns(projection(camera))
            frame.use()
            frame.clear()
            self._context.enable(moderngl.DEPTH_TEST)
            if ground.grid is not None:
                at = Placement("", IDENTITY._replace(position=(0.0, ground.grid, 0.0)))
                self._render(self._grid, camera, at, moderngl.LINES)
            if ground.ring is not None:
                self._render(self._ring, camera, ground.ring, moderngl.TRIANGLES)
            self._context.disable(moderngl.DEPTH_TEST)
        color, depth = frame.color_attachments
        assert isinstance(color, moderngl.Texture)
        assert isinstance(depth, moderngl.Texture)
        return color, depth

    def _render(
        self, vertices: moderngl.VertexArray, camera: FrameCamera, at: Placement, kind: int
    ) -> None:
        matrix = as_array(object_to_camera(camera.pose, at.pose))
        matrix[:3, :3] *= at.scale
        self._program["to_camera"] = _columns(matrix)
        vertices.render(kind)

    def _sized(self, width: int, height: int) -> moderngl.Framebuffer:
        if self._frame is None or self._frame.size != (width, height):
            if self._frame is not None:
                for each in (*self._frame.color_attachments, self._frame.depth_attachment):
                    if each is not None:
                        each.release()
                self._frame.release()
            size = width, height
            planes = (self._context.texture(size, 4), self._context.texture(size, 1, dtype="f4"))
            for plane in planes:
                plane.filter = moderngl.NEAREST, moderngl.NEAREST
            depth = self._context.depth_renderbuffer(size)
            self._frame = self._context.framebuffer(planes, depth)
            self._drawn = None
        return self._frame

    def _vertices(self, numbers: Float32Array) -> moderngl.VertexArray:
        buffer = self._context.buffer(numbers.tobytes())
        content = [(buffer, "3f 3f 3f", "position", "normal", "tint")]
        return self._context.vertex_array(self._program, content)


def projection(camera: FrameCamera) -> NDArray[np.float64]:
    """Return (4, 4): from camera axes to OpenGL's clip space, z being forward and y down."""
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    w, h, near, far = camera.width, camera.height, _NEAREST, _FARTHEST
    return np.array(
        [
            [2 * fx / w, 0, 2 * cx / w - 1, 0],
            [0, -2 * fy / h, 1 - 2 * cy / h, 0],
            [0, 0, (far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, 1, 0],
        ]
    )


def shader(name: str) -> str:
    """Return the text of a shader of this folder."""
    return Path(__file__).with_name(name).read_text("utf-8")


def _columns(matrix: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(matrix.T.ravel().tolist())


def _grid() -> Float32Array:
    """Lines on y = 0, two vertices each: position, no normal, tint."""
    ends = (-GRID_LINES, GRID_LINES)
    rows = []
    for place in range(-GRID_LINES, GRID_LINES + 1):
        x_tint, z_tint = (_AXIS_X, _AXIS_Z) if place == 0 else (_FINE, _FINE)
        rows += [((end, 0, place), (0, 0, 0), x_tint) for end in ends]
        rows += [((place, 0, end), (0, 0, 0), z_tint) for end in ends]
    return np.array(rows, np.float32).reshape(-1, 9)


def _torus() -> Float32Array:
    """Triangles of a ring of radius 1 about the y axis: position, normal, tint."""
    around = 2 * np.pi * np.arange(_AROUND + 1) / _AROUND
    across = 2 * np.pi * np.arange(_ACROSS + 1) / _ACROSS

    def vertex(i: int, j: int) -> Float32Array:
        outward = np.array([np.cos(around[i]), 0.0, np.sin(around[i])])
        normal = np.cos(across[j]) * outward + np.sin(across[j]) * np.array([0.0, 1.0, 0.0])
        tint = np.array(_RING) * (1.0 if (8 * i // _AROUND) % 2 else 0.72)
        return np.concatenate([outward + THICKNESS * normal, normal, tint]).astype(np.float32)

    corners = ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1))
    places = itertools.product(range(_AROUND), range(_ACROSS), corners)
    return np.stack([vertex(i + a, j + b) for i, j, (a, b) in places])
