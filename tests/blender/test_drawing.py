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
        "rays": (2 * depth * np.linalg.norm(rays(CAMERA), axis=-1)).astype(np.float32),
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


@pytest.mark.parametrize("kind", ["plain", "other"])
def test_what_is_drawn_is_what_our_own_compositor_makes(kind: str, drawn: dict[str, Any]) -> None:
    given = images()
    color, depth, meshes = given["color"], given["depth"], given["meshes"]
    if kind == "other":  # whose colours the shader encodes, by a power of its GPU
        color = np.concatenate([srgb(color[..., :3]), color[..., 3:]], axis=-1)
    expected = composed(color, depth, CAMERA, Semantics(), meshes, given["meshes_depth"])
    got = drawn[f"{kind} COMPOSITE"]
    hidden = (expected == meshes).all(axis=-1)
    assert 0 < hidden.sum() < hidden.size
    np.testing.assert_array_equal(got[hidden][..., :3], meshes[hidden])
    np.testing.assert_allclose(got[..., :3], expected, rtol=2e-5 if kind == "other" else 4e-7)

    got = drawn[f"{kind} COLOR"]
    np.testing.assert_allclose(got[..., :3], color[..., :3] * color[..., 3:], rtol=2e-5)
    assert (got[..., 3] == 1).all()

    near = 0.5 if kind == "plain" else 0.25  # the clipping planes are in units of the scene, too
    surface = (color[..., 3] > 0) & np.isfinite(depth)
    grey = np.where(surface, np.log(depth / near) / np.log(200), 0)
    expected = np.repeat(np.clip(grey, 0, 1)[..., None], 3, axis=-1)
    np.testing.assert_allclose(drawn[f"{kind} DEPTH"][..., :3], expected, atol=1e-5)


def test_a_viewport_wants_what_it_shows(tmp_path: Path) -> None:
    assert ran("viewport.py", tmp_path).count("check_") == 4
