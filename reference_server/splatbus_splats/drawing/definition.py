"""What a picture of Gaussians is made of, for `truth` and `renderer` alike; see `SPLATS.md`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_server.view import Intrinsics, View

from splatbus_splats.gaussians import Gaussians

LOW_PASS = 0.3
"""Added to a projected variance, pixels²: no Gaussian is thinner than a pixel."""
LARGEST_ALPHA = float(np.float32(0.99))
"""In float32, as 3DGS has it: two of them leave less than 10⁻⁴, and two of 0.99 just that."""
LEAST_ALPHA = 1.0 / 255.0
"""What is fainter in a pixel is not in it."""
LEAST_LEFT = 1e-4
"""Where less light than this would be left, the pixel is finished, and that Gaussian not in it."""
NEAR = 0.2
"""A centre is farther than this, scene units."""
MARGIN = 0.3
"""How far beyond the image a slope is taken as it is, in tangents of half the field of view."""


class Placed(NamedTuple):
    """Gaussians as a camera has them before it."""

    gaussians: Gaussians
    turn: NDArray[np.float64]
    """(3, 3), the scale s times the rotation from the object's axes to the camera's [OBJ-1]."""
    eye: NDArray[np.float64]
    """(3,), the camera's centre in the object's axes and units."""


class Image(NamedTuple):
    """Pixels, the top row first; float64 from `truth`, float32 from `renderer`."""

    color: NDArray[Any]
    """(height, width, 4), red, green and blue premultiplied by alpha, which is the fourth."""
    inverse: NDArray[Any]
    """(height, width), Σ(1/zᵢ)αᵢTᵢ: depth is alpha divided by it, `depth_kind="inverse"`."""


def placed(view: View, gaussians: Mapping[str, Gaussians]) -> list[Placed]:
    """The objects of a scene as a view has them before it, by their ids.

    Raises:
        KeyError: the scene has no such object.
    """
    views = ((view.of(name), each) for name, each in gaussians.items())
    return [Placed(each, own.object_to_camera[:3, :3], np.array(own.eye())) for own, each in views]


def slopes(focal: float, center: float, size: int) -> tuple[float, float]:
    """Between which x/z (or y/z) the projection's Jacobian is taken: the image and its margin.

    1.3 times the tangent of half the field of view to either side where the principal point is in
    the middle, as in 3DGS; where it is not, the margin is as wide, and beside the image.
    """
    margin = MARGIN * size / (2.0 * focal)
    return -center / focal - margin, (size - center) / focal + margin


def depths(intrinsics: Intrinsics) -> tuple[float, float]:
    """A centre is drawn beyond the first and up to the second, scene units."""
    return max(NEAR, intrinsics.near), intrinsics.far
