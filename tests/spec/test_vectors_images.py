"""What the wire and the reference pair make of the vectors for images, intrinsics, projections."""

import math

import numpy as np
import pytest
from splatbus_conformance.images import pinhole
from splatbus_server.publish import Publisher
from splatbus_server.source import source
from splatbus_viewer import display
from splatbus_wire.compositing import over_premultiplied, over_straight
from splatbus_wire.conventions import ENGINES
from splatbus_wire.depth import expected_depth, planar_depth, surface_depth
from splatbus_wire.init_packet import Slots
from splatbus_wire.intrinsics import Pinhole, from_opencv, pixel_at, pixel_centre
from splatbus_wire.messages import FrameCamera
from splatbus_wire.poses import IDENTITY, Pose, as_array, view_matrix, world_matrix
from splatbus_wire.relative import object_to_camera, relative_view
from splatbus_wire.semantics import Semantics

from tests.spec.vector_files import cases, chosen, doubles, intrinsics, is_near, singles

# ---- depth

ESTIMATES = {
    "harmonic": ("inverse_depth", planar_depth),
    "expected": ("accumulated_depth", expected_depth),
    "median": ("depth", surface_depth),
    "none": ("depth", surface_depth),
}


@cases("images", quantity="depth")
@pytest.mark.parametrize("empty", [math.inf, 100.0])
def test_the_wire_finds_the_depth(case, empty):
    member, estimate = ESTIMATES[case["estimator"]]
    alpha = case["alpha"] and singles(case["alpha"])
    expected = doubles(case["expected"])
    got = estimate(singles(case[member]), alpha, empty=empty)
    assert got.dtype == np.float32
    assert is_near("images", "depth", got, empty if expected == math.inf else expected)


@pytest.mark.parametrize("estimator", list(ESTIMATES))
@pytest.mark.parametrize("with_alpha", [True, False])
def test_the_reference_server_publishes_the_depth(estimator, with_alpha):
    """All cases side by side in one row, as an image has them."""
    row = [
        case
        for case in chosen("images", quantity="depth", estimator=estimator)
        if (case["alpha"] is not None) == with_alpha
    ]
    member, _ = ESTIMATES[estimator]
    given = np.array([[singles(case[member]) for case in row]])
    alpha = np.array([[singles(case["alpha"]) for case in row]]) if with_alpha else None
    expected = [[doubles(case["expected"]) for case in row]]
    slot = np.zeros((1, len(row)), np.float32)
    kinds = {"harmonic": "inverse", "expected": "accumulated", "median": "linear", "none": "linear"}
    color = np.zeros((1, len(row), 3), np.float32)
    image = source(color, given, alpha, kinds[estimator], len(row), 1, premultiplied=False)
    Publisher(len(row), 1).write(image, None, slot)
    assert is_near("images", "depth", slot, expected)


@cases("images", quantity="layers")
def test_what_a_renderer_accumulates_leads_to_each_estimate(case):
    left, alpha, inverse, depth, median = 1.0, 0.0, 0.0, 0.0, math.nan
    for layer in case["layers"]:
        z, a = float(doubles(layer["depth"])), float(doubles(layer["alpha"]))
        median = z if left > 0.5 else median
        alpha, inverse, depth = alpha + left * a, inverse + left * a / z, depth + left * a * z
        left *= 1.0 - a
    got = {
        "alpha": alpha,
        "inverse_depth": inverse,
        "accumulated_depth": depth,
        "harmonic": alpha / inverse,
        "expected": depth / alpha,
        "median": median,
    }
    for quantity, value in got.items():
        assert is_near("images", "layers", value, doubles(case["expected"][quantity]))


# ---- composites


def pixels(case):
    members = ("splat", "splat_depth", "background", "background_depth")
    return [singles(case[member])[np.newaxis, np.newaxis] for member in members]


@cases("images", quantity="composite", depth_empty=None)
def test_the_wire_composites(case):
    blend = over_straight if case["alpha"] == "straight" else over_premultiplied
    [[got]] = blend(*pixels(case))
    assert is_near("images", "colour", got, doubles(case["expected"]))


@cases("images", quantity="composite")
def test_the_reference_client_composites(case):
    color, depth, background, behind = pixels(case)
    empty = float(doubles(case["depth_empty"])) if "depth_empty" in case else math.inf
    semantics = Semantics(alpha=case["alpha"], depth_empty=empty)
    camera = FrameCamera(IDENTITY, 1.0, 1.0, 0.5, 0.5, 1, 1, 0.01, 100.0)
    [[got]] = display.composed(color, depth, camera, semantics, background, behind)
    assert is_near("images", "colour", got, doubles(case["expected"]))


# ---- places


@cases("images", quantity="place")
def test_the_pixel_lies_where_the_packet_says(case):
    meta, (column, row) = case["meta"], case["pixel"]
    color, depth = meta.get("offsetColor", 0), meta.get("offsetDepth", 0)
    if "ring" in case:
        ring = Slots(*case["ring"].values())
        color = ring.color_offset + case["slot"] * ring.color_stride
        depth = ring.depth_offset + case["slot"] * ring.depth_stride
    below = meta["h"] - 1 - row
    assert case["expected"] == {
        "memory_row": below,
        "color_byte": color + below * meta["pitchColor"] + 16 * column,
        "depth_byte": depth + below * meta["pitchDepth"] + 4 * column,
    }


# ---- intrinsics


def camera(stated):
    return Pinhole(**intrinsics(stated))


@cases("intrinsics", quantity="scaled")
def test_the_wire_scales_intrinsics(case):
    got, expected = camera(case["intrinsics"]).scaled_to(*case["to"]), camera(case["expected"])
    assert is_near("intrinsics", "scaled", got, expected)


@cases("intrinsics", quantity="shape")
def test_the_wire_tells_another_shape_from_rounding(case):
    given = Pinhole(1.0, 1.0, 0.0, 0.0, *case["given"])
    assert given.has_shape_of(*case["to"]) is case["expected"]["accepted"]


@cases("intrinsics", quantity="calibration")
def test_the_wire_reads_calibrations(case):
    got = from_opencv(**intrinsics(case["opencv"]))
    assert is_near("intrinsics", "calibration", got, camera(case["expected"]))


@cases("intrinsics", quantity="pixel")
def test_the_wire_knows_the_centre_of_a_pixel(case):
    seen, (column, row) = camera(case["intrinsics"]), case["pixel"]
    expected = {quantity: doubles(value) for quantity, value in case["expected"].items()}
    u, v = pixel_centre(column, row)
    device = (2 * u - seen.width) / seen.width, (seen.height - 2 * v) / seen.height
    assert is_near("intrinsics", "image_point", (u, v), expected["image_point"])
    assert is_near("intrinsics", "ray", seen.ray(u, v), expected["ray"])
    assert is_near("intrinsics", "device_point", device, expected["device_point"])


SMALL = [
    case for case in chosen("intrinsics", quantity="pixel") if case["intrinsics"]["width"] < 1000
]


@pytest.mark.parametrize("case", SMALL, ids=lambda case: case["name"])
def test_all_rays_of_an_image_at_once_are_the_same(case):
    seen, (column, row) = camera(case["intrinsics"]), case["pixel"]
    expected = doubles(case["expected"]["ray"])
    frame = FrameCamera(IDENTITY, *seen, 0.01, 100.0)
    judged = pinhole.Camera(pinhole.Rigid(), *seen, 0.01, 100.0)
    for rays in (seen.rays(), display.rays(frame), judged.rays()):
        assert rays.shape == (seen.height, seen.width, 3)
        assert is_near("intrinsics", "ray", rays[row, column], expected)


@cases("intrinsics", quantity="image_point")
def test_the_wire_finds_the_pixel(case):
    got = pixel_at(tuple(doubles(case["image_point"])), *case["size"])
    assert got == (case["expected"]["pixel"] and tuple(case["expected"]["pixel"]))


@cases("intrinsics", quantity="ray_distance")
def test_a_distance_along_a_ray_becomes_planar_depth(case):
    seen, distance = camera(case["intrinsics"]), singles(case["distance"])
    expected = doubles(case["expected"]["planar_depth"])
    ray = seen.ray(*pixel_centre(*case["pixel"]))
    got = np.float32(distance.astype(float) / np.linalg.norm(ray))
    assert is_near("intrinsics", "planar_depth", got, expected)


# ---- projections


def engine_pose(value):
    return Pose(*(tuple(doubles(value[part]).tolist()) for part in ("position", "rotation")))


def on_wire(row, pose):
    return pose if row == "wire" else ENGINES[row].to_wire(pose)


@cases("projections")
def test_the_wire_projects(case):
    expected = case["expected"]
    pose = on_wire(case["engine"], engine_pose(case["camera"]))
    assert_same_pose(pose, expected["camera"])
    placed = None
    if case["object"]:
        placed = on_wire(case["object"]["engine"], engine_pose(case["object"]))
        assert_same_pose(placed, expected["object"])
    for point, right in zip(case["points"], expected["points"], strict=True):
        world = in_world(case, doubles(point), placed)
        assert is_near("projections", "world", world, doubles(right["world"]))
        before = (as_array(view_matrix(pose)) @ [*world, 1.0])[:3]
        assert is_near("projections", "camera", before, doubles(right["camera"]))
        got = camera(case["intrinsics"]).project(before)
        if right["image_point"] is None:
            assert np.isnan(got).all()
        else:
            assert is_near("projections", "image_point", got, doubles(right["image_point"]))


@cases("projections")
def test_the_camera_relative_view_projects(case):
    """In single precision even, where points were counted from the camera in double precision."""
    pose = on_wire(case["engine"], engine_pose(case["camera"]))
    placed = case["object"] and on_wire(case["object"]["engine"], engine_pose(case["object"]))
    points = [on_wire_axes(case, doubles(point)) for point in case["points"]]
    view = relative_view(points, pose, placed or IDENTITY)
    seen = camera(case["intrinsics"])
    matrix = np.reshape(object_to_camera(pose, placed or IDENTITY), (4, 4))
    exact = matrix @ [*np.transpose(points), [1] * len(points)]
    right = [point["image_point"] for point in case["expected"]["points"]]
    for place, single, expected in zip(
        seen.project(exact[:3].T),
        seen.project(view.points @ view.matrix[:3, :3].T),
        right,
        strict=True,
    ):
        if expected is None:
            assert np.isnan([*place, *single]).all()
        else:
            assert is_near("projections", "image_point", place, doubles(expected))
            assert np.abs(single - doubles(expected)).max() < 0.005


def assert_same_pose(got, expected):
    assert is_near("projections", "position", got.position, doubles(expected["position"]))
    assert is_near("projections", "rotation", got.rotation, doubles(expected["rotation"]))


def in_world(case, point, placed):
    point = on_wire_axes(case, point)
    return (as_array(world_matrix(placed)) @ [*point, 1.0])[:3] if placed else point


def on_wire_axes(case, point):
    """A point of the engine's world, or of the object's own axes, in those of the wire."""
    placed = case["object"] or {}
    row = placed.get("engine", case["engine"])
    size = float(doubles(placed["scale"])) if "scale" in placed else 1.0
    if row == "wire":
        return size * point
    engine = ENGINES[row]
    change = np.reshape(engine.camera if placed else engine.world, (3, 3))
    return size * (change.T @ point / engine.scale)
