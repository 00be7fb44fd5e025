"""Mutants that break POS: poses."""

import itertools

from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_1.neg.clients import without


def _camera(patch, change):
    messages(patch, of_type("camera_pose", change))


def _rotation(scale):
    return dict(zip("xyzw", (0.0, 0.0, 0.0, scale), strict=True))


@mutant("POS-1", code="missing-member")
def pose_without_rotation(patch):
    """Leaves the rotation out."""
    _camera(patch, without("rotation"))


@mutant("POS-1", code="not-an-object")
def position_as_an_array(patch):
    """Writes the position as an array."""
    _camera(patch, lambda pose: pose | {"position": [0.0, 0.0, 0.0]})


@mutant("POS-1", code="missing-member")
def rotation_without_w(patch):
    """Writes only the vector part of the quaternion."""
    _camera(patch, lambda pose: pose | {"rotation": without("w")(pose["rotation"])})


@mutant("POS-2", code="out-of-range")
def position_beyond_single_precision(patch):
    """Sends a position that no single-precision number can hold."""
    _camera(patch, lambda pose: pose | {"position": {"x": 3.5e38, "y": 0.0, "z": 0.0}})


@mutant("POS-3", code="not-unit-norm")
def rotation_that_is_no_unit(patch):
    """Sends a quaternion of norm 1.02."""
    _camera(patch, lambda pose: pose | {"rotation": _rotation(1.02)})


@mutant("POS-3", code="not-unit-norm")
def zero_quaternion(patch):
    """Sends the quaternion of a variable that nobody initialised."""
    _camera(patch, lambda pose: pose | {"rotation": _rotation(0.0)})


@mutant("POS-4", code="wrong-order")
def rotation_with_w_first(patch):
    """Writes the quaternion's members in the order w, x, y, z."""
    _camera(
        patch, lambda pose: pose | {"rotation": {name: pose["rotation"][name] for name in "wxyz"}}
    )


@mutant("POS-8", code="not-a-number")
def timestamp_as_a_string(patch):
    """Writes the timestamp as a date."""
    _camera(patch, lambda pose: pose | {"timestamp": "2024-05-04T12:00:00Z"})


@mutant("POS-9", code="went-back")
def timestamps_that_go_back(patch):
    """Counts timestamps down."""
    seconds = itertools.count(1000.0, -0.5)
    _camera(patch, lambda pose: pose | {"timestamp": next(seconds)})
