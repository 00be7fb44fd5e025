"""Draws on a GPU by gsplat, where that is installed: what `renderer` draws on the processor.

By the same definition, but for what gsplat has of its own, which `SPLATS.md` tells.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

from splatbus_server.api import Bus
from splatbus_server.view import View
from splatbus_wire.rotations import quaternion_from_matrix

from splatbus_splats.drawing.definition import LOW_PASS, depths
from splatbus_splats.gaussians import Gaussians

MOST_KEPT = 4 << 30
"""Bytes on the GPU of Gaussians that were drawn before, some 18 million of degree 3."""
NEEDS = {
    "torch": "PyTorch is not installed",
    "gsplat": "gsplat is not installed: pip install gsplat",
    "cuda.bindings": "cuda-bindings is not installed: pip install 'splatbus-protocol[cuda]'",
}


class Drawn(NamedTuple):
    """Pixels on the GPU, float32, the top row first."""

    color: Any
    """(height, width, 3), premultiplied."""
    alpha: Any
    """(height, width, 1)"""
    inverse: Any
    """(height, width), Σ(1/zᵢ)αᵢTᵢ."""


class _Kept(NamedTuple):
    """One object on the GPU, float32, as gsplat takes it."""

    means: Any
    quaternions: Any
    """(N, 4), w, x, y, z."""
    scales: Any
    opacities: Any
    coefficients: Any


def why_not() -> str | None:
    """Why this machine cannot draw so, in a sentence; None if it can.

    One Gaussian is drawn to see, for which gsplat compiles itself if it has not: a minute or more,
    the first time on a machine.
    """
    for module, reason in NEEDS.items():
        if not _is_installed(module):
            return reason
    if not import_module("torch").cuda.is_available():
        return "PyTorch sees no NVIDIA GPU here"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what compilers warn of is no reason
            _try()
    except Exception as error:  # a compiler's, a driver's, an older gsplat's: whatever it is
        lines = [type(error).__name__, *str(error).splitlines()]
        return f"gsplat cannot draw here: {': '.join(lines[:2])}"
    return None


def _is_installed(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ImportError:  # nor is its package
        return False


def _try() -> None:
    torch, gsplat = import_module("torch"), import_module("gsplat")
    one = torch.ones((1, 3), device="cuda")
    K = torch.eye(3, device="cuda")
    spin = torch.ones((1, 4), device="cuda")
    camera = torch.eye(4, device="cuda")
    gsplat.rasterization(one, spin, one, one[:, 0], one, camera[None], K[None], 1, 1)


class Renderer:
    """Draws what views ask for, on the current device; what was drawn before stays there.

    Raises:
        ImportError: PyTorch or gsplat is missing; see `why_not`.
    """

    def __init__(self) -> None:
        self._torch, self._gsplat = import_module("torch"), import_module("gsplat")
        self._identity = self._torch.eye(4, device="cuda")[None]
        self._kept: WeakKeyDictionary[Gaussians, _Kept] = WeakKeyDictionary()
        event = self._torch.cuda.Event
        self._first, self._last = event(enable_timing=True), event(enable_timing=True)
        self._first.record()
        self._last.record()
        self.milliseconds = 0.0

    def show(
        self,
        bus: Bus,
        view: View,
        objects: Mapping[str, Gaussians],
        time: float | None,
        *,
        is_moving: bool,
    ) -> bool:
        """Draws and publishes a view, see `serving.Drawing`; the GPU is not waited for.

        Always with all pixels, and without a copy through the host, where the bus is one of
        `memory="cuda_ipc"`.
        """
        del is_moving
        is_timed = self._last.query()  # else the GPU draws yet
        if is_timed:
            self.milliseconds = self._first.elapsed_time(self._last)
            self._first.record()
        color, alpha, inverse = self(view, objects)
        bus.publish(view, color, inverse, alpha=alpha, depth_kind="inverse", time=time)
        if is_timed:
            self._last.record()
        return False

    def __call__(self, view: View, objects: Mapping[str, Gaussians]) -> Drawn:
        """The picture of a view, by the ids of its objects.

        Raises:
            KeyError: the view has no such object.
            torch.OutOfMemoryError: the GPU is full.
        """
        torch, (width, height) = self._torch, (view.width, view.height)
        parts = [self._seen(view.of(name), each) for name, each in objects.items() if len(each)]
        if not parts:
            empty = torch.zeros((height, width, 5), device="cuda")
            return Drawn(empty[..., :3], empty[..., 3:4], empty[..., 4])
        seen = parts[0] if len(parts) == 1 else [torch.cat(each) for each in zip(*parts)]
        fx, fy, cx, cy = view.intrinsics[:4]
        near, far = depths(view.intrinsics)
        with torch.no_grad():
            image, alpha, _ = self._gsplat.rasterization(
                *seen,
                self._identity,
                torch.tensor([[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]], device="cuda"),
                width,
                height,
                near_plane=near,
                far_plane=far,
                eps2d=LOW_PASS,
                packed=False,
            )
        return Drawn(image[0, ..., :3], alpha[0], image[0, ..., 3])

    def _seen(self, view: View, gaussians: Gaussians) -> tuple[Any, ...]:
        """One object in the camera's axes and the world's units, as `rasterization` takes it.

        Beside its colour each Gaussian has 1/z as a fourth channel. Products are in double
        precision, since PyTorch may be told to make those in single precision with 10 bits.
        """
        torch, kept = self._torch, self._on_gpu(gaussians)
        with torch.no_grad():
            numbers = (*view.eye(), *view.object_to_camera[:3, :3].flat, *_turning(view))
            there = torch.tensor(numbers, dtype=torch.float64, device="cuda")  # at once: it waits
            eye, turn, left = there[:3], there[3:12].view(3, 3), there[12:].view(4, 4)
            offsets = kept.means.double() - eye
            means = (offsets @ turn.T).float()
            colors = self._gsplat.spherical_harmonics(
                gaussians.degree, offsets.float(), kept.coefficients
            )
            return (
                means,
                (kept.quaternions.double() @ left.T).float(),
                kept.scales * view.placement.scale,
                kept.opacities,
                torch.cat(((colors + 0.5).clamp(min=0.0), 1.0 / means[:, 2:]), dim=1),
            )

    def _on_gpu(self, gaussians: Gaussians) -> _Kept:
        """The object's tensors, for which those that were drawn longest ago make room."""
        kept = self._kept.pop(gaussians, None)
        if kept is None:
            arrays = (
                gaussians.means,
                gaussians.rotations[:, [3, 0, 1, 2]],
                gaussians.scales,
                gaussians.opacities,
                gaussians.coefficients.astype("float32", copy=False),
            )
            self._make_room(_bytes(arrays))
            kept = _Kept(*(self._torch.tensor(each, device="cuda") for each in arrays))
        self._kept[gaussians] = kept
        return kept

    def _make_room(self, size: int) -> None:
        for each in list(self._kept):
            if size + sum(map(_bytes, self._kept.values())) <= MOST_KEPT:
                break
            del self._kept[each]


def _bytes(arrays: Sequence[Any]) -> int:
    return sum(each.nbytes for each in arrays)


def _turning(view: View) -> tuple[float, ...]:
    """The matrix by which a quaternion w, x, y, z is turned into the camera's axes, (4, 4)."""
    rows = (view.object_to_camera[:3, :3] / view.placement.scale).tolist()
    (a, b, c), (d, e, f), (g, h, i) = rows
    x, y, z, w = quaternion_from_matrix((a, b, c, d, e, f, g, h, i))
    return (w, -x, -y, -z, x, w, -z, y, y, z, w, -x, z, -y, x, w)
