"""Makes the pictures of the window's guide: python -m tests.window.pictures [FOLDER]."""

import sys
from pathlib import Path

from imgui_bundle import imgui
from splatbus_viewer.window.cameras import Eye
from splatbus_viewer.window.choices import RING, ring_before
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY

from tests.window.stage import Staged, demo, display, opened

FOLDER = Path(__file__).parents[2] / "reference_client" / "pictures"
SIZE = 1280, 800


def main(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    with display(), demo() as where:
        with opened(where, SIZE) as staged:
            walk(staged)
            save(staged, folder / "window.png")
            eye = Eye(IDENTITY, 4.0)
            staged.window.choices.ring = ring_before(eye)
            staged.window.choices.held = RING
            staged.rests()
            save(staged, folder / "window-ring.png")
            staged.window.choices.ring = None
            staged.window.choices.held = "ball"
            staged.window.choices.objects["ball"] = Placement(
                "ball", IDENTITY._replace(position=(-1.2, -0.9, 0.0)), 1.0
            )
            staged.rests()
            save(staged, folder / "window-object.png")
            staged.window.choices.held = None
            imgui.set_window_focus("Packets")
            staged.turns(4)
            packets = staged.window.look.packets.newest
            chosen = next(each for each in packets if b'"get_scene"' in each.payload)
            staged.window.look.own["packet"] = chosen
            staged.turns(2)
            save(staged, folder / "window-packets.png")
        for mode in ("color", "depth", "normals"):
            with opened(where, SIZE, mode=mode, shows_panels=False) as staged:
                staged.rests()
                save(staged, folder / f"window-{mode}.png")


def walk(staged: Staged) -> None:
    """A hundred images from as many places, so that the plots have something to show."""
    staged.rests()
    for step in range(50):
        staged.drag(3 if step < 25 else -3, 1 if step % 2 else -1)
    staged.rests()


def save(staged: Staged, path: Path) -> None:
    staged.window.whole().save(path, optimize=True)
    print(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
