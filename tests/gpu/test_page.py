"""The code of reference_server/GPU.md, as it stands there."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import types
from pathlib import Path

import pytest

from tests.gpu import require_gpu

require_gpu()

ROOT = Path(__file__).parents[2]
BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "reference_server/GPU.md").read_text(), re.S)
READER = """
import json
from splatbus_wire.poses import Pose
{opening}
texture = torch.empty((48, 64, 4), device="cuda")
{rest}
        print(json.dumps([texture[20, 30].tolist(), float(frame.depth[27, 30]), frame.seq]))
"""


def rasterization(
    means, quats, scales, opacities, colors, viewmats, Ks, width, height, render_mode
):
    """One Gaussian of gsplat's as wide as the image, with its signature and kinds of output."""
    import torch

    assert render_mode == "RGB+D"
    z = (viewmats[0, :3, :3] @ means[0] + viewmats[0, :3, 3])[2]
    assert Ks.shape == (1, 3, 3)
    alpha = opacities[0].expand(1, height, width, 1)
    rgbd = torch.cat((colors[0], z[None])).expand(1, height, width, 4)
    return rgbd * alpha, alpha, {}


def test_the_ten_lines_serve_and_the_clients_read(torch, monkeypatch):
    gsplat = types.ModuleType("gsplat")
    gsplat.rasterization = rasterization
    monkeypatch.setitem(sys.modules, "gsplat", gsplat)
    monkeypatch.setenv("SPLATBUS_IPC_PORT", "16001")
    monkeypatch.setenv("SPLATBUS_MSG_PORT", "16000")
    server, client = BLOCKS[0], BLOCKS[2]
    page: dict[str, object] = {}
    exec(compile(server, "GPU.md", "exec"), page)
    opening, rest = client.split("\n\n", 1)
    program = READER.format(opening=opening, rest=rest)
    splats = [
        torch.tensor(values, device="cuda")
        for values in ([[0.0, 0.0, 4.0]], [[1.0, 0, 0, 0]], [[1.0] * 3], [0.5], [[0.25, 0.5, 1.0]])
    ]
    with subprocess.Popen(
        [sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as reader:
        page["serve"](splats, 64, 48, lambda: reader.poll() is None)
        color, depth, _ = json.loads(reader.stdout.read() or "null")
    assert color == [0.125, 0.25, 0.5, 0.5]
    assert depth == pytest.approx(4.0)
