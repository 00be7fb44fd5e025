"""What can be said of drawing on a GPU where there is none: why not, and matrices."""

from __future__ import annotations

import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from splatbus_server.view import Intrinsics
from splatbus_splats.drawing import gpu
from splatbus_wire.messages import Placement
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import quaternion_from_matrix, rotation_matrix

from tests.splats.shots import view_of

EXAMPLES = Path(__file__).parents[2] / "reference_server" / "examples"
RANDOM = np.random.default_rng(3)


def unit() -> tuple[float, ...]:
    q = RANDOM.normal(size=4)
    return tuple(q / np.linalg.norm(q))


VIEW = view_of(
    Pose((0.3, -0.2, -5.0), (0.1, -0.2, 0.05, 0.9)),
    Placement("default", Pose((1.0, 2.0, 3.0), (0.5, 0.1, -0.2, 0.7)), 1.7),
    size=(640, 480),
    intrinsics=Intrinsics(300.0, 500.0, 71.3, 458.9, 0.5, 50.0),
)


@pytest.mark.parametrize("missing", gpu.NEEDS)
def test_what_is_missing_is_named(missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpu, "_is_installed", lambda module: module != missing)
    assert gpu.why_not() == gpu.NEEDS[missing]


@pytest.mark.parametrize(
    ("there", "error", "reason"),
    [
        (False, None, "PyTorch sees no NVIDIA GPU here"),
        (True, RuntimeError("no nvcc\nand more"), "gsplat cannot draw here: RuntimeError: no nvcc"),
        (True, AssertionError(), "gsplat cannot draw here: AssertionError"),
        (True, None, None),
    ],
)
def test_what_does_not_work_is_told(
    there: bool, error: Exception | None, reason: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def attempt() -> None:
        if error:
            raise error

    torch: Any = types.ModuleType("torch")
    torch.cuda = types.SimpleNamespace(is_available=lambda: there)
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.setattr(gpu, "_is_installed", lambda module: True)
    monkeypatch.setattr(gpu, "_try", attempt)
    assert gpu.why_not() == reason


def test_quaternions_turn_into_the_cameras_axes() -> None:
    x, y, z, w = own = unit()
    w, x, y, z = np.array(gpu._turning(VIEW)).reshape(4, 4) @ (w, x, y, z)
    turn = VIEW.object_to_camera[:3, :3] / VIEW.placement.scale
    right = quaternion_from_matrix(tuple((turn @ np.reshape(rotation_matrix(own), (3, 3))).flat))
    found = np.array((x, y, z, w)) / np.linalg.norm((x, y, z, w))
    np.testing.assert_allclose(abs(found @ right), 1.0, atol=1e-12)


@pytest.fixture
def inria(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The example, with NumPy for PyTorch and nothing for the code that draws."""
    torch: Any = types.ModuleType("torch")
    torch.float32 = np.float32
    torch.tensor = lambda array, dtype, device: np.array(array, dtype)
    torch.Tensor = np.ndarray
    for name, holds in {
        "gaussian_renderer": "render",
        "scene.gaussian_model": "GaussianModel",
    }.items():
        module = types.ModuleType(name)
        setattr(module, holds, None)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setitem(sys.modules, "scene", types.ModuleType("scene"))
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.syspath_prepend(str(EXAMPLES))
    monkeypatch.delitem(sys.modules, "inria", raising=False)
    import inria

    yield inria
    sys.modules.pop("inria")


def test_a_camera_of_the_3dgs_code_sees_what_the_view_does(inria: Any) -> None:
    camera = inria.Camera(VIEW)
    points = np.concatenate((RANDOM.normal(size=(20, 3)), np.ones((20, 1))), axis=1)
    fx, fy, cx, cy, near, far = VIEW.intrinsics
    x, y, z, _ = VIEW.object_to_camera @ points.T
    seen = points @ camera.world_view_transform
    np.testing.assert_allclose(seen.T[:3], (x, y, z), rtol=1e-5, atol=1e-5)
    u, v, depth, w = (points @ camera.full_proj_transform).T
    np.testing.assert_allclose((u / w + 1) / 2 * 640, fx * x / z + cx, rtol=1e-5)
    np.testing.assert_allclose((v / w + 1) / 2 * 480, fy * y / z + cy, rtol=1e-5)
    np.testing.assert_allclose(w, z, rtol=1e-5)
    np.testing.assert_allclose(depth / w, (1 - near / z) / (1 - near / far), rtol=1e-4)
    np.testing.assert_allclose(camera.camera_center, VIEW.eye(), rtol=1e-6)
    assert np.tan(camera.FoVx / 2) == pytest.approx(640 / 2 / fx)
    assert np.tan(camera.FoVy / 2) == pytest.approx(480 / 2 / fy)
