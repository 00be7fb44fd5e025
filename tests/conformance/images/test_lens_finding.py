"""The lens of an image of the known scene, which 1.0 does not tell."""

import numpy as np
import pytest
from splatbus_conformance.images.known_scene import render
from splatbus_conformance.images.lens_finding import find_lens
from splatbus_conformance.images.pinhole import Camera, Rigid


@pytest.mark.parametrize(
    ("size", "lens"),
    [
        ((64, 48), (41.6, 41.6, 32.0, 24.0)),
        ((64, 48), (44.0, 40.0, 30.25, 25.5)),
        ((48, 32), (20.0, 20.0, 24.0, 16.0)),
        ((320, 240), (300.0, 310.0, 150.0, 125.0)),
    ],
)
def test_a_lens_is_found_that_nobody_tells(
    size: tuple[int, int], lens: tuple[float, float, float, float]
) -> None:
    camera = Camera(Rigid(), *lens, *size, 0.01, 100.0)
    found = find_lens(Rigid(), render(camera).depth.astype(np.float32).astype(np.float64))
    assert found is not None
    assert (found.fx, found.fy, found.cx, found.cy) == pytest.approx(lens, rel=1e-7, abs=1e-5)


def test_of_another_scene_no_lens_is_found() -> None:
    rows, columns = np.indices((48, 64))
    assert find_lens(Rigid(), 4.0 + 0.01 * rows + 0.02 * columns) is None
    assert find_lens(Rigid(), np.full((48, 64), np.inf)) is None
