"""What is drawn in a viewport, on Blender's GPU module, compared with our own compositor."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from splatbus_server import Semantics
from splatbus_viewer.display import composed, rays, srgb
from splatbus_wire.message_types import FrameCamera
from splatbus_wire.poses import IDENTITY

from tests.blender.running import ran

WIDTH, HEIGHT = 40, 24
LENS = (30.0, 35.0, 18.0, 10.0)
CAMERA = FrameCamera(IDENTITY, LENS[0], LENS[1], LENS[2], LENS[3], WIDTH, HEIGHT, 0.5, 100.0)
STRAIGHT = Semantics()


def images() -> dict[str, Any]:
    noise = np.random.default_rng(5)
    color = noise.random((HEIGHT, WIDTH, 4), np.float32)
    color[::3, :, 3] = 1
    color[1::6, :, 3] = 0
    depth = (2 + noise.integers(0, 40, (HEIGHT, WIDTH)) / 4).astype(np.float32)
    depth[::5, ::2] = np.inf
    # In between, so that what a depth of 24 bits keeps does not decide.
    meshes_depth = (2.125 + noise.integers(0, 40, (HEIGHT, WIDTH)) / 4).astype(np.float32)
    premultiplied = color.copy()
    premultiplied[..., :3] *= color[..., 3:]
    return {
        "color": color,
        "premultiplied": premultiplied,
        "depth": depth,
        "double": depth * 2,
        "rays": (depth * np.linalg.norm(rays(CAMERA), axis=-1)).astype(np.float32),
        "meshes": noise.random((HEIGHT, WIDTH, 3), np.float32),
        "meshes_depth": meshes_depth,
        "lens": np.array(LENS),
    }


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    home = tmp_path_factory.mktemp("drawn")
    np.savez(home / "given.npz", **images())
    ran("draw.py", home, str(home / "given.npz"), str(home / "found.npz"))
    return dict(np.load(home / "found.npz"))


@pytest.mark.parametrize("kind", ["straight", "premultiplied", "linear", "rays", "unit"])
def test_a_composite_is_that_of_our_own_compositor(kind: str, drawn: dict[str, Any]) -> None:
    given = images()
    color, depth, meshes = given["color"], given["depth"], given["meshes"]
    if kind == "linear":
        color = np.concatenate([srgb(color[..., :3]), color[..., 3:]], axis=-1)
    expected = composed(color, depth, CAMERA, STRAIGHT, meshes, given["meshes_depth"])
    got = drawn[f"{kind} COMPOSITE"]
    hidden = (expected == meshes).all(axis=-1)
    assert 0 < hidden.sum() < hidden.size
    np.testing.assert_array_equal(got[hidden][..., :3], meshes[hidden])
    if kind == "linear":  # whose colours the shader encodes, by a power of its GPU
        np.testing.assert_allclose(got[..., :3], expected, rtol=2e-5)
    else:
        np.testing.assert_array_max_ulp(got[..., :3], expected, maxulp=3)


@pytest.mark.parametrize("kind", ["straight", "premultiplied", "rays"])
def test_the_colour_alone_covers_all(kind: str, drawn: dict[str, Any]) -> None:
    got = drawn[f"{kind} COLOR"]
    np.testing.assert_allclose(got[..., :3], images()["premultiplied"][..., :3], rtol=1e-6)
    assert (got[..., 3] == 1).all()


@pytest.mark.parametrize("kind", ["straight", "rays", "unit"])
def test_the_depth_alone_goes_from_black_to_white(kind: str, drawn: dict[str, Any]) -> None:
    given = images()
    depth = np.where(given["color"][..., 3] > 0, given["depth"], np.inf)
    grey = np.log(depth / 0.5) / np.log(100 / 0.5)
    if kind == "unit":  # the clipping planes are in units of the scene, too
        grey = np.log(depth / 0.25) / np.log(50 / 0.25)
    expected = np.where(np.isfinite(depth), grey, 0)
    for channel in range(3):
        np.testing.assert_allclose(drawn[f"{kind} DEPTH"][..., channel], expected, atol=1e-5)


def test_a_viewport_wants_what_it_shows(tmp_path: Path) -> None:
    assert ran("viewport.py", tmp_path).count("check_") == 4
