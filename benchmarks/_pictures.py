"""What all pictures of figures share: no display to draw on, and few colours."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any


def pyplot() -> Any:
    """Matplotlib's, for whoever draws: what only measures goes without it."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


def save(figure: Any, path: Path, dpi: int = 110) -> None:
    """With a palette, since a plot then takes a third of the bytes."""
    from PIL import Image

    drawn = BytesIO()
    figure.savefig(drawn, dpi=dpi)
    few = Image.open(drawn).convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=1)
    few.save(path, optimize=True)
