"""Lenses: intrinsics with the size of the image that they are about, and for another [IMG-1]."""

from __future__ import annotations

from splatbus_wire.intrinsics import Pinhole
from splatbus_wire.messages import Intrinsics as Lens

__all__ = ["Lens", "as_high", "fits", "scaled"]


def fits(lens: Lens, width: int, height: int) -> bool:
    """Whether an image of this size has the lens's shape [CAM-6]."""
    return Pinhole(*lens[:6]).has_shape_of(width, height)


def scaled(lens: Lens, width: int, height: int) -> Lens:
    """The lens that a client asked for, for an image of this size, each axis by itself [CAM-5]."""
    return Lens(*Pinhole(*lens[:6]).scaled_to(width, height), lens.near, lens.far)


def as_high(lens: Lens, width: int, height: int) -> Lens:
    """The same view, from its upper to its lower edge, for an image of this size."""
    return Lens(*Pinhole(*lens[:6]).as_high(width, height), lens.near, lens.far)
