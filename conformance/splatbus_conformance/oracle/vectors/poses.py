"""`poses.json`: poses, and the matrices that a renderer wants of them."""

from collections.abc import Sequence
from fractions import Fraction

from splatbus_conformance.oracle.deviation import U
from splatbus_conformance.oracle.rotations import rotation_matrix, view_matrix
from splatbus_conformance.oracle.vectors.layout import Json, both, pose, within

HALF = 0.7071067811865476
WORKED = (-0.1, 0.2, -0.3, 0.9273618495495703)
IDENTITY = (0.0, 0.0, 0.0, 1.0)

POSES = {
    "identity": ((0.0, 0.0, 0.0), IDENTITY),
    "a position alone": ((1.0, -2.0, 5.0), IDENTITY),
    "a quarter turn about x": ((1.0, 2.0, 3.0), (HALF, 0.0, 0.0, HALF)),
    "a quarter turn about y": ((1.0, 2.0, 3.0), (0.0, HALF, 0.0, HALF)),
    "a quarter turn about z": ((1.0, 2.0, 3.0), (0.0, 0.0, HALF, HALF)),
    "a half turn about x": ((1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0)),
    "a half turn about y": ((1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0)),
    "a half turn about z, with minus zeros": ((-0.0, 2.0, 3.0), (-0.0, -0.0, 1.0, -0.0)),
    "a third of a turn about (1, 1, 1)": ((1.0, 2.0, 3.0), (0.5, 0.5, 0.5, 0.5)),
    "the worked example of section 7.3": ((1.0, -2.0, 5.0), WORKED),
    "its negative, the same rotation": ((1.0, -2.0, 5.0), (0.1, -0.2, 0.3, -0.9273618495495703)),
    "nearly no turn": ((1.0, -2.0, 5.0), (1e-9, -2e-9, 1e-12, 1.0)),
    "nearly a half turn": ((1.0, -2.0, 5.0), (0.36, -0.48, 0.8, 1e-9)),
    "a norm of 1.009": ((1.0, -2.0, 5.0), (-0.1009, 0.2018, -0.3027, 0.9357081061955164)),
    "a norm of 0.991": ((1.0, -2.0, 5.0), (-0.0991, 0.1982, -0.2973, 0.9190155929036242)),
    "singles, printed with all their digits": (
        (-1.0153546333312988, 1.9981561899185181, -2.4972836971282959),
        (0.085831651177431, 0.17298739339250895, -0.015134345903133862, 0.98106026219040698),
    ),
    "near the origin": ((0.001, -0.002, 5e-324), WORKED),
    "a kilometre away": ((707.106, -12.5, -707.107), WORKED),
    "a million units away": ((1e6, -1e6, 1e6), (0.36, -0.48, 0.8, 1e-9)),
    "far along one axis, near along another": ((1e9, 0.001, -3.0), (0.1, 0.7, -0.1, 0.7)),
    "as far as POS-2 allows": ((3.4028234663852886e38, -1.0, 0.0), WORKED),
    "a subnormal position": ((5e-324, -2.2e-308, 0.0), WORKED),
    "a norm of 1.0099": ((1.0, -2.0, 5.0), (0.0, 0.60594, -0.80792, 0.0)),
    "a norm of 0.9901": ((1.0, -2.0, 5.0), (0.0, 0.59406, -0.79208, 0.0)),
    "a half turn about a diagonal": ((1.0, 2.0, 3.0), (0.0, HALF, HALF, -0.0)),
    "a half turn, and a subnormal more": ((1.0, 2.0, 3.0), (0.6, 0.0, 0.8, 5e-324)),
    "where 1 - s(y² + z²) loses digits": (
        (1.0, -2.0, 5.0),
        (-0.001679857130093146, 0.8105190822669939, 0.5862386132455417, -0.0009542649806552684),
    ),
    "where 1 - s(y² + z²) loses digits, again": (
        (1.0, -2.0, 5.0),
        (-0.7142254160634234, 0.708424877744617, 0.012598090850222975, 1.0274872004014964e-05),
    ),
    "where 1 - s(y² + z²) loses digits, about x and y": (
        (-3.0, 1.0, 2.0),
        (0.7080916218046034, 0.7084141741311736, -0.01850032608345227, 1.0048220438809929e-08),
    ),
    "where 1 - s(x² + z²) loses digits, about y": (
        (7.0, -5.0, 3.0),
        (-0.003066021279409015, 1.0001740825831513, 0.017486229539117538, -5.849537083236257e-07),
    ),
}

REJECTED = {
    "a norm of 1.0101": ("POS-3", (1.0, -2.0, 5.0), (0.0, 0.60606, -0.80808, 0.0)),
    "a norm of 0.9899": ("POS-3", (1.0, -2.0, 5.0), (0.0, 0.59394, -0.79192, 0.0)),
    "a norm of 2": ("POS-3", (1.0, -2.0, 5.0), (1.0, -1.0, 1.0, -1.0)),
    "no rotation at all": ("POS-3", (1.0, -2.0, 5.0), (0.0, 0.0, 0.0, 0.0)),
    "minus nothing": ("POS-3", (1.0, -2.0, 5.0), (-0.0, -0.0, -0.0, -0.0)),
    "a norm whose square overflows": ("POS-3", (1.0, -2.0, 5.0), (1e160, 0.0, 0.0, 1e160)),
    "a norm whose square is lost": ("POS-3", (1.0, -2.0, 5.0), (1e-170, 0.0, 0.0, 1e-170)),
    "the largest double": ("POS-3", (1.0, -2.0, 5.0), (0.0, 0.0, 0.0, 1.7976931348623157e308)),
    "the least double": ("POS-3", (1.0, -2.0, 5.0), (0.0, 0.0, 0.0, 5e-324)),
    "farther than POS-2 allows": ("POS-2", (3.402823466385289e38, 0.0, 0.0), IDENTITY),
    "much farther": ("POS-2", (0.0, -1.7976931348623157e308, 0.0), IDENTITY),
}


def document() -> Json:
    """Return the whole file."""
    return {
        "$schema": "vectors.schema.json",
        "name": "poses",
        "version": "1.0",
        "description": "Poses as they stand on the wire, camera-to-world, and what follows from"
        " them: the rotation matrix R of q/‖q‖, the view matrix [Rᵀ | −Rᵀ·c] and the camera's"
        " centre. Matrices are lists of rows and multiply column vectors. `rejected`: the former"
        " pose stays.",
        "requirements": ["CNV-1", "CNV-3", "ACC-2", "ACC-4", "ACC-5", "POS-2", "POS-3"],
        "tolerances": {
            "rotation_matrix": within(
                "component", 9 * U, "ACC-2", "8u, and 1u for the rounding of what is expected."
            ),
            "view_rotation": within(
                "component", 9 * U, "ACC-2", "The first three columns of the view matrix, likewise."
            ),
            "view_translation": within(
                "norm",
                9 * U,
                "ACC-4",
                "The last column of the view matrix: 8u, and 1u for the rounding of what is"
                " expected.",
            ),
            "camera_centre": within(
                "norm", 3e-15, "ACC-5", "−R·t of the view matrix that was computed."
            ),
        },
        "cases": [
            *[_case(name, *given) for name, given in POSES.items()],
            *[_rejected(name, *given) for name, given in REJECTED.items()],
        ],
    }


def _case(name: str, position: Sequence[float], rotation: Sequence[float]) -> Json:
    exact_view: Sequence[Sequence[Fraction]] = view_matrix(position, rotation)
    return {
        "name": name,
        "verdict": "accepted",
        "pose": pose(position, rotation),
        "expected": {
            "rotation_matrix": both(rotation_matrix(rotation)),
            "view_matrix": both(exact_view),
            "camera_centre": both(position),
        },
    }


def _rejected(
    name: str, requirement: str, position: Sequence[float], rotation: Sequence[float]
) -> Json:
    return {
        "name": f"rejected: {name}",
        "requirement": requirement,
        "verdict": "rejected",
        "pose": pose(position, rotation),
    }
