"""Poses that break one of POS-1 to POS-3, each otherwise like a good one far from where it would
be: whoever applies any part of it moves the camera.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.messages import Json, encode

MOST: float = LIMITS["max_position"]
BEYOND = math.nextafter(MOST, math.inf)
"""Rounds to the greatest number of single precision, and is no valid one."""
NO_NUMBERS: tuple[Any, ...] = (
    *(None, True, False, "", " ", "one", "nan", "Infinity", "0x1", "1_0", " 1 ", "1,5", "+1", ".5"),
    *([], [1.5], {}, {"x": 1.5}),
)
BESIDE = 1e-9
"""How far a norm is from its limit that is next to it: well beyond what double precision rounds, in
which numbers are read (ACC-14), and well within what a limit is rounded to by mistake."""
TOLERANCE: float = LIMITS["rotation_norm_tolerance"]
BEYOND_NORMS = (1.0 - TOLERANCE - BESIDE, 1.0 + TOLERANCE + BESIDE)
WITHIN_NORMS = (1.0 - TOLERANCE + BESIDE, 1.0 + TOLERANCE - BESIDE)
NORMS = (0.0, 1e-200, 1e-30, 0.5, *BEYOND_NORMS, 2.0, 1e30, 1e200)


class BrokenPose(NamedTuple):
    """A message, and what is wrong with it."""

    requirement: str
    what: str
    message: Json
    kind: str
    """What it is an example of; the values next to a limit are one each."""

    @property
    def payload(self) -> bytes:
        """The message as it is sent."""
        return encode(self.message)


def broken_poses(good: Json) -> list[BrokenPose]:
    """Every way to break the pose `good` without breaking its text."""
    families = (_without, _mistyped, _too_far, _no_rotation)
    return [broken for family in families for broken in family(good)]


def in_strings(pose: Json) -> Json:
    """A pose with every number as a string (JSN-11)."""
    parts = ("position", "rotation")
    return pose | {part: {n: repr(v) for n, v in pose[part].items()} for part in parts}


def _changed(good: Json, part: str, member: str, value: Any) -> Json:
    return good | {part: good[part] | {member: value}}


def _without(good: Json) -> Iterator[BrokenPose]:
    for part in ("position", "rotation"):
        absent = {name: value for name, value in good.items() if name != part}
        yield BrokenPose("POS-1", f"no {part}", absent, f"no {part}")
        for member in good[part]:
            less = {name: value for name, value in good[part].items() if name != member}
            lacks = f"no {member} in {part}"
            yield BrokenPose("POS-1", lacks, good | {part: less}, f"no member of {part}")
            renamed = {
                name.upper() if name == member else name: v for name, v in good[part].items()
            }
            what = f"{member.upper()} for {member} in {part}"
            yield BrokenPose("POS-1", what, good | {part: renamed}, f"capitals in {part}")


def _mistyped(good: Json) -> Iterator[BrokenPose]:
    for part in ("position", "rotation"):
        lists = (list(good[part].values()), [good[part]])
        strange: tuple[Any, ...] = (None, True, 0, "x", [], {}, *lists)
        for value in strange:
            what = f"{part} {shorten(repr(value))}"
            yield BrokenPose("POS-1", what, good | {part: value}, f"{type(value)} for {part}")
        for number, value in enumerate(NO_NUMBERS):
            member = list(good[part])[number % len(good[part])]
            what = f"{value!r} for {member} of {part}"
            kind = f"{type(value)} in {part}"
            yield BrokenPose("POS-1", what, _changed(good, part, member, value), kind)


def _too_far(good: Json) -> Iterator[BrokenPose]:
    for member in "xyz":
        for value in (BEYOND, -BEYOND, 1e39, -1e300, 10**39):
            what = f"{value:.17g} for {member} of position"
            kind = f"{value:g}" if abs(value) == BEYOND else "too far"
            yield BrokenPose("POS-2", what, _changed(good, "position", member, value), kind)


def _no_rotation(good: Json) -> Iterator[BrokenPose]:
    numbers = good["rotation"]
    norm = math.hypot(*numbers.values())
    for wanted in NORMS:
        scaled = {name: value * wanted / norm for name, value in numbers.items()}
        what = f"a rotation of norm {wanted:.10g}, which is further than {TOLERANCE} from 1"
        kind = f"norm {wanted}" if wanted in (0.0, *BEYOND_NORMS) else "another norm"
        yield BrokenPose("POS-3", what, good | {"rotation": scaled}, kind)
    halves = {"x": 0.5, "y": 0.5, "z": 0.0, "w": 0.0}
    told = "the rotation (½, ½, 0, 0)"
    yield BrokenPose("POS-3", told, good | {"rotation": halves}, "another norm")
