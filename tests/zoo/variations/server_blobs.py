"""Allowed variations: servers of soft, sparse splats, which hardly any surface can be seen of."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_renderer.raycast import Raycaster
from splatbus_renderer.scene import Camera, Scene

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seams import renderer
from tests.zoo.mutant import variation

Reals = NDArray[np.float64]
COVERED = 1.0 / 255.0


class Blobs(NamedTuple):
    """Isotropic Gaussians."""

    centers: Reals
    """(n, 3)."""
    sizes: Reals
    """(n,), standard deviations in scene units."""
    opacities: Reals
    colors: Reals
    """(n, 3)."""


def scattered(count: int, size: float, opacity: float) -> Blobs:
    """So many, all over what the first camera sees, from 2 to 8 units away."""
    rng = np.random.default_rng(7)
    z = rng.uniform(2.0, 8.0, count)
    across, down = rng.uniform(-0.8, 0.8, (2, count))
    return Blobs(
        np.stack((across * z, down * z * 0.75, z), axis=-1),
        rng.uniform(0.5, 1.5, count) * size,
        rng.uniform(0.5, 1.0, count) * opacity,
        rng.uniform(0.1, 0.9, (count, 3)),
    )


def splat(blobs: Blobs, scene: Scene, camera: Camera) -> tuple[Reals, Reals]:
    """What a rasteriser of splats makes of them: straight alpha, and depth A/d (ACC-8, ACC-9)."""
    turn, scale = np.array(scene.pose.rotation), scene.pose.scale
    world = scale * blobs.centers @ turn.T + scene.pose.position
    seen = (world - np.array(camera.position)) @ np.array(camera.rotation)
    x = np.arange(camera.width) + 0.5 - camera.cx
    y = np.arange(camera.height)[:, None] + 0.5 - camera.cy
    left = np.ones((camera.height, camera.width))
    color, inverse = np.zeros((*left.shape, 3)), np.zeros_like(left)
    for number in np.argsort(seen[:, 2]):
        px, py, z = seen[number]
        if not max(camera.near, 0.2) <= z <= camera.far:
            continue
        wide = scale * blobs.sizes[number] / z
        square = ((x - camera.fx * px / z) / (camera.fx * wide)) ** 2
        square = square + ((y - camera.fy * py / z) / (camera.fy * wide)) ** 2
        alpha = blobs.opacities[number] * np.exp(-0.5 * square)
        alpha[alpha < COVERED] = 0.0
        color += (alpha * left)[..., None] * blobs.colors[number]
        inverse += alpha * left / z
        left *= 1.0 - alpha
    total = 1.0 - left
    covered = (total >= COVERED) & (inverse > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(covered, total / inverse, np.inf)
        straight = np.where(covered[..., None], color / total[..., None], 0.0)
    alphas = np.where(covered, total, 0.0)[..., None]
    return np.concatenate((np.clip(straight, 0.0, 1.0), alphas), axis=-1), depth


def showing(patch: Patch, blobs: Blobs) -> None:
    """Show these in place of the closed-form scene."""

    def render(original: Any, self: Raycaster, scene: Any, camera: Any, wanted: bool = True) -> Any:
        color, depth = splat(blobs, scene, camera)
        image = original(self, scene, camera, wanted)
        return image._replace(
            color=color.astype(np.float32),
            depth=depth.astype(np.float32) if wanted else None,
        )

    renderer.RENDERS_IMAGE.wrap(patch, render)


@variation()
def server_of_sparse_soft_blobs(patch: Patch) -> None:
    """Shows forty large blobs that one sees through, with nothing between most of them."""
    showing(patch, scattered(40, 0.25, 0.6))


@variation()
def server_of_one_large_blob(patch: Patch) -> None:
    """Shows one blob, all of which has one depth."""
    alone = np.array([[0.6, 0.3, 3.0]]), np.array([1.1]), np.array([0.3]), np.array([[0.8] * 3])
    showing(patch, Blobs(*alone))
