"""Changes of axes in exact arithmetic, from matrices alone (spec 1.0 section 7.2, ACC-7).

Only B, D and the scale of an engine are stated; its quaternions follow from them, so that a slip
in the quaternion columns of the table cannot hide here.
"""

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import NamedTuple

from splatbus_conformance.oracle.rotations import (
    Rows,
    Vector,
    apply,
    multiply,
    product,
    quaternion_of,
    transpose,
)
from splatbus_conformance.oracle.rounding import Real, exact


class Engine(NamedTuple):
    """Axes of one engine: p' = scale·B·p and R' = B·R·Dᵀ."""

    world: Rows
    """B, the change of world axes, a signed permutation."""
    camera: Rows
    """D, the change of the camera's (object's) own axes; its determinant is that of B."""
    scale: int | Fraction
    """Units of the engine per scene unit."""

    def position_from_wire(self, position: Sequence[Real]) -> Vector:
        """Return scale·B·p."""
        return tuple(self.scale * a for a in apply(self.world, exact(position)))

    def position_to_wire(self, position: Sequence[Real]) -> Vector:
        """Return Bᵀ·p'/scale."""
        return tuple(a / self.scale for a in apply(transpose(self.world), exact(position)))

    def matrix_from_wire(self, R: Sequence[Sequence[Real]]) -> Rows:
        """Return R' = B·R·Dᵀ."""
        rows = tuple(exact(row) for row in R)
        return multiply(multiply(self.world, rows), transpose(self.camera))

    def matrix_to_wire(self, R: Sequence[Sequence[Real]]) -> Rows:
        """Return R = Bᵀ·R'·D."""
        rows = tuple(exact(row) for row in R)
        return multiply(multiply(transpose(self.world), rows), self.camera)

    def quaternion_from_wire(self, q: Sequence[Real]) -> Vector:
        """Return the quaternion (x, y, z, w) of B·R·Dᵀ, of the norm of q.

        B·R·Dᵀ = (B·R·Bᵀ)·(B·Dᵀ): the first has the quaternion (det(B)·B·v, w).
        """
        *v, w = exact(q)
        turned = (*(self._hand * a for a in apply(self.world, v)), w)
        return product(turned, self._turn)

    def quaternion_to_wire(self, q: Sequence[Real]) -> Vector:
        """Return the quaternion (x, y, z, w) of Bᵀ·R'·D, of the norm of q."""
        x, y, z, w = self._turn
        *v, w = product(exact(q), (-x, -y, -z, w))
        return (*(self._hand * a for a in apply(transpose(self.world), v)), w)

    @property
    def _hand(self) -> Fraction:
        (a, b, c), (d, e, f), (g, h, i) = self.world
        return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)

    @property
    def _turn(self) -> Vector:
        return _turn(self.world, self.camera)


@cache
def _turn(world: Rows, camera: Rows) -> Vector:
    return quaternion_of(multiply(world, transpose(camera)))


def _rows(*rows: Sequence[int]) -> Rows:
    return tuple(exact(row) for row in rows)


_SAME = _rows((1, 0, 0), (0, 1, 0), (0, 0, 1))
_DOWN_IS_UP = _rows((1, 0, 0), (0, -1, 0), (0, 0, 1))
_LOOKS_BACKWARD = _rows((1, 0, 0), (0, -1, 0), (0, 0, -1))
_UNREAL = _rows((0, 0, 1), (1, 0, 0), (0, -1, 0))
_BLENDER = _rows((1, 0, 0), (0, 0, 1), (0, -1, 0))

ENGINES = {
    "unity": Engine(_DOWN_IS_UP, _DOWN_IS_UP, 1),
    "unreal": Engine(_UNREAL, _UNREAL, 100),
    "blender_object": Engine(_BLENDER, _BLENDER, 1),
    "blender_camera": Engine(_BLENDER, _LOOKS_BACKWARD, 1),
    "opengl": Engine(_LOOKS_BACKWARD, _LOOKS_BACKWARD, 1),
    "opengl_camera": Engine(_SAME, _LOOKS_BACKWARD, 1),
}
