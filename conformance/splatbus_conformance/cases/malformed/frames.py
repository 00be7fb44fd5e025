"""Frames that break a rule, and yet lend a slot that is there (spec 1.1 section 5.2)."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from splatbus_conformance.cases.malformed.init_packets import (
    ABSENT,
    BEYOND,
    NO_NUMBERS,
    NO_OBJECTS,
    NO_STRINGS,
    changed,
    in_words,
)
from splatbus_conformance.wire.messages import Json

_OBJECT: Json = {"object": "o", "position": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": 1}
_WITHOUT_SCALE = {name: value for name, value in _OBJECT.items() if name != "scale"}


class BrokenFrame(NamedTuple):
    """What is changed in a good frame."""

    kind: str
    """The member that is broken."""
    changes: dict[str, Any]
    """Values by path, ABSENT for a member to be left out."""

    def __str__(self) -> str:
        """The changes in words."""
        return in_words(self.changes)

    def of(self, good: Json) -> Json:
        """The good frame, spoilt."""
        return changed(good, self.changes)


def broken_frames(width: int, height: int) -> Iterator[BrokenFrame]:
    """Every member but `generation`, `seq` and `slot` broken, for images of this size."""
    no_lists = (ABSENT, *NO_OBJECTS[1:2], {}, "0", 0)
    members: dict[str, tuple[Any, ...]] = {
        "camera": NO_OBJECTS,
        "camera/position": (
            *no_lists,
            [],
            [0, 0],
            [0, 0, 0, 0],
            [0, 0, None],
            ["0"] * 3,
            [0, 0, 1e39],
        ),
        "camera/rotation": (*no_lists, [0, 0, 0], [0, 0, 0, 0], [1, 1, 1, 1], [0, 0, 0, "1"]),
        "camera/width": (ABSENT, width + 1, 2 * width, 0, -width, width + 0.5, *NO_NUMBERS),
        "camera/height": (ABSENT, height + 1, 0, -height, 2**31, str(height), *NO_NUMBERS),
        "camera/tag": ("", "t" * 65, *NO_STRINGS[1:]),
        "time": (ABSENT, "0", *NO_NUMBERS),
        "renderedAt": (ABSENT, "0", *NO_NUMBERS),
        "objects": (None, {}, "o", [None], [{}], [_OBJECT] * 2, [_WITHOUT_SCALE]),
    }
    for name in ("fx", "fy"):
        members[f"camera/{name}"] = (ABSENT, 0, -1, "64", *NO_NUMBERS)
    for name in ("cx", "cy"):
        members[f"camera/{name}"] = (ABSENT, "32", *NO_NUMBERS)
    for name, beyond in (("near", 1e6), ("far", 1e-6)):
        members[f"camera/{name}"] = (ABSENT, 0, -1, beyond, "1", *NO_NUMBERS)
    for path, values in members.items():
        for value in values:
            yield BrokenFrame(path, {path: value})
    for name, value in (("object", 5), ("position", [0]), ("rotation", [0] * 4), ("scale", 0)):
        yield BrokenFrame("objects", {"objects": [_OBJECT | {name: value}]})
    many = [_OBJECT | {"object": f"o{number}"} for number in range(257)]
    yield BrokenFrame("objects", {"objects": many})


def frames_of_no_image() -> Iterator[BrokenFrame]:
    """`generation`, `seq` or `slot` broken, so that nothing can be given back."""
    wrong = (ABSENT, -1, 0.5, BEYOND, "1", *NO_NUMBERS, True)
    for name, values in {"generation": (0, *wrong), "seq": wrong, "slot": wrong}.items():
        for value in values:
            yield BrokenFrame(name, {name: value})
