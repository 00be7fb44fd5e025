"""Parts of messages that both sides send: programs, versions, capabilities, a lens."""

import re

from splatbus_schemas import LIMITS

from splatbus_wire.fields import Field
from splatbus_wire.message_types import Intrinsics, Program

MAX_IMAGE_SIZE: int = LIMITS["max_image_size"]
MAX_NAME_CHARS: int = LIMITS["max_name_chars"]
_VERSION = re.compile(r"(?:0|[1-9][0-9]*)\.(?:0|[1-9][0-9]*)")


def version(version: Field) -> str:
    """A version of the protocol, such as 1.1 [NEG-2]."""
    version.string(1, MAX_NAME_CHARS)
    return version.matching(_VERSION, "two decimal integers joined by a dot")


def program(program: Field) -> Program:
    """A peer's name and version [NEG-2, NEG-30]."""
    name, version = program.member("name"), program.member("version")
    return Program(name.string(0, MAX_NAME_CHARS), version.string(0, MAX_NAME_CHARS))


def capabilities(names: Field) -> tuple[str, ...]:
    """What a peer can do [NEG-2, NEG-30]."""
    items = names.items(0, LIMITS["max_capabilities"])
    return different(names, [item.string(0, MAX_NAME_CHARS) for item in items])


def different(array: Field, values: list[str]) -> tuple[str, ...]:
    """The values of an array, none of which stands twice."""
    if len(set(values)) != len(values):
        raise array.refused("names one of its items twice")
    return tuple(values)


def intrinsics(lens: Field) -> Intrinsics:
    """The lens that an object describes [CAM-4]."""
    least, most = LIMITS["min_lens"], LIMITS["max_lens"]
    fx, fy, near, far = (
        lens.member(name).between(least, most) for name in ("fx", "fy", "near", "far")
    )
    cx, cy = (lens.member(name).between(-most, most) for name in ("cx", "cy"))
    if not near < far:
        raise lens.member("far").refused(f"is {far}, not greater than near, {near}")
    width, height = (lens.member(side).integer(1, MAX_IMAGE_SIZE) for side in ("width", "height"))
    return Intrinsics(fx, fy, cx, cy, width, height, near, far)
