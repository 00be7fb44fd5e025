"""Allowed variations: servers whose images are unusual, and yet as the specification says."""

import threading
from dataclasses import replace

import numpy as np
from splatbus_renderer.scene import Floor, Scene, Sphere
from splatbus_server.view import Intrinsics
from splatbus_wire.poses import Pose
from splatbus_wire.semantics import Semantics

from tests.zoo.faults.seams import renderer
from tests.zoo.mutant import variation
from tests.zoo.mutants.v1_0.buf import stored

ELSEWHERE = Pose((-0.8, -0.6, -1.2), (-0.1, 0.12, 0.03, 0.987319604))


def serving(patch, **changes):
    """Serve with other arguments."""
    renderer.SERVES.wrap(
        patch,
        lambda original, *size, **named: original(*size, **(named | changes)),
    )


@variation()
def server_of_another_scene(patch):
    """Shows three spheres in a room of fog, which nobody knows."""
    spheres = (
        Sphere((0.5, 0.2, 5.0), 1.5, (0.4, 0.5, 0.6)),
        Sphere((-1.5, -0.8, 4.0), 0.7, (0.9, 0.5, 0.1)),
        Sphere((1.5, 1.0, 3.0), 0.4, (0.1, 0.5, 0.9)),
    )
    floor = Floor(1.5, 20.0, 0.7, (0.5, 0.6, 0.5), (0.3, 0.3, 0.2))
    scene = Scene(spheres, floor, (0.0, -1.0, 0.0))
    renderer.DEFAULT_SCENE.replace(patch, lambda: scene)


@variation()
def server_with_an_odd_lens(patch):
    """Has a long focal length, pixels that are not square, and looks past the middle."""
    serving(patch, intrinsics=Intrinsics(55.0, 70.0, 20.25, 30.5, 0.1, 50.0))


@variation()
def server_that_begins_elsewhere(patch):
    """Comes with two cameras, and begins with the first."""
    serving(patch, cameras=[ELSEWHERE, Pose((0.0, 0.0, -1.0), (0.0, 0.0, 0.0, 1.0))])


@variation()
def server_of_distances(patch):
    """Stores the distance along the ray, and announces it."""
    serving(patch, semantics=Semantics(depth_kind="ray_distance"))

    def render(original, self, scene, camera, wanted=True):
        image = original(self, scene, camera, wanted)
        if image.depth is None:
            return image
        x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
        y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
        length = np.sqrt(1.0 + x[None, :] ** 2 + y[:, None] ** 2)
        return image._replace(depth=(image.depth * length).astype(np.float32))

    renderer.RENDERS_IMAGE.wrap(patch, render)


@variation()
def server_that_is_empty_at_100(patch):
    """Stores the depth 100 where nothing is seen, as the deployed server does, and says so."""
    serving(patch, semantics=Semantics(depth_empty=100.0))


@variation()
def server_without_alpha(patch):
    """Paints a sky where nothing is seen, with alpha 1 everywhere."""

    def fill(slot):
        slot[slot[..., 3] == 0.0] = (0.4, 0.6, 0.9, 1.0)

    stored(patch, "color", fill)


@variation(warns=("ACC-13",), at=renderer.CAMERA_OF_VIEW)
def server_in_single_precision(original, view):
    """Rounds its view matrix to single precision, once, as renderers want it."""
    exact = original(view)
    turned = np.array(exact.rotation)
    moved = (-turned.T @ np.array(exact.position)).astype(np.float32).astype(float)
    rotation = turned.astype(np.float32).astype(float)
    return replace(
        exact,
        rotation=tuple(map(tuple, rotation.tolist())),
        position=tuple((-turned @ moved).tolist()),
    )


@variation()
def server_that_renders_slowly(patch):
    """Takes 50 ms for an image."""
    nothing = threading.Event()

    def render(original, *arguments):
        nothing.wait(0.05)
        return original(*arguments)

    renderer.RENDERS_IMAGE.wrap(patch, render)
