"""The examples, as they stand: gsplat, the code of the 3DGS paper, and a scene in time."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from splatbus_client import Session, connect
from splatbus_conformance.wire.ports import free_port
from splatbus_splats.drawing import gpu
from splatbus_splats.drawing.definition import Image
from splatbus_splats.files import ply
from splatbus_splats.gaussians import Gaussians
from splatbus_wire.poses import Pose

from tests.gpu import require_gpu
from tests.gpu.looking import looked
from tests.splats.shots import cloud, drawn, view_of

require_gpu()
if reason := gpu.why_not():
    pytest.skip(reason, allow_module_level=True)

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "reference_server" / "examples"
THREE_DGS = Path(__file__).with_name("three_dgs")
SIZE = (1280, 720)
CAMERA = Pose((0.3, -0.2, -0.5), (0.0, 0.1, 0.05, 0.99))
SCENE = cloud(30_000)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scene") / "point_cloud.ply"
    ply.write(path, SCENE)
    return path


@contextmanager
def running(example: str, file: Path, *modules: Path) -> Iterator[Session]:
    ports = {"SPLATBUS_IPC_PORT": str(free_port()), "SPLATBUS_MSG_PORT": str(free_port())}
    places = [*map(str, modules), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    command = [sys.executable, str(EXAMPLES / example), str(file)]
    environment = os.environ | ports | {"PYTHONPATH": os.pathsep.join(places)}
    with subprocess.Popen(command, env=environment) as process:
        try:
            with connect("127.0.0.1", *map(int, ports.values())) as session:
                yield session
        finally:
            process.kill()


def right(scene: Gaussians = SCENE) -> Image:
    return drawn(view_of(CAMERA, size=SIZE), {"default": scene}, threads=8)


def decibels(color: np.ndarray, exact: np.ndarray) -> float:
    error = np.square(np.clip(color, 0, 1).astype(np.float64) - np.clip(exact, 0, 1)).mean()
    found = float(10 * np.log10(1.0 / error))
    print(f"{found:.1f} dB")
    return found


def test_gsplat(file: Path) -> None:
    with running("gsplat_scene.py", file) as session:
        picture = looked(session, CAMERA)
    exact = right()
    assert decibels(picture.color, exact.color) > 50
    covered = exact.color[..., 3] > 0.1
    # Its depth is a mean of z, and no less than the harmonic mean.
    ratio = picture.depth[covered] * exact.inverse[covered] / exact.color[covered][:, 3]
    assert np.quantile(ratio, 0.001) > 1 - 1e-3
    assert np.median(ratio) < 1.05


def test_the_code_of_the_3dgs_paper(file: Path) -> None:
    if importlib.util.find_spec("diff_gaussian_rasterization") is None:
        pytest.skip("diff_gaussian_rasterization is not installed")
    with running("inria.py", file, THREE_DGS) as session:
        picture = looked(session, CAMERA)
    exact = right()
    assert decibels(picture.color, exact.color) > 50
    covered = exact.color[..., 3] > 0.1
    ratio = picture.depth[covered] * exact.inverse[covered] / exact.color[covered][:, 3]
    print(f"depth: 99% within {np.quantile(np.abs(ratio - 1), 0.99):.1e}")
    assert np.quantile(np.abs(ratio - 1), 0.99) < 1e-2


def test_a_scene_in_time(file: Path) -> None:
    with running("four_d.py", file) as session:
        one, two = looked(session, CAMERA), looked(session, CAMERA)
        assert one.time != two.time
        assert (one.color != two.color).any()
        picture = looked(session, CAMERA, 1.5)
    assert picture.time == 1.5
    waves = np.zeros_like(SCENE.means)
    waves[:, 1] = 0.1 * np.sin(2 * np.pi * (SCENE.means[:, 0] / 2.0 - 1.5 / 4.0))
    moved = replace(SCENE, means=SCENE.means + waves)
    assert decibels(picture.color, right(moved).color) > 50
    assert decibels(picture.color, right().color) < 40
