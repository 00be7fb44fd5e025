"""What is drawn of an image, beside what it is to be by the definitions."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("imgui_bundle", reason="the extra [window] is not installed")

from splatbus_viewer.display import composed, planar_depth, range_of, rays, srgb
from splatbus_viewer.picture import _ramp
from splatbus_viewer.poses import look_at
from splatbus_viewer.window.drawing.ground import (
    THICKNESS,
    Ground,
    GroundDrawing,
)
from splatbus_viewer.window.drawing.picture import Picture, fitted
from splatbus_viewer.window.screen import Screen
from splatbus_wire.messages import FrameCamera, Placement
from splatbus_wire.poses import IDENTITY, as_array, view_matrix
from splatbus_wire.semantics import Semantics

WIDTH, HEIGHT = 61, 47
REGION = (0, 0, WIDTH, HEIGHT)
CAMERA = FrameCamera(
    look_at((0.3, -1.0, -2.0), (0.0, 0.5, 3.0)), 55.0, 52.0, 29.0, 24.5, WIDTH, HEIGHT, 0.1, 100.0
)
SEMANTICS = (
    Semantics(alpha="straight", color_space="srgb", depth_empty=7.5),
    Semantics(alpha="premultiplied", color_space="linear", depth_kind="ray_distance"),
)
SQUARES = 0.20, 0.16
NOTHING = Ground(None)


@pytest.fixture(scope="module")
def context(screen: None) -> Iterator[Any]:
    """That of a window: one without, of EGL, and one with do not live in one process on Mesa."""
    window = Screen((64, 64), "SplatBus")
    yield window.context
    window.close()


class OnHost(SimpleNamespace):
    """What a frame of the host gives its reader; arrays are given top row first."""

    seq, objects, has_camera, camera = 3, (), True, CAMERA
    channels = frozenset(("color", "depth"))

    @property
    def color_on_device(self) -> Any:
        raise RuntimeError("it is on the host")


def image(semantics: Semantics) -> tuple[Any, Any]:
    """Colours and depths of all kinds, empty and odd ones too."""
    draw = np.random.default_rng(5)
    color = draw.random((HEIGHT, WIDTH, 4), np.float32)
    color[draw.random((HEIGHT, WIDTH)) < 0.2, 3] = 0
    if semantics.alpha == "premultiplied":
        color[..., :3] *= color[..., 3:]
    depth = draw.uniform(1, 8, (HEIGHT, WIDTH)).astype(np.float32)
    for odd in (np.inf, 0.0, -1.0, semantics.depth_empty):
        depth[draw.random((HEIGHT, WIDTH)) < 0.05] = odd
    return color, depth


def drawn(
    context: Any,
    color: Any,
    depth: Any,
    semantics: Semantics,
    mode: str,
    ground: Ground = NOTHING,
    depths: tuple[float, float] = (1.0, 8.0),
) -> Any:
    """(H, W, 3) float32, top row first, as a mode shows it."""
    picture = Picture(context)
    picture.take(OnHost(color=color, depth=depth, semantics=semantics))
    target = context.framebuffer([context.texture((WIDTH, HEIGHT), 4, dtype="f4")])
    picture.draw(target, REGION, mode, CAMERA, ground, depths)
    data = target.read(components=3, dtype="f4")
    return np.frombuffer(data, np.float32).reshape(HEIGHT, WIDTH, 3)[::-1]


def squares(semantics: Semantics) -> Any:
    """What stands for nothing, in the image's colour space."""
    rows, columns = np.indices((HEIGHT, WIDTH))
    is_light = ((columns >> 3) + ((HEIGHT - 1 - rows) >> 3)) % 2 == 0
    shade = np.where(is_light, *SQUARES)
    if semantics.color_space == "linear":
        shade = ((shade + 0.055) / 1.055) ** 2.4
    return np.repeat(shade[..., None], 3, axis=-1).astype(np.float32)


def encoded(color: Any, semantics: Semantics) -> Any:
    return srgb(color) if semantics.color_space == "linear" else color


@pytest.mark.parametrize("semantics", SEMANTICS)
def test_colour_is_blended_over_squares(context: Any, semantics: Semantics) -> None:
    color, depth = image(semantics)
    alpha = color[..., 3:]
    light = color[..., :3] * (alpha if semantics.alpha == "straight" else 1)
    truth = encoded(light + (1 - alpha) * squares(semantics), semantics)
    found = drawn(context, color, depth, semantics, "color")
    assert np.abs(found - truth).max() < 1e-5


@pytest.mark.parametrize("semantics", SEMANTICS)
def test_depth_is_in_false_colours(context: Any, semantics: Semantics) -> None:
    color, depth = image(semantics)
    z = planar_depth(color, depth, CAMERA, semantics)
    is_surface = np.isfinite(z)
    assert 0.3 < is_surface.mean() < 0.9
    place = np.clip((np.where(is_surface, z, 1.0) - 1.0) / 7.0, 0, 1)
    found = drawn(context, color, depth, semantics, "depth")
    assert np.abs(found - _ramp(place))[is_surface].max() < 1e-4
    rows, columns = np.indices((HEIGHT, WIDTH))
    stripe = (columns + HEIGHT - 1 - rows) % 10 < 2
    hatched = np.where(stripe, np.float32(0.30), np.float32(0.16))
    assert np.abs(found - hatched[..., None])[~is_surface].max() < 1e-6


@pytest.mark.parametrize("semantics", SEMANTICS)
def test_normals_of_planes_are_theirs_up_to_the_edge(context: Any, semantics: Semantics) -> None:
    ray = rays(CAMERA)
    normals = np.array([[0.2, -0.3, -1.0], [-0.6, 0.1, -1.0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    is_left = np.arange(WIDTH) < WIDTH // 2
    normal = np.where(is_left[None, :, None], normals[0], normals[1])
    distance = np.where(is_left, -3.0, -6.0)
    z = distance / np.sum(ray * normal, axis=-1)
    factor = np.linalg.norm(ray, axis=-1) if semantics.depth_kind == "ray_distance" else 1.0
    color = np.ones((HEIGHT, WIDTH, 4), np.float32)
    found = drawn(context, color, (z * factor).astype(np.float32), semantics, "normals")
    truth = 0.5 + 0.5 * normal * (1.0, -1.0, -1.0)
    assert np.abs(found - truth).max() < 2e-3


@pytest.mark.parametrize("semantics", SEMANTICS)
def test_geometry_is_among_the_splats_as_compositing_has_it(
    context: Any, semantics: Semantics
) -> None:
    ground = Ground(1.0, Placement("ring", IDENTITY._replace(position=(0.0, 0.3, 3.0)), 1.5))
    planes = GroundDrawing(context).draw(CAMERA, ground)
    shade, far = (
        np.frombuffer(plane.read(), kind).reshape(HEIGHT, WIDTH, -1)[::-1]
        for plane, kind in zip(planes, (np.uint8, np.float32), strict=True)
    )
    is_there = far[..., 0] > 0
    assert 0.1 < is_there.mean() < 0.9
    color, depth = image(semantics)
    behind = shade[..., :3].astype(np.float32) / 255
    if semantics.color_space == "linear":
        low = behind / 12.92
        behind = np.where(behind <= 0.04045, low, ((behind + 0.055) / 1.055) ** 2.4)
    behind = np.where(is_there[..., None], behind, squares(semantics)).astype(np.float32)
    nearest = np.where(is_there, far[..., 0], np.inf).astype(np.float32)
    truth = composed(color, depth, CAMERA, semantics, behind, nearest)
    assert 0.1 < (truth != behind).any(axis=-1).mean() < 0.9
    found = drawn(context, color, depth, semantics, "composite", ground)
    assert np.abs(found - encoded(truth, semantics)).max() < 1e-5


@pytest.mark.parametrize("times", [1, 2])
def test_an_image_is_drawn_where_its_part_of_the_screen_is(context: Any, times: int) -> None:
    color, depth = image(SEMANTICS[0])
    color[..., 3] = 1
    picture = Picture(context)
    picture.take(OnHost(color=color, depth=depth, semantics=SEMANTICS[0]))
    width, height = times * WIDTH, times * HEIGHT
    target = context.framebuffer([context.texture((width + 9, height + 5), 4, dtype="f4")])
    picture.draw(target, (7, 3, width, height), "color", CAMERA, NOTHING, (0.0, 1.0))
    data = target.read(viewport=(7, 3, width, height), components=3, dtype="f4")
    found = np.frombuffer(data, np.float32).reshape(height, width, 3)[::-1]
    assert (found == color[..., :3].repeat(times, axis=0).repeat(times, axis=1)).all()


def test_the_ring_is_where_it_is_put_and_as_large(context: Any) -> None:
    pose, scale = IDENTITY._replace(position=(0.0, 0.3, 3.0)), 1.5
    _, plane = GroundDrawing(context).draw(CAMERA, Ground(None, Placement("ring", pose, scale)))
    z = np.frombuffer(plane.read(), np.float32).reshape(HEIGHT, WIDTH)[::-1]
    assert (z > 0).sum() > 100
    here = rays(CAMERA)[z > 0] * z[z > 0][:, None]
    world = here @ as_array(view_matrix(CAMERA.pose))[:3, :3] + CAMERA.pose.position
    x, y, z = ((world - pose.position) / scale).T
    assert np.abs(np.hypot(np.hypot(x, z) - 1.0, y) - THICKNESS).max() < 0.01


def test_a_probe_sees_depths_from_all_over(context: Any) -> None:
    color, _ = image(SEMANTICS[0])
    color[..., 3] = 1
    depth = np.broadcast_to(np.linspace(2, 5, HEIGHT)[:, None], (HEIGHT, WIDTH)).astype("f4")
    picture = Picture(context)
    picture.take(OnHost(color=color, depth=depth, semantics=SEMANTICS[0]))
    found = picture.probe(CAMERA)
    assert found.shape == (36, 64)
    assert (np.diff(found[:, 0]) < 0).all()  # bottom row first, and far is below here
    near, far = range_of(found)
    assert near == pytest.approx(2.0, abs=0.1)
    assert far == pytest.approx(5.0, abs=0.1)
    assert range_of(np.zeros((3, 3), np.float32)) == (0.0, 1.0)
    assert range_of(np.full((3, 3), 2.0, np.float32)) == (2.0, 2.02)


@pytest.mark.parametrize(
    ("size", "inner"),
    [((100, 100), (60, 20, 80, 80)), ((400, 100), (0, 35, 200, 50)), ((200, 80), (0, 20, 200, 80))],
)
def test_an_image_of_another_shape_is_seen_whole(
    size: tuple[int, int], inner: tuple[int, int, int, int]
) -> None:
    assert fitted((0, 20, 200, 80), size) == inner
