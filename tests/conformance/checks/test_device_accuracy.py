"""How exactly a server of 1.0 renders, by its images in CUDA memory: good ones and others."""

from pathlib import Path

import numpy as np
import pytest
from splatbus_conformance.checks.v1_0 import acc
from splatbus_conformance.images.known_scene import render
from splatbus_conformance.images.lens_finding import find_lens
from splatbus_conformance.images.pinhole import Camera, Rigid

from tests.conformance.images.cuda_stand_in.library import in_device_memory, judged

MINIATURES = Path(__file__).parents[1] / "miniatures"
OF_SCENE = MINIATURES / "cuda_scene_server.py"
CHECKS = in_device_memory(acc)
BROKEN = {
    "multiplies its view in TF32": (
        "    return turn, place\n",
        "    return turn, turn @ tf32(tf32(turn).T @ tf32(place))\n\n\n"
        "def tf32(values):\n"
        "    bits = np.asarray(values, np.float32).view(np.uint32)\n"
        "    return ((bits + 0x1000) & 0xFFFFE000).view(np.float32).astype(np.float64)\n",
        "check_the_camera_is_where_it_was_put",
        "pixels have to show the scene from the camera at position",
    ),
    "takes quaternions for unit ones": (
        "    return turn, place\n",
        "    return np.eye(3) + norm**2 * (turn - np.eye(3)), place\n",
        "check_rotations_do_not_shear",
        "‖RᵀR − I‖₂",
    ),
    "rounds quaternions to three digits": (
        "float(rotation[name])",
        "round(rotation[name], 3)",
        "check_rotations_are_those_of_the_quaternion",
        "entry of the rotation matrix",
    ),
    "rounds positions to six digits": (
        "    return turn, place\n",
        "    return turn, np.array([float(f'{number:.6g}') for number in place])\n",
        "check_single_precision_is_rounded_once",
        "camera centre",
    ),
}


def test_a_server_that_is_exact_passes_every_check() -> None:
    assert judged("server", OF_SCENE, CHECKS) == dict.fromkeys(CHECKS, "")


@pytest.mark.parametrize("name", BROKEN)
def test_a_server_that_is_not_exact_fails(name: str, tmp_path: Path) -> None:
    old, new, check, why = BROKEN[name]
    source = OF_SCENE.read_text("utf-8")
    assert old in source
    program = tmp_path / OF_SCENE.name
    program.write_text(source.replace(old, new), "utf-8")
    (tmp_path / "cuda_server.py").write_bytes((MINIATURES / "cuda_server.py").read_bytes())
    assert why in judged("server", program, {check: CHECKS[check]})[check]


@pytest.mark.parametrize(
    ("size", "lens"),
    [
        ((64, 48), (41.6, 41.6, 32.0, 24.0)),
        ((64, 48), (44.0, 40.0, 30.25, 25.5)),
        ((48, 32), (20.0, 20.0, 24.0, 16.0)),
        ((64, 48), (41.6, 41.6, 40.0, 18.0)),
        ((320, 240), (300.0, 310.0, 150.0, 125.0)),
    ],
)
def test_a_lens_is_found_that_nobody_tells(
    size: tuple[int, int], lens: tuple[float, float, float, float]
) -> None:
    camera = Camera(Rigid(), *lens, *size, 0.01, 100.0)
    found = find_lens(Rigid(), render(camera).depth.astype(np.float32).astype(np.float64))
    assert found is not None
    assert (found.fx, found.fy, found.cx, found.cy) == pytest.approx(lens, rel=1e-7, abs=1e-5)


def test_of_another_scene_no_lens_is_found() -> None:
    rows, columns = np.indices((48, 64))
    assert find_lens(Rigid(), 4.0 + 0.01 * rows + 0.02 * columns) is None
    assert find_lens(Rigid(), np.full((48, 64), np.inf)) is None
