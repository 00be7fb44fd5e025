"""The page of pictures of what was measured, each beside the figures that it was drawn from."""

import json
from pathlib import Path

SOURCE = "benchmarks/PICTURES.md"


def page(root: Path) -> str:
    """Every picture of the stored results, one section for each benchmark."""
    folder = root / "benchmarks" / "results"
    text = (
        "# Pictures of the results\n\n"
        "What [the benchmarks](README.md) measured, and how it was drawn. Figures stand beside a "
        "floor from the same run: read the ratios.\n"
    )
    for figures in sorted(folder.glob("*.json")):
        drawn = sorted(folder.glob(f"{figures.stem}*.png"))
        drawn = [each for each in drawn if _owner(each, folder) == figures]
        if not drawn:
            continue
        command = json.loads(figures.read_text("utf-8")).get("command", "")
        text += f"\n## {figures.stem}\n\n[Figures](results/{figures.name})"
        text += f", made by `{command}`.\n" if command else ".\n"
        for each in drawn:
            text += f"\n![{each.stem.replace('_', ' ')}](results/{each.name})\n"
    return text


def _owner(picture: Path, folder: Path) -> Path:
    """The figures of a picture: those with the longest name that its own begins with."""
    names = [each for each in folder.glob("*.json") if picture.stem.startswith(each.stem)]
    return max(names, key=lambda each: len(each.stem))
