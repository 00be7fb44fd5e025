"""What gsplat draws on a GPU is what the processor's renderer draws, and so the definition."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from splatbus_client import Session, connect
from splatbus_server.view import Intrinsics, View
from splatbus_splats.drawing import gpu
from splatbus_splats.drawing.definition import Image, placed
from splatbus_splats.drawing.renderer import rendered
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import made
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

from tests.gpu import require_gpu
from tests.gpu.looking import looked
from tests.splats.shots import some, view_of

require_gpu()
if reason := gpu.why_not():
    pytest.skip(reason, allow_module_level=True)

from tests.gpu.splats_server import FAR_AWAY, SCENES, SIZE  # noqa: E402

ROOT = Path(__file__).parents[2]
ALIKE = 50.0
"""dB: a root mean square of 0.8/255."""
DEPTH = 1e-4
"""Relative, of 99 of a hundred pixels."""


def by_processor(view: View, objects: Mapping[str, Gaussians]) -> Image:
    return rendered(placed(view, objects), view.intrinsics, view.width, view.height, threads=8)


def agree(color: np.ndarray, inverse: np.ndarray, right: Image, within: float = DEPTH) -> None:
    """Premultiplied colour and Σ(1/z)αT, or alpha over depth, which is as good."""
    errors = np.clip(color, 0, 1).astype(np.float64) - np.clip(right.color, 0, 1)
    found = 10 * np.log10(1.0 / max(np.square(errors).mean(), 1e-20))
    covered = right.color[..., 3] > 0.1
    depth = np.abs(inverse[covered] / right.inverse[covered] - 1)
    print(
        f"{found:.1f} dB, worst {np.abs(errors).max() * 255:.2f}/255, 99.9% "
        f"{np.quantile(np.abs(errors), 0.999) * 255:.3f}, covered {covered.mean():.0%},"
        f" depth 99% {np.quantile(depth, 0.99):.1e}, worst {depth.max():.1e}"
    )
    assert covered.mean() > 0.1, "there is hardly anything to compare"
    assert found >= ALIKE
    assert np.quantile(depth, 0.99) <= within


def compare(view: View, objects: Mapping[str, Gaussians], within: float = DEPTH) -> None:
    image = gpu.Renderer()(view, objects)
    rgb, alpha, inverse = (each.cpu().numpy() for each in image)
    agree(np.concatenate((rgb, alpha), axis=-1), inverse, by_processor(view, objects), within)


@pytest.mark.parametrize(
    ("count", "degree"), [(10_000, 0), (10_000, 1), (100_000, 2), (100_000, 3)]
)
def test_made_scenes(count: int, degree: int) -> None:
    compare(view_of(size=SIZE), {"default": made(count, degree)})


@pytest.mark.parametrize("turn", [(0, 0, 0, 1), (0, 0.7, 0.1, 0.7), (0.5, 0.5, -0.5, 0.5)])
def test_a_camera_amid_the_scene(turn: tuple[float, float, float, float]) -> None:
    compare(view_of(Pose((0.1, 0.3, 3.3), turn), size=SIZE), {"default": made(100_000)})


def test_several_objects_each_with_its_pose_and_scale() -> None:
    placements = (
        Placement("default", Pose((0, 0, 0.5), (0, 0.3, 0, 0.95)), 0.7),
        Placement("other", Pose((1, -1, 9), (0.5, 0.5, 0.5, 0.5)), 1.8),
        Placement("nothing", IDENTITY),
    )
    view = view_of(Pose((0.2, -0.3, -1), (0, 0.1, 0, 1)), *placements, size=SIZE)
    objects = {"default": made(50_000), "other": made(30_000, 1, seed=5), "nothing": made(1)[:0]}
    compare(view, objects)


def test_an_object_a_million_units_from_the_origin() -> None:
    at, turn = (1e6, -2e6, 5e5), (0, 0.1, 0, 1)
    placement = Placement("default", Pose(at, (0, 0, 0, 1)))
    compare(view_of(Pose(at, turn), placement, size=SIZE), {"default": made(50_000)})


def test_gaussians_that_were_stored_a_million_units_from_the_origin() -> None:
    """Where single precision has steps of 0.06 units, and the camera is between two of them."""
    shift = np.array((1e6, -1e6, 1e6), np.float32)
    scene = made(50_000)
    moved = replace(scene, means=scene.means + shift)
    camera = (1e6 + 0.021, -1e6 - 0.023, 1e6 + 0.027)
    compare(view_of(Pose(camera, (0, 0, 0, 1)), size=SIZE), {"default": moved})


def test_needles() -> None:
    """As long as gsplat's single precision bears: SPLATS.md has what becomes of longer ones."""
    thin = np.tile(np.array((0.3, 0.002, 0.002), np.float32), (10_000, 1))
    compare(view_of(size=SIZE), {"default": replace(made(10_000), scales=thin)}, within=1e-3)


def test_a_lens_whose_middle_is_elsewhere_between_planes() -> None:
    lens = Intrinsics(300.0, 500.0, 71.3, 458.9, 1.0, 12.0)
    compare(view_of(size=SIZE, intrinsics=lens), {"default": made(50_000)})


def test_an_image_of_nothing_is_empty() -> None:
    draw, away = gpu.Renderer(), Pose((0, 0, 0), (0, 1, 0, 0))
    for view, scene in (view_of(), {}), (view_of(away), {"default": some((0, 0, 4))}):
        image = draw(view, scene)
        assert image.color.shape == (view.height, view.width, 3)
        assert not any(each.any() for each in image)


def test_gaussians_are_brought_to_the_gpu_once_and_make_room_for_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(gpu, "MOST_KEPT", 3 * 1000 * 59 * 4)
    draw, scenes = gpu.Renderer(), [made(1000, seed=seed) for seed in range(5)]
    draw(view_of(), {"default": scenes[0]})
    kept = draw._kept[scenes[0]]
    for each in scenes[1:3]:
        draw(view_of(), {"default": each})
        draw(view_of(), {"default": scenes[0]})
    assert draw._kept[scenes[0]] is kept
    for each in scenes[3:]:
        draw(view_of(), {"default": each})
    assert set(draw._kept) == {scenes[0], *scenes[3:]}
    del scenes[3:], each
    assert set(draw._kept) == {scenes[0]}


@contextmanager
def served() -> Iterator[Session]:
    command = [sys.executable, "-m", "tests.gpu.splats_server"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout
        ports = [int(word) for word in server.stdout.readline().split()]
        try:
            with connect("127.0.0.1", *ports) as session:
                yield session
        finally:
            server.kill()


def test_a_client_reads_what_was_drawn() -> None:
    view = view_of(FAR_AWAY, size=SIZE)
    with served() as session:
        for number, scene in enumerate(SCENES):
            color, depth, _ = looked(session, FAR_AWAY, float(number))
            agree(color, color[..., 3] / depth, by_processor(view, {"default": scene}))
