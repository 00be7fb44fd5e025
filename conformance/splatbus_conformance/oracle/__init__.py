"""The judge's own arithmetic: exact rational numbers, rounded once, sharing no code with the wire.

Every function takes floats as the exact numbers that they are, and returns `Fraction`s; square
roots are good to 400 bits. `rounding` makes doubles and singles of them.
"""

from splatbus_conformance.oracle.axes import ENGINES, Engine
from splatbus_conformance.oracle.deviation import (
    U,
    angle_between,
    error_in_u,
    norm_error,
    orthogonality_error,
    ulps,
)
from splatbus_conformance.oracle.images import (
    accumulate,
    composite,
    expected_depth,
    planar_depth,
    surface_depth,
)
from splatbus_conformance.oracle.intrinsics import Intrinsics
from splatbus_conformance.oracle.rotations import (
    norm,
    rotation_matrix,
    view_matrix,
    view_translation,
)
from splatbus_conformance.oracle.rounding import (
    SINGLE_MAX,
    exact,
    square_root,
    to_double,
    to_single,
)

__all__ = [
    "ENGINES",
    "Engine",
    "U",
    "angle_between",
    "error_in_u",
    "norm_error",
    "orthogonality_error",
    "ulps",
    "accumulate",
    "composite",
    "expected_depth",
    "planar_depth",
    "surface_depth",
    "Intrinsics",
    "norm",
    "rotation_matrix",
    "view_matrix",
    "view_translation",
    "SINGLE_MAX",
    "exact",
    "square_root",
    "to_double",
    "to_single",
]
