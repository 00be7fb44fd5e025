"""Gaussians that live in time, as files have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from splatbus_splats.files import container
from splatbus_splats.files.ply import NEEDED
from splatbus_splats.files.spacetime import OMEGA

ALL = (*NEEDED, "trbf_center", "trbf_scale", *(f"motion_{i}" for i in range(9)), *OMEGA)


def drawn(count: int, seed: int = 5, names: tuple[str, ...] = ALL) -> np.ndarray:
    """Vertices of the lite model before a camera at the origin, the same for the same seed."""
    random = np.random.default_rng(seed)
    table = np.zeros(count, [(name, "<f4") for name in names])
    for name in names:
        table[name] = random.normal(0, 0.3, count)
    table["z"] += 4
    for i in range(3):
        table[f"scale_{i}"] = random.normal(-2, 0.3, count)
        table[f"f_dc_{i}"] = random.uniform(0, 1, count)
    table["rot_0"] += 1
    if "trbf_center" in names:
        table["trbf_center"] = random.uniform(-0.2, 1.2, count)
        table["trbf_scale"] = random.normal(-1, 0.8, count)
    return table


def written(path: Path, table: np.ndarray) -> Path:
    container.write(path, table)
    return path
