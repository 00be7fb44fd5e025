"""What a person sees in a window of Blender, the viewport and the panel, by screenshots."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.blender.running import ROOT
from tests.blender.window import SHOWN, screenshots

STORED = ROOT / "reference_client" / "blender" / "guide"
LOOKS = ("COMPOSITE", "COLOR", "DEPTH")
pytestmark = pytest.mark.timeout(1200)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return screenshots(tmp_path_factory.mktemp("window"))


@pytest.fixture(scope="module")
def noted(folder: Path) -> dict[str, Any]:
    """By name what `programs/window.py` noted, at pixels that no panel hides."""
    held = dict(np.load(folder / "noted.npz"))
    rows, columns = held["places"].T
    top, left = held["corner"]
    for name in ("MESHES", *LOOKS):
        held[name] = picture(folder / f"{name}.png")[rows + top, columns + left]
    return held | {name: held[name][rows, columns] for name in ("color", "depth")}


def picture(place: Path) -> Any:
    return np.asarray(Image.open(place).convert("RGB")).astype(np.float64)


def test_splats_are_before_and_behind_meshes(noted: dict[str, Any]) -> None:
    nearer = noted["depth"] < noted["far"]
    meshes = np.isfinite(noted["far"])
    assert min((meshes & nearer).sum(), (meshes & ~nearer).sum()) > 50
    color, alpha = noted["color"][:, :3], noted["color"][:, 3:]
    light = np.maximum(color, 0) ** 2.2 + (1 - alpha) * (noted["MESHES"] / 255) ** 2.2
    over = 255 * light ** (1 / 2.2)
    expected = np.where(nearer[:, None], over, noted["MESHES"])
    wrong = np.abs(noted["COMPOSITE"] - expected).max(axis=-1) > 2
    # A ray and a triangle may disagree about a pixel on an edge.
    assert wrong.mean() < 0.005


def test_the_colour_alone_is_that_of_the_image(noted: dict[str, Any]) -> None:
    wrong = np.abs(noted["COLOR"] - 255 * noted["color"][:, :3]).max(axis=-1) > 2
    assert wrong.mean() < 0.005


@pytest.mark.parametrize("look", SHOWN)
def test_it_looks_as_it_did_when_somebody_looked(look: str, folder: Path) -> None:
    """Fonts and all: the guide shows these pictures."""
    new, stored = picture(folder / f"{look}.png"), picture(STORED / f"viewport-{look.lower()}.jpg")
    assert new.shape == stored.shape
    assert (np.abs(new - stored).max(axis=-1) > 24).mean() < 0.01
