"""Lenses: intrinsics with the size of the image that they are about, and with another."""

from __future__ import annotations

from splatbus_wire.intrinsics import Pinhole
from splatbus_wire.messages import Intrinsics as Lens

from splatbus_server.view import Intrinsics

__all__ = ["Lens", "as_high", "fits", "lens_of", "scaled", "without_size"]


def lens_of(intrinsics: Intrinsics, width: int, height: int) -> Lens:
    """The intrinsics of an image of this size, in pixels."""
    fx, fy, cx, cy, near, far = intrinsics
    return Lens(fx, fy, cx, cy, width, height, near, far)


def without_size(lens: Lens) -> Intrinsics:
    """The intrinsics alone."""
    return Intrinsics(*lens[:4], *lens[6:])


def fits(lens: Lens, width: int, height: int) -> bool:
    """Whether an image of this size has the lens's shape [CAM-6]."""
    return Pinhole(*lens[:6]).has_shape_of(width, height)


def scaled(lens: Lens, width: int, height: int) -> Lens:
    """The lens that a client asked for, for an image of this size, each axis by itself [CAM-5]."""
    return Lens(*Pinhole(*lens[:6]).scaled_to(width, height), lens.near, lens.far)


def as_high(lens: Lens, width: int, height: int) -> Lens:
    """The same view, from its upper to its lower edge, for an image of this size.

    Pixels keep their shape, so that an image of another shape shows more or less at its sides, and
    the principal point its distance from the middle, in parts of the height.
    """
    ratio = height / lens.height
    return Lens(
        lens.fx * ratio,
        lens.fy * ratio,
        width / 2.0 + (lens.cx - lens.width / 2.0) * ratio,
        lens.cy * ratio,
        width,
        height,
        lens.near,
        lens.far,
    )
