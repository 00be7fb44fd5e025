"""Add members that no version defines, at every level of a message (JSN-7)."""

from collections.abc import Iterator, Set
from functools import cache
from random import Random
from typing import Any

from splatbus_schemas import LIMITS
from splatbus_schemas.model.metamodel import metamodel

from splatbus_conformance.wire.json_reading import values

ODD_NAMES = (
    *("", " ", "x-later", "W", "meta ", "__proto__", "constructor", "$ref", "null", "0"),
    *("é", "🙂", "\u202e", "\x00", '"', "\\", "a/b~c", "n" * 1000),
)
ODD_VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 2**53 - 1, -0.0, 1e308, 5e-324, "", [], {}, [None, [], {}]),
    *("\x00", "}", '{"', "NaN", "\\", "🙂" * 300, "[{" * 50, {"": {"": {}}}),
)


def with_unknown_members(message: dict[str, Any], random: Random) -> dict[str, Any]:
    """A copy of `message` whose every object has members more, in any order.

    Some have names that the message uses at another level, and that mean nothing at theirs; one
    holds a decoy: the message itself with other values.
    """
    fuller: dict[str, Any] = _added(
        message, random, frozenset(_names_in(message)), 1, _decoy(message)
    )
    return fuller


def between_unknown_members(message: dict[str, Any], most: int) -> dict[str, Any]:
    """A copy of `message` between members that mislead whoever looks for the first, or the last,
    bracket or name in the text; it has so many values as `most` says (JSN-12).
    """
    before = {"": [None, [], {}, "}"], "decoy": _decoy(message)}
    fuller = {**before, **message, "decoy of it": _decoy(message), "x-later": []}
    fuller["x-later"] += [0] * (most - values(fuller))
    return fuller


def nested(depth: int) -> Any:
    """Arrays and objects in turn, `depth` of them."""
    value: Any = [] if depth % 2 else {}
    for level in range(depth - 1, 0, -1):
        value = [value] if level % 2 else {"x": value}
    return value


@cache
def _known_names() -> frozenset[str]:
    """Every member name that any version knows."""
    return frozenset().union(*_known_objects())


@cache
def _known_objects() -> tuple[frozenset[str], ...]:
    """The member names of each object that any version knows, optional ones too."""
    versions = metamodel()["versions"].values()
    records = (record for version in versions for record in version["records"].values())
    return tuple(frozenset(it["name"] for it in record["members"]) for record in records)


def _known_beside(present: Set[str]) -> frozenset[str]:
    """The names that mean something in an object with these members."""
    known = present & _known_names()
    return frozenset().union(*(members for members in _known_objects() if members >= known))


def _added(
    value: Any, random: Random, elsewhere: frozenset[str], depth: int, decoy: Any = None
) -> Any:
    if isinstance(value, list):
        return [_added(each, random, elsewhere, depth + 1) for each in value]
    if not isinstance(value, dict):
        return value
    members = [(name, _added(each, random, elsewhere, depth + 1)) for name, each in value.items()]
    moved = elsewhere - value.keys() - _known_beside(value.keys())
    strangers = sorted((set(ODD_NAMES) - _known_names()) | moved)
    for name in random.sample(strangers, random.choice((1, 2, 3))):
        deepest = nested(LIMITS["max_json_depth"] - depth)
        members.append((name, random.choice((*ODD_VALUES, deepest))))
    if decoy is not None:
        members.append(("decoy", decoy))
    random.shuffle(members)
    return dict(members)


def _decoy(value: Any) -> Any:
    """The same members with values that would be wrong."""
    if isinstance(value, dict):
        return {name: _decoy(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_decoy(each) for each in value]
    if isinstance(value, bool) or value is None:
        return not value
    return value + "-decoy" if isinstance(value, str) else -1 - value


def _names_in(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        yield from value
    for each in _inside(value):
        yield from _names_in(each)


def _inside(value: Any) -> list[Any]:
    """The members or elements of `value`."""
    if isinstance(value, dict):
        return list(value.values())
    return value if isinstance(value, list) else []
