"""Poses that break one of POS-1 to POS-3, each otherwise like a good one far from where it would
be: whoever applies any part of it moves the camera.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.lenient_json import shorten
from splatbus_conformance.messages import Json, encode

BEYOND = 3.4028236e38
NO_NUMBERS: tuple[Any, ...] = (
    *(None, True, False, "", " ", "one", "nan", "Infinity", "0x1", "1_0", " 1 ", "1,5", "+1", ".5"),
    *([], [1.5], {}, {"x": 1.5}),
)
NORMS = (0.0, 1e-200, 1e-30, 0.5, 0.9899, 1.0101, 2.0, 1e30, 1e200)


class BrokenPose(NamedTuple):
    """A message, and what is wrong with it."""

    requirement: str
    what: str
    message: Json

    @property
    def payload(self) -> bytes:
        """The message as it is sent."""
        return encode(self.message)


def broken_poses(good: Json) -> list[BrokenPose]:
    """Every way to break the pose `good` without breaking its text."""
    families = (_without, _mistyped, _too_far, _no_rotation)
    return [broken for family in families for broken in family(good)]


def _changed(good: Json, part: str, member: str, value: Any) -> Json:
    return good | {part: good[part] | {member: value}}


def _without(good: Json) -> Iterator[BrokenPose]:
    for part in ("position", "rotation"):
        absent = {name: value for name, value in good.items() if name != part}
        yield BrokenPose("POS-1", f"no {part}", absent)
        for member in good[part]:
            less = {name: value for name, value in good[part].items() if name != member}
            yield BrokenPose("POS-1", f"no {member} in {part}", good | {part: less})
            renamed = {
                name.upper() if name == member else name: v for name, v in good[part].items()
            }
            what = f"{member.upper()} for {member} in {part}"
            yield BrokenPose("POS-1", what, good | {part: renamed})


def _mistyped(good: Json) -> Iterator[BrokenPose]:
    for part in ("position", "rotation"):
        lists = (list(good[part].values()), [good[part]])
        strange: tuple[Any, ...] = (None, True, 0, "x", [], {}, *lists)
        for value in strange:
            what = f"{part} {shorten(repr(value))}"
            yield BrokenPose("POS-1", what, good | {part: value})
        for number, value in enumerate(NO_NUMBERS):
            member = list(good[part])[number % len(good[part])]
            what = f"{value!r} for {member} of {part}"
            yield BrokenPose("POS-1", what, _changed(good, part, member, value))


def _too_far(good: Json) -> Iterator[BrokenPose]:
    for member in "xyz":
        for value in (BEYOND, -BEYOND, 1e39, -1e300, 10**39):
            what = f"{value:g} for {member} of position"
            yield BrokenPose("POS-2", what, _changed(good, "position", member, value))


def _no_rotation(good: Json) -> Iterator[BrokenPose]:
    numbers = good["rotation"]
    norm = math.hypot(*numbers.values())
    for wanted in NORMS:
        scaled = {name: value * wanted / norm for name, value in numbers.items()}
        tolerance = LIMITS["rotation_norm_tolerance"]
        what = f"a rotation of norm {wanted:g}, which is further than {tolerance} from 1"
        yield BrokenPose("POS-3", what, good | {"rotation": scaled})
    halves = {"x": 0.5, "y": 0.5, "z": 0.0, "w": 0.0}
    yield BrokenPose("POS-3", "the rotation (½, ½, 0, 0)", good | {"rotation": halves})
