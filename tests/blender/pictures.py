"""Makes the pictures of the guide to the extension for Blender anew.

python -m tests.blender.pictures

needs Blender 3.4 with a virtual display, and a Python with `bpy` (`running`).
"""

import tempfile
from pathlib import Path

from PIL import Image

from tests.blender.running import ROOT, ran
from tests.blender.window import SHOWN, garden, screenshots
from tests.window.pictures import QUALITY

GUIDE = ROOT / "reference_client" / "blender" / "guide"


def main() -> None:
    with tempfile.TemporaryDirectory() as home:
        window = screenshots(Path(home))
        for look in SHOWN:
            _keep(window / f"{look}.png", f"viewport-{look.lower()}")
        with garden() as where:
            ran("picture.py", Path(home), str(place := Path(home) / "render.png"), **where)
        _keep(place, "render")


def _keep(place: Path, name: str) -> None:
    """Without what tells when it was made, and small."""
    picture = Image.open(place).convert("RGB")
    picture.save(GUIDE / f"{name}.jpg", optimize=True, quality=QUALITY, subsampling=0)


if __name__ == "__main__":
    main()
