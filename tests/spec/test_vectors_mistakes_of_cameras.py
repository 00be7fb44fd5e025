"""The vectors tell common mistakes with cameras: lenses, pixels, and the way of a point."""

import math

import numpy as np
import pytest
from splatbus_wire.conventions import ENGINES
from splatbus_wire.rotations import rotation_matrix

from tests.spec.vector_files import chosen, doubles, intrinsics, is_near


def right(q):
    return np.reshape(rotation_matrix(tuple(q)), (3, 3))


# ---- intrinsics


def scaled_about_whole_centres(cx, ratio):
    return (cx - 0.5) * ratio


@pytest.mark.parametrize("mistake", [scaled_about_whole_centres, lambda cx, ratio: cx])
def test_scaled_principal_points_tell(mistake):
    answers = []
    for case in chosen("intrinsics", quantity="scaled"):
        given, expected = intrinsics(case["intrinsics"]), intrinsics(case["expected"])
        got = mistake(given["cx"], case["to"][0] / given["width"])
        answers.append(is_near("intrinsics", "scaled", got, expected["cx"]))
    assert not all(answers)


SHAPES = {
    "no rounding": lambda w, h, W, H: w * H == h * W,
    "a percent": lambda w, h, W, H: abs(w * H / (h * W) - 1) < 0.01,
    "the width of one image": lambda w, h, W, H: abs(w * H - h * W) < w,
    "the width of both": lambda w, h, W, H: abs(w * H - h * W) < max(w, W),
    "any shape": lambda w, h, W, H: True,
    "a pixel of either": lambda w, h, W, H: abs(w * H - h * W) <= max(w, h, W, H),
}


@pytest.mark.parametrize("mistake", SHAPES)
def test_shapes_tell(mistake):
    assert not all(
        SHAPES[mistake](*case["given"], *case["to"]) is case["expected"]["accepted"]
        for case in chosen("intrinsics", quantity="shape")
    )


@pytest.mark.parametrize("added", [0.0, 0.5])
def test_a_calibration_tells_where_half_a_pixel_is_added(added):
    """Left out, or added after scaling."""
    [calibration] = chosen("intrinsics", name="calibration: the middle of 640x480")
    [scaled] = chosen("intrinsics", name="scaled: a calibration, once half a pixel is added")
    assert scaled["intrinsics"] == calibration["expected"]
    given, expected = intrinsics(calibration["opencv"]), intrinsics(scaled["expected"])
    got = given["cx"] * scaled["to"][0] / given["width"] + added
    assert not is_near("intrinsics", "scaled", got, expected["cx"])


@pytest.mark.parametrize("centre", [0.0, 1.0])
def test_pixels_tell_where_centres_are(centre):
    answers = []
    for case in chosen("intrinsics", quantity="pixel"):
        u, v = case["pixel"]
        got = u + centre, v + centre
        answers.append(
            is_near("intrinsics", "image_point", got, doubles(case["expected"]["image_point"]))
        )
    assert not any(answers)


# ---- projections

IMAGES = {
    "y up": lambda K, x, y, z: (K["fx"] * x / z + K["cx"], -K["fy"] * y / z + K["cy"]),
    "fx for both": lambda K, x, y, z: (K["fx"] * x / z + K["cx"], K["fx"] * y / z + K["cy"]),
    "the middle of the image": lambda K, x, y, z: (
        K["fx"] * x / z + K["width"] / 2,
        K["fy"] * y / z + K["height"] / 2,
    ),
    "half a pixel more": lambda K, x, y, z: (
        K["fx"] * x / z + K["cx"] + 0.5,
        K["fy"] * y / z + K["cy"] + 0.5,
    ),
    "the distance for the depth": lambda K, x, y, z: (
        K["fx"] * x / math.hypot(x, y, z) + K["cx"],
        K["fy"] * y / math.hypot(x, y, z) + K["cy"],
    ),
}


@pytest.mark.parametrize("mistake", IMAGES)
def test_projections_tell(mistake):
    answers = []
    for case in chosen("projections", engine="wire"):
        K = intrinsics(case["intrinsics"])
        for point in case["expected"]["points"]:
            if point["image_point"] is not None:
                got = IMAGES[mistake](K, *doubles(point["camera"]))
                expected = doubles(point["image_point"])
                answers.append(is_near("projections", "image_point", got, expected))
    assert not all(answers)


def test_projections_tell_an_object_whose_scale_is_left_out():
    for case in chosen("projections", engine="unreal"):
        if case["object"]:
            R = right(doubles(case["expected"]["object"]["rotation"]))
            c = doubles(case["expected"]["object"]["position"])
            change = np.reshape(ENGINES["unreal"].camera, (3, 3))
            for point, seen in zip(case["points"], case["expected"]["points"], strict=True):
                got = R @ change.T @ doubles(point) + c
                assert not is_near("projections", "world", got, doubles(seen["world"]))


SCALES = {
    "left out": lambda s, R, p, c: R @ p + c,
    "taken twice": lambda s, R, p, c: s * s * (R @ p) + c,
    "the whole place is scaled": lambda s, R, p, c: s * (R @ p + c),
    "divided by": lambda s, R, p, c: (R @ p) / s + c,
}


@pytest.mark.parametrize("mistake", SCALES)
def test_projections_tell_the_scale_of_an_object(mistake):
    for case in chosen("projections", engine="wire", requirement="OBJ-5"):
        placed, points = (
            case["object"],
            zip(case["points"], case["expected"]["points"], strict=True),
        )
        R, c = right(doubles(placed["rotation"])), doubles(placed["position"])
        assert not all(
            is_near(
                "projections",
                "world",
                SCALES[mistake](float(doubles(placed["scale"])), R, doubles(point), c),
                doubles(seen["world"]),
            )
            for point, seen in points
        )


def test_projections_tell_single_precision():
    for case in chosen("projections", engine="wire"):
        if "million" not in case["name"]:
            continue
        pose, K = case["expected"]["camera"], intrinsics(case["intrinsics"])
        R = right(doubles(pose["rotation"])).astype(np.float32)
        t = -R.T @ doubles(pose["position"]).astype(np.float32)
        for point in case["expected"]["points"]:
            x, y, z = R.T @ doubles(point["world"]).astype(np.float32) + t
            got = K["fx"] * x / z + K["cx"], K["fy"] * y / z + K["cy"]
            assert not is_near("projections", "image_point", got, doubles(point["image_point"]))
