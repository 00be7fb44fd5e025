"""The vectors tell common mistakes: whoever makes one fails at least one case of the file."""

import math

import numpy as np
import pytest
from splatbus_conformance.oracle import U, orthogonality_error
from splatbus_wire.conventions import ENGINES
from splatbus_wire.rotations import rotation_matrix

from tests.spec.vector_files import chosen, doubles, intrinsics, is_near, singles

# ---- poses


def plain_diagonal(q):
    x, y, z, w = q
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    )


def right(q):
    return np.reshape(rotation_matrix(tuple(q)), (3, 3))


def unnormalised(q):
    x, y, z, w = q
    return right(q) * (x * x + y * y + z * z + w * w)


def in_single(q):
    return plain_diagonal(np.asarray(q, np.float32)).astype(np.float32)


def turned(R):
    def view(position, q):
        matrix = R(q)
        return matrix.T, -matrix.T @ position

    return view


def general_inverse_in_single(position, q):
    camera = np.eye(4, dtype=np.float32)
    camera[:3, :3], camera[:3, 3] = right(q), position
    view = np.linalg.inv(camera)
    return view[:3, :3], view[:3, 3]


VIEWS = {
    "w is read first": turned(lambda q: right([q[1], q[2], q[3], q[0]])),
    "the quaternion is not normalised": turned(unnormalised),
    "the matrix is transposed": turned(lambda q: right(q).T),
    "the pose is taken for world-to-camera": lambda position, q: (right(q), position),
    "the camera moves the wrong way": lambda position, q: (right(q).T, right(q).T @ position),
    "single precision": turned(in_single),
    "a general inverse in single precision": general_inverse_in_single,
    "1 - s(y² + z²) on the diagonal": turned(plain_diagonal),
}


def view_is_right(view, case):
    position, q = doubles(case["pose"]["position"]), doubles(case["pose"]["rotation"])
    with np.errstate(over="ignore", invalid="ignore"):
        got = view(position, q)
    expected = doubles(case["expected"]["view_matrix"])[:3]
    return (
        is_near("poses", "view_rotation", got[0], expected[:, :3])
        and is_near("poses", "view_translation", got[1], expected[:, 3])
        and orthogonality_error(np.asarray(got[0], float).tolist()) <= 16 * U
    )


@pytest.mark.parametrize("mistake", VIEWS)
def test_poses_tell(mistake):
    cases = chosen("poses", verdict="accepted")
    assert all(view_is_right(turned(right), case) for case in cases)
    assert not all(view_is_right(VIEWS[mistake], case) for case in cases)


# ---- conventions


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("direction", ["from_wire", "to_wire"])
@pytest.mark.parametrize("part", ["position", "rotation"])
def test_conventions_tell_one_wrong_sign_and_any_two_that_are_swapped(name, direction, part):
    cases = chosen("conventions", engine=name, direction=direction)
    length = 3 if part == "position" else 4
    changes = [np.diag([-1.0 if i == j else 1.0 for i in range(length)]) for j in range(length)]
    identity = np.eye(length)
    changes += [
        identity[[j if k == i else i if k == j else k for k in range(length)]]
        for i in range(length)
        for j in range(i)
    ]
    for change in changes:
        answers = [change @ doubles(case["expected"][part]) for case in cases]
        pairs = zip(answers, cases, strict=True)
        assert not all(
            is_near("conventions", part, got, doubles(case["expected"][part]))
            for got, case in pairs
        ), change


@pytest.mark.parametrize(
    ("made", "of"),
    [("blender_object", "blender_camera"), ("opengl", "opengl_camera"), ("unity", "opengl")],
)
def test_conventions_tell_one_row_from_another(made, of):
    for direction in ("from_wire", "to_wire"):
        answers = chosen("conventions", engine=made, direction=direction)
        cases = chosen("conventions", engine=of, direction=direction)
        assert not all(
            is_near(
                "conventions",
                "rotation",
                doubles(got["expected"]["rotation"]),
                doubles(case["expected"]["rotation"]),
            )
            for got, case in zip(answers, cases, strict=True)
        )


@pytest.mark.parametrize("direction", ["from_wire", "to_wire"])
def test_conventions_tell_metres_from_centimetres(direction):
    for case in chosen("conventions", engine="unreal", direction=direction):
        expected = doubles(case["expected"]["position"])
        got = expected / 100 if direction == "from_wire" else expected * 100
        assert not is_near("conventions", "position", got, expected)


# ---- images


def stored(value, surface, empty=math.inf):
    return np.float32(value) if surface else np.float32(empty)


DEPTHS = {
    "1/d": ("harmonic", lambda d, A: stored(1 / d, A >= 1 / 255 and d > 0)),
    "d itself": ("harmonic", lambda d, A: stored(d, A >= 1 / 255 and d > 0)),
    "a cut on d": ("harmonic", lambda d, A: stored(A / d, A >= 1 / 255 and d > 1e-6)),
    "empty only where d is 0": ("harmonic", lambda d, A: stored(A / d, d != 0)),
    "no threshold of alpha": ("harmonic", lambda d, A: stored(A / d, A > 0 and d > 0)),
    "a reciprocal, and a product": (
        "harmonic",
        lambda d, A: stored(A * (np.float32(1) / d), A >= 1 / 255 and d > 0),
    ),
    "infinity where it overflows": (
        "harmonic",
        lambda d, A: stored(A / d, A >= 1 / 255 and 0 < d < math.inf),
    ),
    "D itself": ("expected", lambda D, A: stored(D, A >= 1 / 255 and D > 0)),
    "D times A": ("expected", lambda D, A: stored(D * A, A >= 1 / 255 and D > 0)),
    "a median divided by A": ("median", lambda z, A: stored(z / A, A >= 1 / 255 and z > 0)),
    "100 taken for empty": ("none", lambda z, A: stored(z, A >= 1 / 255 and z > 0 and z != 100)),
    "A is not looked at": ("none", lambda z, A: stored(z, z > 0)),
}
MEMBERS = {
    "harmonic": "inverse_depth",
    "expected": "accumulated_depth",
    "median": "depth",
    "none": "depth",
}


@pytest.mark.parametrize("mistake", DEPTHS)
def test_depths_tell(mistake):
    estimator, estimate = DEPTHS[mistake]
    answers = []
    for case in chosen("images", quantity="depth", estimator=estimator):
        alpha = np.float32(1) if case["alpha"] is None else singles(case["alpha"])[()]
        with np.errstate(all="ignore"):
            got = estimate(singles(case[MEMBERS[estimator]])[()], alpha)
        answers.append(is_near("images", "depth", got, doubles(case["expected"])))
    assert any(answers)
    assert not all(answers)


def blend(splat, z, under, behind, *, weigh=True, front=lambda z, behind, a: 0 < z < behind and a):
    alpha = splat[3]
    if not front(z, behind, alpha):
        return under
    return (alpha if weigh else np.float32(1)) * splat[:3] + (np.float32(1) - alpha) * under


COMPOSITES = {
    "premultiplied weighed again": ("premultiplied", lambda *given: blend(*given)),
    "straight not weighed": ("straight", lambda *given: blend(*given, weigh=False)),
    "NaN in front": (
        "straight",
        lambda *given: blend(*given, front=lambda z, b, a: not (z <= 0 or z >= b) and a),
    ),
    "0 in front": (
        "straight",
        lambda *given: blend(*given, front=lambda z, b, a: 0 <= z < b and a),
    ),
    "what is negative in front": (
        "straight",
        lambda *given: blend(*given, front=lambda z, b, a: z < b and a),
    ),
    "less or equal": (
        "straight",
        lambda *given: blend(*given, front=lambda z, b, a: 0 < z <= b and a),
    ),
    "alpha 0 blended": (
        "premultiplied",
        lambda *given: blend(*given, weigh=False, front=lambda z, b, a: 0 < z < b),
    ),
    "100 taken for empty": (
        "straight",
        lambda *given: blend(*given, front=lambda z, b, a: 0 < z < b and a and z != 100),
    ),
    "depth is not looked at": (
        "straight",
        lambda *given: blend(*given, front=lambda z, b, a: a),
    ),
}


@pytest.mark.parametrize("mistake", COMPOSITES)
def test_composites_tell(mistake):
    alpha, composite = COMPOSITES[mistake]
    answers = []
    members = ("splat", "splat_depth", "background", "background_depth")
    for case in chosen("images", quantity="composite", alpha=alpha, depth_empty=None):
        with np.errstate(all="ignore"):
            got = composite(*(singles(case[member])[()] for member in members))
        answers.append(is_near("images", "colour", got, doubles(case["expected"])))
    assert any(answers)
    assert not all(answers)


PLACES = {
    "rows from the top": lambda m, column, row: m["offsetColor"] + row * m["pitchColor"],
    "32 bits": lambda m, column, row: (
        (m["offsetColor"] + (m["h"] - 1 - row) * m["pitchColor"] + 16 * column) & 0xFFFFFFFF
    ),
    "no offset": lambda m, column, row: (m["h"] - 1 - row) * m["pitchColor"] + 16 * column,
}


@pytest.mark.parametrize("mistake", PLACES)
def test_places_tell(mistake):
    answers = [
        PLACES[mistake](case["meta"], *case["pixel"]) == case["expected"]["color_byte"]
        for case in chosen("images", quantity="place", ring=None)
    ]
    assert not all(answers)


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


# ---- numbers


@pytest.mark.parametrize("spell", ["{:.6g}", "{:.8g}", "{:.6f}"])
def test_printed_numbers_tell_too_few_digits(spell):
    held = [
        np.float32(float(spell.format(float(doubles(case["value"]))))) == doubles(case["value"])
        for case in chosen("numbers", verdict="printed", precision="single")
    ]
    assert any(held)
    assert not all(held)


def test_printed_numbers_tell_the_shortest_digits_of_a_single():
    missed = []
    for case in chosen("numbers", verdict="printed", precision="single"):
        value = singles(case["value"])[()]
        read_as_double = float(np.format_float_scientific(value, unique=True))
        if np.float32(read_as_double) != value:
            missed.append(float(value))
    assert missed == [7.038530691851209e-26]
