"""A schema taken apart: each piece that its `$ref`, `allOf` and `if` add, and when it holds."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from splatbus_schemas.data import known_to, names, schema

Schema = dict[str, Any]
_ABOUT = {"$schema", "$id", "$comment", "$defs", "$ref", "allOf", "title"}


class Condition(NamedTuple):
    """That the member at `path` has this value, seen from the record called `owner`."""

    owner: str
    path: tuple[str, ...]
    value: str


class Part(NamedTuple):
    """A schema, the document that its references are of, and when it holds; None is always."""

    node: Schema
    home: Schema
    when: Condition | None = None


Documents = Mapping[str, Schema]


def documents(version: str) -> dict[str, Schema]:
    """The schemas of a version and those before it, by their `$id`."""
    loaded = (schema(name, each) for each in known_to(version) for name in names(each))
    return {each["$id"]: each for each in loaded}


def messages(version: str, known: Documents) -> dict[str, Part]:
    """The schema of each message of a version, by the name of its type."""
    own = {name: known[f"urn:splatbus:schema:{version}:{name}"] for name in names(version)}
    return {camel(name): Part(document, document) for name, document in own.items()}


def added(found: dict[str, Schema], name: str, definition: Schema, told: Collection[str]) -> None:
    """Add what a type is to those that are found, where it may be already.

    What is told of it, under these keywords, may differ where it serves several messages;
    ValueError if anything else does.
    """
    if _without(told, found.setdefault(name, definition)) != _without(told, definition):
        raise ValueError(f"two types would be called {name}; give one of them a title")


def _without(left_out: Collection[str], node: Any) -> Any:
    if isinstance(node, dict):
        return {k: _without(left_out, value) for k, value in node.items() if k not in left_out}
    return [_without(left_out, each) for each in node] if isinstance(node, list) else node


def resolved(reference: str, home: Schema, known: Documents) -> Part:
    """What a `$ref` that stands in the document `home` leads to."""
    urn, _, pointer = reference.partition("#")
    document = known[urn] if urn else home
    node = document
    for step in pointer.split("/")[1:]:
        node = node[step]
    return Part(node, document)


def camel(name: str) -> str:
    """A name of the wire as that of a type: `init_packet` is `InitPacket`."""
    return "".join(word[:1].upper() + word[1:] for word in re.split(r"[ _]", name))


def condition(test: Schema, owner: str) -> Condition:
    """The one comparison that an `if` of these schemas makes."""
    path: tuple[str, ...] = ()
    while "const" not in test:
        ((name, test),) = test["properties"].items()
        path += (name,)
    return Condition(owner, path, test["const"])


def unfolded(part: Part, owner: str, known: Documents) -> Iterator[Part]:
    """The parts of a schema, what it refers to first, none with a reference of its own.

    A description beside a reference stands in place of what is described there.
    """
    node, home, when = part
    if "$ref" in node:
        target = resolved(node["$ref"], home, known)
        for inner in unfolded(target._replace(when=when), owner, known):
            yield _undescribed(inner) if "description" in node else inner
    pieces = node.get("allOf", ())
    for piece in pieces:
        if "if" not in piece:
            yield from unfolded(Part(piece, home, when), owner, known)
    if own := {keyword: value for keyword, value in node.items() if keyword not in _ABOUT}:
        yield Part(own, home, when)
    for piece in pieces:
        if "if" in piece:
            yield from unfolded(Part(piece, home, when), owner, known)
    if "if" in node:
        yield from unfolded(Part(node["then"], home, condition(node["if"], owner)), owner, known)


def _undescribed(part: Part) -> Part:
    return part._replace(node={k: v for k, v in part.node.items() if k != "description"})


def all_unfolded(sources: Iterable[Part], owner: str, known: Documents) -> list[Part]:
    """The parts of several schemas that hold for one value."""
    return [part for source in sources for part in unfolded(source, owner, known)]


def members(parts: Iterable[Part]) -> dict[str, list[Part]]:
    """The schemas of each member of an object, `type` first."""
    found: dict[str, list[Part]] = {}
    for part in parts:
        for name, node in part.node.get("properties", {}).items():
            found.setdefault(name, []).append(Part(node, part.home, part.when))
    return dict(sorted(found.items(), key=lambda item: item[0] != "type"))


def alternatives(parts: Iterable[Part], owner: str, known: Documents) -> list[Condition]:
    """The conditions that decide what an object has, if one holds of each; else none.

    They do where the member that is compared has to be one of the values that it is compared to.
    """
    parts = list(parts)
    conditions = list(dict.fromkeys(p.when for p in parts if p.when and p.when.owner == owner))
    if not conditions:
        return []
    inner = parts
    for name in conditions[0].path:
        inner = all_unfolded(members(inner)[name], "", known)
    values = {value for part in inner for value in part.node.get("enum", ())}
    return conditions if values == {each.value for each in conditions} else []


def is_forbidden(source: Part, known: Documents) -> bool:
    """Whether nothing passes, so that the member may not be there."""
    return any(part.node.get("not") == {} for part in unfolded(source, "", known))


def description(parts: list[Part]) -> str:
    """What is said of a value, by every part of it that says something, itself first."""
    said = [part.node["description"] for part in reversed(parts) if "description" in part.node]
    return ". ".join(dict.fromkeys(said))


def own_description(source: Part, known: Documents) -> str:
    """What is said where a value stands, or else where its `$ref` leads."""
    if "description" in source.node or "$ref" not in source.node:
        return str(source.node.get("description", ""))
    return own_description(resolved(source.node["$ref"], source.home, known), known)


def record_name(source: Part, member: str, known: Documents) -> str:
    """The name of the type of a member: a title, or how it is referred to, or the member's name."""
    if "title" in source.node:
        return str(source.node["title"])
    if "$ref" in source.node:
        reference = source.node["$ref"]
        return record_name(resolved(reference, source.home, known), reference.split("/")[-1], known)
    return camel(member)
