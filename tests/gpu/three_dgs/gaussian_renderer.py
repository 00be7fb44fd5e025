"""Stands for the module of this name in the code of the 3DGS paper, over that code's rasteriser."""

from __future__ import annotations

import math
from typing import Any

import torch
from diff_gaussian_rasterization import GaussianRasterizationSettings, GaussianRasterizer


def render(
    viewpoint_camera: Any,
    pc: Any,
    pipe: Any,
    bg_color: torch.Tensor,
    scaling_modifier: float = 1.0,
    separate_sh: bool = False,
    override_color: torch.Tensor | None = None,
    use_trained_exp: bool = False,
) -> dict[str, torch.Tensor]:
    camera = viewpoint_camera
    settings = GaussianRasterizationSettings(
        image_height=camera.image_height,
        image_width=camera.image_width,
        tanfovx=math.tan(camera.FoVx / 2),
        tanfovy=math.tan(camera.FoVy / 2),
        bg=bg_color,
        scale_modifier=scaling_modifier,
        viewmatrix=camera.world_view_transform,
        projmatrix=camera.full_proj_transform,
        sh_degree=pc.active_sh_degree,
        campos=camera.camera_center,
        prefiltered=False,
        debug=pipe.debug,
        antialiasing=pipe.antialiasing,
    )
    color, _, inverse = GaussianRasterizer(settings)(
        means3D=pc.get_xyz,
        means2D=torch.zeros_like(pc.get_xyz),
        opacities=pc.get_opacity,
        shs=pc.get_features if override_color is None else None,
        colors_precomp=override_color,
        scales=pc.get_scaling,
        rotations=pc.get_rotation,
    )
    return {"render": color.clamp(0, 1), "depth": inverse}
