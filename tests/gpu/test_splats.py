"""What gsplat draws on a GPU is what the processor's renderer draws, and so the definition."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from splatbus_client import connect
from splatbus_server.view import Intrinsics, View, field_of_view
from splatbus_splats.drawing import gpu
from splatbus_splats.drawing.definition import Image
from splatbus_splats.files import ply
from splatbus_splats.gaussians import Gaussians, along_curve
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

from tests.gpu import require_gpu
from tests.gpu.looking import looked
from tests.splats.served import serving
from tests.splats.shots import UNTURNED, cloud, drawn, some, view_of

require_gpu()
if reason := gpu.why_not():
    pytest.skip(reason, allow_module_level=True)

SIZE = (640, 480)
ALIKE = 50.0
"""dB: a root mean square of 0.8/255."""
DEPTH = 1e-4
"""Relative, of 99 of a hundred pixels."""
FRONT = view_of(size=SIZE)
AWAY = (1e6, -2e6, 5e5)
FAR_AWAY = Pose((0.3, -0.2, -0.5), (0.0, 0.1, 0.05, 0.99))


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


def amid(*turn: float) -> View:
    x, y, z, w = turn
    return view_of(Pose((0.1, 0.3, 3.3), (x, y, z, w)), size=SIZE)


PLACED = view_of(
    Pose((0.2, -0.3, -1), (0, 0.1, 0, 1)),
    Placement("default", Pose((0, 0, 0.5), (0, 0.3, 0, 0.95)), 0.7),
    Placement("other", Pose((1, -1, 9), (0.5, 0.5, 0.5, 0.5)), 1.8),
    Placement("nothing", IDENTITY),
    size=SIZE,
)
SHIFTED = replace(cloud(50_000), means=cloud(50_000).means + np.float32((1e6, -1e6, 1e6)))
"""Where single precision has steps of 0.06 units, and the camera is between two of them."""
THIN = np.tile(np.array((0.3, 0.002, 0.002), np.float32), (10_000, 1))
"""As long as gsplat's single precision bears: SPLATS.md has what becomes of longer ones."""
CASES: dict[str, tuple[View, Mapping[str, Gaussians]]] = {
    **{f"degree {i}": (FRONT, {"default": cloud(10_000 if i < 2 else 100_000, i)})
       for i in range(4)},
    "amid": (amid(0, 0.7, 0.1, 0.7), {"default": cloud(100_000)}),
    "amid, otherwise": (amid(0.5, 0.5, -0.5, 0.5), {"default": cloud(100_000)}),
    "several objects": (PLACED, {"default": cloud(50_000), "other": cloud(30_000, 1, seed=5),
                                 "nothing": cloud(1)[:0]}),
    "far from the origin": (
        view_of(Pose(AWAY, (0, 0.1, 0, 1)), Placement("default", Pose(AWAY, UNTURNED)), size=SIZE),
        {"default": cloud(50_000)},
    ),
    "stored far from the origin": (
        view_of(Pose((1e6 + 0.021, -1e6 - 0.023, 1e6 + 0.027), UNTURNED), size=SIZE),
        {"default": SHIFTED},
    ),
    "needles": (FRONT, {"default": replace(cloud(10_000), scales=THIN)}),
    "a lens whose middle is elsewhere": (
        view_of(size=SIZE, intrinsics=Intrinsics(300.0, 500.0, 71.3, 458.9, 1.0, 12.0)),
        {"default": cloud(50_000)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_picture_is_the_processors(name: str) -> None:
    image = gpu.Renderer()(*CASES[name])
    rgb, alpha, inverse = (each.cpu().numpy() for each in image)
    right = drawn(*CASES[name], threads=8)
    within = 1e-3 if name == "needles" else DEPTH
    agree(np.concatenate((rgb, alpha), axis=-1), inverse, right, within)


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
    draw, scenes = gpu.Renderer(), [cloud(1000, seed=seed) for seed in range(5)]
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


def test_a_client_of_the_command_reads_what_was_drawn(tmp_path: Path) -> None:
    scenes = [along_curve(cloud(20_000, seed=seed)) for seed in (1, 2)]
    for number, scene in enumerate(scenes):
        ply.write(tmp_path / f"{number}.ply", scene)
    lens = field_of_view(*SIZE)
    view = view_of(FAR_AWAY, size=SIZE, intrinsics=lens._replace(far=1e3))
    with (
        serving(tmp_path, "--rate", "1") as server,
        connect("127.0.0.1", *server.ports) as session,
    ):
        for number, scene in enumerate(scenes):
            color, depth, _ = looked(session, FAR_AWAY, float(number))
            agree(color, color[..., 3] / depth, drawn(view, {"default": scene}))
