"""Rotations and views in exact arithmetic (spec 1.0 section 7.1, ACC-2 to ACC-5)."""

from collections.abc import Sequence
from fractions import Fraction

from splatbus_conformance.oracle.rounding import Real, exact, square_root

Vector = tuple[Fraction, ...]
Rows = tuple[tuple[Fraction, ...], ...]


def norm(q: Sequence[Real]) -> Fraction:
    """Return ‖q‖ of (x, y, z, w), to 400 bits."""
    return square_root(sum((a * a for a in exact(q)), Fraction(0)))


def rotation_matrix(q: Sequence[Real]) -> Rows:
    """Return the rows of the rotation of q/‖q‖, q = (x, y, z, w) Hamilton, exactly.

    Column j is q·eⱼ·q̄/‖q‖², the product written out; ZeroDivisionError for the zero quaternion.
    """
    q = exact(q)
    x, y, z, w = q
    inverse = (-x, -y, -z, w)
    square = product(q, inverse)[3]
    axes = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0))
    turned = [product(product(q, exact(axis)), inverse) for axis in axes]
    return tuple(tuple(column[i] / square for column in turned) for i in range(3))


def product(p: Sequence[Fraction], q: Sequence[Fraction]) -> Vector:
    """Return the Hamilton product p·q of (x, y, z, w) quaternions, exactly."""
    a, b, c, d = p
    e, f, g, h = q
    return (
        d * e + a * h + b * g - c * f,
        d * f - a * g + b * h + c * e,
        d * g + a * f - b * e + c * h,
        d * h - a * e - b * f - c * g,
    )


def transpose(M: Rows) -> Rows:
    """Return Mᵀ."""
    return tuple(zip(*M, strict=True))


def apply(M: Rows, v: Sequence[Fraction]) -> Vector:
    """Return M·v, exactly."""
    return tuple(sum((a * b for a, b in zip(row, v, strict=True)), Fraction(0)) for row in M)


def multiply(M: Rows, N: Rows) -> Rows:
    """Return M·N, exactly."""
    return transpose(tuple(apply(M, column) for column in transpose(N)))


def view_translation(position: Sequence[Real], q: Sequence[Real]) -> Vector:
    """Return t = −Rᵀ·c of a camera-to-world pose, exactly."""
    c = exact(position)
    return tuple(-a for a in apply(transpose(rotation_matrix(q)), c))


def view_matrix(position: Sequence[Real], q: Sequence[Real]) -> Rows:
    """Return the four rows of [Rᵀ | −Rᵀ·c] of a camera-to-world pose, exactly."""
    turned = transpose(rotation_matrix(q))
    moved = view_translation(position, q)
    upper = tuple((*row, t) for row, t in zip(turned, moved, strict=True))
    return (*upper, exact((0, 0, 0, 1)))


def quaternion_of(R: Rows) -> Vector:
    """Return a unit quaternion (x, y, z, w) of an exact rotation matrix, to 400 bits."""
    (a, b, c), (d, e, f), (g, h, i) = R
    columns = (
        (1 + a - e - i, d + b, c + g, h - f),
        (d + b, 1 + e - a - i, h + f, c - g),
        (c + g, h + f, 1 + i - a - e, d - b),
        (h - f, c - g, d - b, 1 + a + e + i),
    )
    longest = max(columns, key=lambda column: sum(entry * entry for entry in column))
    length = norm(longest)
    return tuple(entry / length for entry in longest)
