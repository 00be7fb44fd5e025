"""Allowed variations: servers that show little, show it late, or have much room for it."""

import threading
from dataclasses import replace

from splatbus_renderer import demo
from splatbus_renderer.scene import Scene, Sphere, default_scene

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import renderer
from tests.zoo.mutant import variation
from tests.zoo.variations.server_images import serving

FIRST_SECONDS = 2.5


def showing(patch, *spheres):
    """Show these, and no floor."""
    scene = Scene(spheres, None, (0.0, -1.0, 0.0))
    renderer.DEFAULT_SCENE.replace(patch, lambda: scene)
    Seam(demo, "scene_at").replace(patch, lambda time, view, turn=0.0: placed(view))

    def placed(view):
        return replace(scene, pose=demo.object_pose_of(view, 0.0))

    serving(patch, objects=demo.OBJECTS[:1])


def drawing(patch, fps):
    """Draw so many images a second at most."""
    renderer.RENDERS_UNTIL_TOLD.wrap(
        patch, lambda original, stop, bus, *_: original(stop, bus, fps)
    )


@variation()
def server_draws_four_times_a_second_what_nobody_knows(patch):
    """Draws four images a second at most, of three spheres before nothing."""
    drawing(patch, 4.0)
    showing(patch, *default_scene().spheres[:3])


@variation()
def server_takes_long_for_its_first_image(patch):
    """Loads its scene when the first image is asked for."""
    loaded, nothing = list[bool](), threading.Event()

    def render(original, *arguments):
        if not loaded:
            nothing.wait(FIRST_SECONDS)
        loaded.append(True)
        return original(*arguments)

    renderer.RENDERS_IMAGE.wrap(patch, render)


@variation()
def server_of_many_slots(patch):
    """Has slots for two hundred readers."""
    serving(patch, readers=200)


@variation()
def server_of_one_small_splat(patch):
    """Shows one small sphere, of which a few pixels are seen."""
    showing(patch, Sphere((0.2, 0.1, 4.0), 0.25, (0.9, 0.5, 0.1)))


@variation()
def server_of_nothing(patch):
    """Shows a scene in which nothing is: alpha is 0 in every pixel, and nothing is near."""
    showing(patch)
