"""The arithmetic of the engines' shaders, run as C++, beside what the viewer makes of an image."""

import ctypes
import math
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from splatbus_server import Semantics
from splatbus_viewer.display import composed
from splatbus_wire.messages import FrameCamera
from splatbus_wire.poses import Pose

from tests.engines.stage import HEIGHT, WIDTH

ALPHAS, SPACES = ("straight", "premultiplied"), ("srgb", "linear")
DEPTHS = ("planar_z", "ray_distance")
Screen = Callable[..., None]


def compiled(folder: Path, text: Path, named: str) -> Screen:
    """The shader's text, as C++ whose compiler takes no number for infinite, like those of GPUs.

    `named` is how it calls a parameter `it`.
    """
    if not shutil.which("c++"):
        pytest.skip("c++ is not installed")
    source, built = Path(__file__).with_name("shader.cpp"), folder / "shader.so"
    line = ["c++", "-O2", "-ffast-math", "-fPIC", "-Wall", "-Wextra", "-Werror", "-c"]
    line += [f'-DTEXT="{text}"', f"-DNAMED(it)={named}", str(source), "-o", f"{built}.o"]
    # Linked by itself: with -ffast-math it would flush this process's subnormal numbers to zero.
    for each in (line, ["c++", "-shared", f"{built}.o", "-o", str(built)]):
        done = subprocess.run(each, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
    function: Screen = ctypes.CDLL(str(built)).screen
    return function


def check_mixes(
    screen: Screen, semantics: Semantics, here: str, unit: float, *, upside_down: bool
) -> tuple[Any, Any]:
    """Depths of all kinds; the lens off the middle, so that no row or column is any other's.

    `here` is the space of the engine's own colours; `upside_down` says that its rows go up. What
    became of the screen's alpha, and what it was.
    """
    draw, space = np.random.default_rng(7), semantics.color_space
    color = draw.random((HEIGHT, WIDTH, 4), np.float32)
    color[draw.random((HEIGHT, WIDTH)) < 0.2, 3] = 0
    depth = draw.uniform(1, 3, (HEIGHT, WIDTH)).astype(np.float32)
    for odd in (math.inf, -math.inf, math.nan, 0.0, -1.0, semantics.depth_empty):
        depth[draw.random((HEIGHT, WIDTH)) < 0.05] = odd
    own = draw.random((HEIGHT, WIDTH, 4), np.float32)
    own_depth = draw.uniform(1, 3, (HEIGHT, WIDTH)).astype(np.float32)
    own_depth[draw.random((HEIGHT, WIDTH)) < 0.3] = math.inf
    lens = (40.0, 30.0, 20.0, 10.0)
    camera = FrameCamera(Pose((0, 0, 0), (0, 0, 0, 1)), *lens, WIDTH, HEIGHT, 0.1, 100.0)
    behind = brought(own[..., :3], here, space).astype(np.float32)
    is_ray, is_premultiplied = semantics.depth_kind == "ray_distance", semantics.alpha == ALPHAS[1]
    meaning = (is_ray, is_premultiplied, space == "srgb", semantics.depth_empty)

    def shaded(compare: bool, far: Any) -> Any:
        four = [lens, (WIDTH, HEIGHT, 0, 0), meaning, (unit, compare, here == "srgb", 0)]
        turn = slice(None, None, -1 if upside_down else None)
        arrays = (color[::-1], depth[::-1], np.array(four), own[turn], far[turn])
        kept = [np.ascontiguousarray(each, np.float32) for each in arrays]
        out = np.empty_like(own)
        image, depths, numbers, *rest, to = (
            each.ctypes.data_as(ctypes.c_void_p) for each in (*kept, out)
        )
        screen(image, depths, numbers, WIDTH, HEIGHT, *rest, to)
        return out[turn]

    mixed = composed(color, depth, camera, semantics, behind, own_depth)
    unchanged = (mixed == behind).all(axis=-1, keepdims=True)
    assert 0.1 < unchanged.mean() < 0.9
    expected = np.where(unchanged, own[..., :3], brought(mixed, space, here))
    got = shaded(True, own_depth * np.float32(unit))
    np.testing.assert_allclose(got[..., :3], expected, rtol=2e-6, atol=2e-6)
    alphas = got[..., 3], own[..., 3]

    covered = np.full((HEIGHT, WIDTH), 1, np.float32)
    over = composed(color, covered, camera, semantics, behind, covered + 9)
    expected = np.where(color[..., 3:] > 0, brought(over, space, here), own[..., :3])
    got = shaded(False, own_depth)  # no depth is compared
    np.testing.assert_allclose(got[..., :3], expected, rtol=2e-6, atol=2e-6)
    return alphas


def brought(color: Any, space: str, to: str) -> Any:
    """From one space into the other (IEC 61966-2-1)."""
    if space == to:
        return color
    if to == "linear":
        return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
    encoded = 1.055 * np.maximum(color, 1e-9) ** (1 / 2.4) - 0.055
    return np.where(color <= 0.0031308, 12.92 * color, encoded)
