"""What can be said of drawing on a GPU where there is none: why not, and matrices."""

from __future__ import annotations

import sys
import threading
import types
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from splatbus_client import Session, connect
from splatbus_server import serve
from splatbus_server.api import Bus
from splatbus_server.view import Intrinsics, View
from splatbus_splats.drawing import gpu
from splatbus_splats.serving import SEMANTICS, render_until
from splatbus_wire.messages import Placement
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import quaternion_from_matrix, rotation_matrix

from tests.gpu.looking import looked
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
    assert "is not installed" in gpu.NEEDS[missing]


@pytest.mark.parametrize("module", ["nothing", "nothing.at.all", "splatbus_splats.nothing"])
def test_what_is_not_there_is_not_installed(module: str) -> None:
    assert gpu._is_installed("splatbus_splats.drawing.gpu")
    assert not gpu._is_installed(module)


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


class Painter:
    """Stands for what draws: each scene has a shade of its own."""

    milliseconds = 0.0

    def show(
        self,
        bus: Bus,
        view: View,
        objects: Mapping[str, Any],
        time: float | None,
        *,
        is_moving: bool,
    ) -> bool:
        shape = view.height, view.width
        shade = np.full((*shape, 3), objects["default"], np.float32)
        bus.publish(view, shade, np.full(shape, 2.0, np.float32), time=time)
        return False


class Shades:
    """A scene of two seconds, each of another shade."""

    loop = 2.0

    def __init__(self, time_range: tuple[float, float] | None) -> None:
        self.time_range = time_range

    def moment(self, time: float | None) -> int:
        return int(time or 0.0)

    def lasts(self, playing: float) -> float:
        return 1.0 - playing % 1.0

    def at(self, time: float | None) -> Mapping[str, Any]:
        return {"default": (0.25, 0.75)[self.moment(time)]}


@contextmanager
def shown(scene: Any) -> Iterator[Session]:
    stop = threading.Event()
    options = {"time_range": scene.time_range, "semantics": SEMANTICS}
    with serve(64, 48, ipc_port=0, message_port=0, **options) as bus:
        thread = threading.Thread(target=render_until, args=(stop, bus, scene, Painter()))
        thread.start()
        try:
            with connect("127.0.0.1", *bus.address[1:]) as session:
                yield session
        finally:
            stop.set()
            thread.join()


def test_a_scene_in_time_plays_by_itself_until_a_client_sets_the_time() -> None:
    with shown(Shades((0.0, 1.5))) as session:
        shades = set()
        while len(shades) < 2:
            with session.next_frame(60.0) as frame:
                assert 0.0 <= frame.time <= 1.5
                assert frame.color[0, 0, 0] == (0.25, 0.75)[int(frame.time)]
                shades.add(frame.color[0, 0, 0])
        for number, seconds in enumerate((1.25, 0.25, 1.0)):
            picture = looked(session, Pose((number, 0, 0), (0, 0, 0, 1)), seconds)
            assert picture.color[0, 0].tolist() == [(0.25, 0.75)[int(seconds)]] * 3 + [1.0]
            assert picture.depth[0, 0] == 2.0
            picture = looked(session, Pose((number, 1, 0), (0, 0, 0, 1)))
            assert picture.time == seconds, "it plays on although a client has set the time"
        with pytest.raises(TimeoutError):
            session.next_frame(1.2)  # in which it would have become another one


def test_a_scene_without_time_is_drawn_for_each_camera() -> None:
    with shown(Shades(None)) as session:
        for number in range(3):
            picture = looked(session, Pose((number, 0, 0), (0, 0, 0, 1)))
            assert picture.time == 0.0
            assert picture.color[0, 0, 0] == 0.25


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
