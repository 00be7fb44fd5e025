"""What a person sees in a window of Blender, the viewport and the panel, by screenshots."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.blender.running import ROOT
from tests.blender.window import SHOWN, screenshots

STORED = ROOT / "reference_client" / "blender" / "guide"


def picture(place: Path) -> Any:
    return np.asarray(Image.open(place).convert("RGB")).astype(np.float64)


@pytest.mark.timeout(1200)
def test_it_looks_as_it_did_when_somebody_looked(tmp_path: Path) -> None:
    """Fonts and all: the guide shows these pictures."""
    folder = screenshots(tmp_path)
    for look in SHOWN:
        new, stored = (
            picture(each)
            for each in (folder / f"{look}.png", STORED / f"viewport-{look.lower()}.jpg")
        )
        assert new.shape == stored.shape
        assert (np.abs(new - stored).max(axis=-1) > 24).mean() < 0.01
