"""A trained scene, drawn by gsplat: `python gsplat_scene.py point_cloud.ply`."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path

import splatbus_server as splatbus
import torch
from gsplat import rasterization
from splatbus_splats.files.read import read

SIZE = (1280, 720)
MEANING = splatbus.Semantics(alpha="premultiplied", depth_estimator="expected")


def loaded(path: Path) -> tuple[list[torch.Tensor], int]:
    """What gsplat takes of a scene (means, quats, scales, opacities, colors), and the degree."""
    scene = read(path).gaussians
    quats = scene.rotations[:, [3, 0, 1, 2]]  # gsplat's begin with w
    arrays = (scene.means, quats, scene.scales, scene.opacities, scene.coefficients)
    return [torch.tensor(each, device="cuda") for each in arrays], scene.degree


def drawn(
    view: splatbus.View, splats: list[torch.Tensor], degree: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Red, green, blue and Σz·α·T, (height, width, 4), and alpha, (height, width, 1)."""
    fx, fy, cx, cy, near, far = view.intrinsics
    K = torch.tensor([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], device="cuda")
    camera = torch.from_numpy(view.object_to_camera).float().cuda()
    image, alpha, _ = rasterization(
        *splats,
        camera[None],
        K[None],
        view.width,
        view.height,
        near_plane=max(near, 0.2),  # what 3DGS trained with: nothing nearer was ever seen
        far_plane=far,
        sh_degree=degree,
        render_mode="RGB+D",
    )
    return image[0], alpha[0]


def main(path: Path) -> None:
    """Serves until it is stopped."""
    splats, degree = loaded(path)
    with splatbus.serve(*SIZE, memory="cuda_ipc", semantics=MEANING) as bus:
        print(f"ready: {bus.address}", flush=True)
        while True:
            view = bus.next_view(timeout=0.1)
            if view is not None:
                image, alpha = drawn(view, splats, degree)
                color, depth = image[..., :3], image[..., 3]
                bus.publish(view, color, depth, alpha=alpha, depth_kind="accumulated")


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        main(Path(sys.argv[1]))
