"""Stands for the module of this name in the code of the 3DGS paper."""

from __future__ import annotations

from pathlib import Path

import torch
from splatbus_splats.files.read import read


class GaussianModel:
    def __init__(self, sh_degree: int) -> None:
        self.active_sh_degree = 0
        self.max_sh_degree = sh_degree

    def load_ply(self, path: str) -> None:
        scene = read(Path(path)).gaussians
        assert scene.degree == self.max_sh_degree
        self.get_xyz = torch.tensor(scene.means, device="cuda")
        self.get_opacity = torch.tensor(scene.opacities[:, None], device="cuda")
        self.get_scaling = torch.tensor(scene.scales, device="cuda")
        self.get_rotation = torch.tensor(
            scene.rotations[:, [3, 0, 1, 2]], device="cuda"
        ).contiguous()
        self.get_features = torch.tensor(scene.coefficients, device="cuda")
