"""What `gl_viewer` of the C++ client draws, beside what the Python viewer composes."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from splatbus_server import Semantics, View
from splatbus_viewer.display import composed, srgb
from splatbus_wire.messages import FrameCamera

from tests.engines.built import CPP, compiled_cpp
from tests.engines.stage import HEIGHT, WIDTH, serving

WALL_DEPTH = 5.0
SEMANTICS = (
    Semantics(alpha="straight", color_space="srgb", depth_empty=7.5),
    Semantics(alpha="premultiplied", color_space="linear", depth_kind="ray_distance"),
)


def gl_viewer() -> Path:
    """The program; skips where its headers or libraries are missing."""
    if not shutil.which("g++"):
        pytest.skip("g++ is not installed")
    for header in ("EGL/egl.h", "GL/gl.h"):
        line = ["g++", "-E", "-x", "c++", "-include", header, "/dev/null"]
        if subprocess.run(line, capture_output=True).returncode:
            pytest.skip(f"{header} is not installed (Debian: libegl-dev libopengl-dev libgl-dev)")
    libraries = ("-lEGL", "-lOpenGL")
    source = CPP / "programs" / "gl_viewer.cpp"
    return compiled_cpp(source, options=("-O2",), libraries=libraries)


def check_picture(
    picture: Path,
    semantics: Semantics,
    published: Callable[[Any, Any], tuple[Any, Any]],
    source: str,
    **settings: Any,
) -> None:
    """Draw an image of colours and depths of all kinds, to this file; no channel is off by two.

    `published` makes of colour and depth what the server is given; `source` is where the program
    has to say that it read it.
    """
    draw = np.random.default_rng(3)
    color = draw.random((HEIGHT, WIDTH, 4), np.float32)
    color[draw.random((HEIGHT, WIDTH)) < 0.2, 3] = 0
    if semantics.alpha == "premultiplied":
        color[..., :3] *= color[..., 3:]
    depth = draw.uniform(4, 6, (HEIGHT, WIDTH)).astype(np.float32)
    for odd in (np.inf, 0.0, -1.0, semantics.depth_empty):
        depth[draw.random((HEIGHT, WIDTH)) < 0.05] = odd
    cameras: list[FrameCamera] = []

    def render(view: View) -> tuple[Any, Any]:
        lens = view.intrinsics
        four = lens.fx, lens.fy, lens.cx, lens.cy
        cameras.append(FrameCamera(view.poses.camera, *four, WIDTH, HEIGHT, 0.1, 100.0))
        return published(color, depth)

    with serving(render, on_and_on=True, semantics=semantics, **settings) as where:
        done = subprocess.run(
            [gl_viewer(), picture, "3"], env=where, capture_output=True, text=True, timeout=120
        )
    assert done.returncode == 0, done.stderr
    assert f"3 images from {source}, " in done.stdout
    rows, columns = np.indices((HEIGHT, WIDTH))
    # Squares are counted from the bottom row, as OpenGL has it.
    is_light = ((columns >> 3) + ((HEIGHT - 1 - rows) >> 3)) % 2 == 0
    wall = np.repeat(np.where(is_light, 0.5, 0.25)[..., None], 3, axis=-1).astype(np.float32)
    far = np.full((HEIGHT, WIDTH), WALL_DEPTH, np.float32)
    mixed = composed(color, depth, cameras[-1], semantics, wall, far)
    changed = (mixed != wall).any(axis=-1).mean()
    assert 0.1 < changed < 0.9
    if semantics.color_space == "linear":
        mixed = srgb(mixed)
    shown = np.asarray(Image.open(picture), np.int16)
    assert np.abs(shown - np.rint(255 * mixed)).max() <= 1
