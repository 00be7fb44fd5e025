"""The vectors tell common mistakes: whoever makes one fails at least one case of the file."""

import math

import numpy as np
import pytest
from splatbus_conformance.oracle import U, orthogonality_error
from splatbus_wire.conventions import ENGINES
from splatbus_wire.rotations import rotation_matrix

from tests.spec.vector_files import chosen, doubles, is_near, singles

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
