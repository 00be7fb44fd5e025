"""Makes the pictures of the window's guide, of README and of the site's front page.

python -m tests.window.pictures [FOLDER]
"""

import itertools
import math
import sys
from pathlib import Path

from imgui_bundle import imgui
from splatbus_client.loop import clock
from splatbus_viewer.poses import look_at
from splatbus_viewer.window.cameras import Eye
from splatbus_viewer.window.choices import RING
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose
from splatbus_wire.settings import Settings

from tests.splats.served import serving_garden
from tests.window.stage import Staged, demo, display, opened

FOLDER = Path(__file__).parents[2] / "reference_client" / "pictures"
SIZE = 1280, 800
GAUSSIANS = 250_000
FROM, TO = (-0.72, -1.05, -2.3), (0.02, -0.58, 0.0)
"""Where the ring is looked at from, and where to."""
THREADED = Placement(RING, Pose((0.02, -1.0, 0.0), (0.275, 0.0, -0.175, 0.945)), 0.7)
"""A ring about the tree, which goes through its branches."""
NEAREST, FARTHEST = 1.5, 8.0
"""Of the false colours, scene units: to the hedge, since the sky is far behind all else."""
QUALITY = 72
"""Of JPEG: with more of it the largest would be larger than a picture here may be."""
PLOTTED_SECONDS = 31.0
"""What plots show, and a little more: the window's own beginning is outside."""


def main(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    with display():
        with serving_garden(GAUSSIANS) as server:
            of_the_garden(Settings("127.0.0.1", *server.ports, None), folder)
        with demo() as where:
            of_the_spheres(where, folder)


def of_the_garden(where: Settings, folder: Path) -> None:
    with opened(where, SIZE, mode="color", shows_panels=False) as staged:
        staged.rests()
        save(staged, folder / "garden.jpg")
        staged.window.choices.mode, staged.window.choices.is_fitting = "depth", False
        staged.window.choices.depths = NEAREST, FARTHEST
        staged.rests()
        save(staged, folder / "window-depth.jpg")
    with opened(where, SIZE, shows_panels=False) as staged:
        staged.rests()
        staged.window.choices.moved_to(Eye(look_at(FROM, TO), math.dist(FROM, TO)))
        staged.window.choices.ring = THREADED
        staged.rests()
        save(staged, folder / "garden-ring.jpg")
    with opened(where, SIZE) as staged:
        walk(staged)
        staged.window.choices.moved_to(Eye(look_at(FROM, TO), math.dist(FROM, TO)))
        staged.rests()
        save(staged, folder / "window.jpg")
        staged.window.choices.ring = THREADED
        staged.window.choices.held = RING
        staged.rests()
        save(staged, folder / "window-ring.jpg")


def of_the_spheres(where: Settings, folder: Path) -> None:
    with opened(where, SIZE) as staged:
        staged.rests()
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
        save(staged, folder / "window-packets.jpg")
    with opened(where, SIZE, mode="normals", shows_panels=False) as staged:
        staged.rests()
        save(staged, folder / "window-normals.png")


def walk(staged: Staged) -> None:
    """Images from many places, so that the plots have something to show."""
    staged.rests()
    end = clock() + PLOTTED_SECONDS
    for step in itertools.count():
        staged.drag(3 if step % 50 < 25 else -3, 1 if step % 2 else -1)
        if clock() >= end:
            break
    staged.rests()


def save(staged: Staged, path: Path) -> None:
    whole = staged.window.whole().convert("RGB")
    whole.save(path, optimize=True, quality=QUALITY, subsampling=0)
    print(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
