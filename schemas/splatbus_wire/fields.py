"""Take typed values out of parsed JSON; an error says what is wrong, where and by which rule."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_wire.errors import ProtocolError
from splatbus_wire.json_text import brief, kind_of, step
from splatbus_wire.poses import Pose, Vector
from splatbus_wire.rotations import Quaternion, check_quaternion

MAX_SAFE_INTEGER: int = LIMITS["max_safe_integer"]
_MAX_POSITION: float = LIMITS["max_position"]
ROUNDS_TO_INFINITY = 2.0**128 - 2.0**103
"""The least number that single precision rounds to infinity: half an ULP beyond its greatest."""
_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?")


class Field(NamedTuple):
    """A value in a message, the JSON pointer to it, and the requirement that it has to satisfy.

    Every method raises ProtocolError with that pointer and that requirement: `invalid_message`,
    or where stated another code.
    """

    value: Any
    pointer: str
    requirement: str

    def refused(self, problem: str, code: str = "invalid_message") -> ProtocolError:
        """The error that says that this field `problem`."""
        name = self.pointer[1:].replace("/", ".") or "the message"
        return ProtocolError(
            code, f"{name} {problem}", requirement=self.requirement, pointer=self.pointer
        )

    def under(self, requirement: str) -> Field:
        """The same value, to be judged by another requirement."""
        return self._replace(requirement=requirement)

    def member(self, name: str) -> Field:
        """The member `name` of this object."""
        found = self.optional(name)
        if found is None:
            raise Field(None, self.pointer + step(name), self.requirement).refused("is missing")
        return found

    def optional(self, name: str) -> Field | None:
        """The member `name` of this object, or None if it has none."""
        members = self._expect(dict, "an object")
        if name not in members:
            return None
        return Field(members[name], self.pointer + step(name), self.requirement)

    def items(self, least: int, most: float = math.inf) -> list[Field]:
        """The items of this array of `least` to `most` items."""
        items = self._expect(list, "an array")
        if not least <= len(items) <= most:
            upper = "" if least == most else " or more" if most == math.inf else f" to {most}"
            raise self.refused(f"has {len(items)} items, not {least}{upper}")
        return [
            Field(item, self.pointer + step(index), self.requirement)
            for index, item in enumerate(items)
        ]

    def string(self, least: int, most: int) -> str:
        """This string of `least` to `most` characters."""
        text: str = self._expect(str, "a string")
        if not least <= len(text) <= most:
            raise self.refused(f"has {len(text)} characters, not {least} to {most}")
        return text

    def matching(self, pattern: re.Pattern[str], wanted: str) -> str:
        """This string, which the whole of `pattern` matches; `wanted` says so in words."""
        text: str = self._expect(str, "a string")
        if not pattern.fullmatch(text):
            raise self.refused(f"is {brief(text)}, not {wanted}")
        return text

    def one_of(self, values: Collection[str]) -> str:
        """This string, which is one of `values`."""
        if not isinstance(self.value, str) or self.value not in values:
            wanted = " or ".join(brief(value) for value in values)
            raise self.refused(f"is {brief(self.value)}, not {wanted}")
        return self.value

    def integer(self, least: int, most: int) -> int:
        """This integer from `least` to `most`; 64.0 is one, true is none."""
        number = self.number()
        if not (least <= number <= most and number.is_integer()):
            raise self.refused(f"is {brief(self.value)}, not an integer from {least} to {most}")
        return int(self.value)

    def positive(self) -> float:
        """This number, which is greater than 0."""
        number = self.number()
        if not number > 0:
            raise self.refused(f"is {brief(self.value)}, not a positive number")
        return number

    def between(self, least: float, most: float) -> float:
        """This number from `least` to `most`."""
        number = self.number()
        if not least <= number <= most:
            raise self.refused(f"is {brief(self.value)}, not from {least:g} to {most:g}")
        return number

    def number(self, *, or_string: bool = False) -> float:
        """This number; `or_string` also takes a string that spells one [JSN-11].

        Raises `invalid_number` for one that is not finite in double precision.
        """
        value = self.value
        if or_string and isinstance(value, str) and _NUMBER.fullmatch(value):
            value = float(value)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.refused(f"is {kind_of(value)}, not a number")
        number = float(value)
        if not math.isfinite(number):
            raise self.refused(f"is {brief(self.value)}, not a finite number", "invalid_number")
        return number

    def single(self) -> float:
        """This number, which single precision does not round to infinity."""
        number = self.number()
        if not abs(number) < ROUNDS_TO_INFINITY:
            raise self.refused(f"is {brief(self.value)}, beyond single precision")
        return number

    def coordinate(self, *, or_string: bool = False) -> float:
        """This number of a position; `invalid_number` if it is too large [POS-2]."""
        number = self.number(or_string=or_string)
        if not abs(number) <= _MAX_POSITION:
            raise self.under("POS-2").refused(
                f"is {brief(self.value)}, beyond single precision", "invalid_number"
            )
        return number

    def vector(self) -> Vector:
        """This array of 3 numbers."""
        x, y, z = (item.number() for item in self.items(3, 3))
        return x, y, z

    def id(self) -> int | None:
        """The member `id` of this object, if it has one."""
        identifier = self.optional("id")
        return None if identifier is None else identifier.integer(0, MAX_SAFE_INTEGER)

    def generation(self) -> int:
        """The member `generation` of this object."""
        return self.member("generation").integer(1, MAX_SAFE_INTEGER)

    def seq(self) -> int:
        """The member `seq` of this object."""
        return self.member("seq").integer(0, MAX_SAFE_INTEGER)

    def _expect(self, kind: type, wanted: str) -> Any:
        if not isinstance(self.value, kind):
            raise self.refused(f"is {kind_of(self.value)}, not {wanted}")
        return self.value


def object_pose(message: Field, *, or_strings: bool = False) -> Pose:
    """The pose of a message that writes it as objects with named members [POS-1].

    Raises ProtocolError: `invalid_message`, `invalid_number` [JSN-4, POS-2], `invalid_rotation`
    [POS-3].
    """
    position, rotation = message.member("position"), message.member("rotation")
    x, y, z = (position.member(axis).coordinate(or_string=or_strings) for axis in "xyz")
    q = tuple(rotation.member(axis).number(or_string=or_strings) for axis in "xyzw")
    return _pose((x, y, z), q, rotation)


def array_pose(message: Field) -> Pose:
    """The pose of a message that writes it as arrays, x, y, z and x, y, z, w [REQ-5, IMG-1].

    Raises as `object_pose`.
    """
    rotation = message.member("rotation")
    x, y, z = (item.coordinate() for item in message.member("position").items(3, 3))
    q = tuple(item.number() for item in rotation.items(4, 4))
    return _pose((x, y, z), q, rotation)


def _pose(position: Vector, q: tuple[float, ...], rotation: Field) -> Pose:
    x, y, z, w = q
    quaternion: Quaternion = (x, y, z, w)
    check_quaternion(quaternion, pointer=rotation.pointer)
    return Pose(position, quaternion)
