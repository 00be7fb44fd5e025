"""A trained scene, drawn by the code of the 3DGS paper: `python inria.py point_cloud.ply`.

To be run where that code finds itself: `PYTHONPATH=gaussian-splatting python inria.py …`.
"""

from __future__ import annotations

import math
import sys
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import splatbus_server as splatbus
import torch
from gaussian_renderer import render
from numpy.typing import NDArray
from scene.gaussian_model import GaussianModel

SIZE = (1280, 720)
DEGREE = 3
MEANING = splatbus.Semantics(alpha="premultiplied", depth_estimator="harmonic")
PIPE = SimpleNamespace(
    debug=False, compute_cov3D_python=False, convert_SHs_python=False, antialiasing=False
)


class Camera:
    """A view as `render` reads a camera; its matrices multiply row vectors."""

    def __init__(self, view: splatbus.View) -> None:
        fx, fy, *_ = view.intrinsics
        self.image_width, self.image_height = view.width, view.height
        self.FoVx = 2.0 * math.atan(view.width / (2.0 * fx))
        self.FoVy = 2.0 * math.atan(view.height / (2.0 * fy))
        matrix = view.object_to_camera
        self.world_view_transform = _on_gpu(matrix.T)
        self.full_proj_transform = _on_gpu((projection(view) @ matrix).T)
        self.camera_center = _on_gpu(np.array(view.eye()))


def projection(view: splatbus.View) -> NDArray[np.float64]:
    """(4, 4), from the camera's axes to −1 … 1 from left to right and from top to bottom."""
    fx, fy, cx, cy, near, far = view.intrinsics
    w, h = view.width, view.height
    deep = far / (far - near)
    return np.array(
        (
            (2.0 * fx / w, 0.0, 2.0 * cx / w - 1.0, 0.0),
            (0.0, 2.0 * fy / h, 2.0 * cy / h - 1.0, 0.0),
            (0.0, 0.0, deep, -near * deep),
            (0.0, 0.0, 1.0, 0.0),
        )
    )


def _on_gpu(array: NDArray[np.float64]) -> torch.Tensor:
    return torch.tensor(array, dtype=torch.float32, device="cuda")


def main(path: str) -> None:
    """Serves until it is stopped."""
    gaussians = GaussianModel(DEGREE)
    gaussians.load_ply(path)
    gaussians.active_sh_degree = DEGREE
    white = torch.ones_like(gaussians.get_xyz)
    black = torch.zeros(3, device="cuda")
    with splatbus.serve(*SIZE, memory="cuda_ipc", semantics=MEANING) as bus, torch.no_grad():
        print(f"ready: {bus.address}", flush=True)
        while True:
            view = bus.next_view(timeout=0.1)
            if view is not None:
                camera = Camera(view)
                image = render(camera, gaussians, PIPE, black)
                # It returns no alpha, which is what Gaussians of white show before black.
                alpha = render(camera, gaussians, PIPE, black, override_color=white)["render"]
                color, depth = image["render"], image["depth"]
                bus.publish(view, color, depth, alpha=alpha[:1], depth_kind="inverse")


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        main(sys.argv[1])
