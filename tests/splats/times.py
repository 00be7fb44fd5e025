"""Gaussians that live in time, as files have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from splatbus_splats.files import container
from splatbus_splats.files.ply import NEEDED
from splatbus_splats.files.read import read
from splatbus_splats.files.spacetime import OMEGA
from splatbus_splats.scene import Clip

ALL = (*NEEDED, "trbf_center", "trbf_scale", *(f"motion_{i}" for i in range(9)), *OMEGA)


def drawn(count: int, seed: int = 5) -> np.ndarray:
    """Vertices of the lite model before a camera at the origin, the same for the same seed."""
    random = np.random.default_rng(seed)
    table = np.zeros(count, [(name, "<f4") for name in ALL])
    for name in ALL:
        table[name] = random.normal(0, 0.3, count)
    table["z"] += 4
    for i in range(3):
        table[f"scale_{i}"] = random.normal(-2, 0.3, count)
        table[f"f_dc_{i}"] = random.uniform(0, 1, count)
    table["rot_0"] += 1
    table["trbf_center"] = random.uniform(-0.2, 1.2, count)
    table["trbf_scale"] = random.normal(-1, 0.8, count)
    return table


def clip(folder: Path, count: int, seconds: float, seed: int = 5) -> Clip:
    """They are written, and read again."""
    container.write(folder / "a.ply", drawn(count, seed))
    found = read(folder / "a.ply")
    assert found.motion is not None
    return Clip(found.gaussians, found.motion, seconds)
