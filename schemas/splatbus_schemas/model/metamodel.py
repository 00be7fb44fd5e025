"""The metamodel: every message and object of a version with its members, for generators.

Members come from the schemas, with limits from `limits.json`; who sends a message, where and with
which capability is in `messages.json`, since no schema says it.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from splatbus_schemas.data import VERSIONS, known_to, read_json
from splatbus_schemas.model.parts import (
    Condition,
    Documents,
    Part,
    Schema,
    added,
    all_unfolded,
    alternatives,
    camel,
    description,
    documents,
    is_forbidden,
    members,
    messages,
    own_description,
    record_name,
)

_ID = re.compile(r"\b[A-Z]{3}-\d+\b")
_IDS = re.compile(r" \([A-Z]{3}-\d+(?:, [A-Z]{3}-\d+)*\)")
_KEPT = (
    *("minimum", "exclusiveMinimum", "maximum", "multipleOf", "minLength", "maxLength", "pattern"),
    *("minItems", "maxItems", "uniqueItems", "contentEncoding", "default"),
)
_LIMITS: dict[str, Any] = read_json("limits.json")["limits"]
_UNITS = {"maxLength": ["characters"], "maxItems": ["items", "objects", "series", "edges"]}
"""Of the limits that bound how long a text or an array is."""


@cache
def metamodel() -> dict[str, Any]:
    """All of it, by `metamodel.schema.json`; ValueError where two objects have the same name."""
    facts = read_json("messages.json")
    records = {version: _records(version, facts["messages"]) for version in VERSIONS}
    first: dict[tuple[str, ...], str] = {}
    for version, found in records.items():
        for name, record in found.items():
            record["since"] = first.setdefault((name,), version)
            for member in record["members"]:
                member["since"] = first.setdefault((name, member["name"]), version)
    return {
        "$schema": "urn:splatbus:schema:metamodel",
        "limits": "limits.json",
        "framing": "framing.json",
        "versions": {
            version: {
                "capabilities": {
                    name: fact["channel"]
                    for name, fact in facts["capabilities"].items()
                    if fact["since"] in known_to(version)
                },
                "messages": [
                    _message(name, fact, found[camel(name)])
                    for name, fact in facts["messages"].items()
                    if camel(name) in found
                ],
                "records": found,
            }
            for version, found in records.items()
        },
    }


def _message(name: str, fact: dict[str, Any], record: dict[str, Any]) -> dict[str, Any]:
    types = [each["value"] for each in record["members"] if each["name"] == "type"]
    return {
        "name": name,
        "type": types[0] if types else None,
        "from": fact["from"],
        "channels": fact["channels"],
        "capability": fact.get("capability"),
        "answers": fact.get("answers"),
        "since": record["since"],
        "record": camel(name),
    }


def _records(version: str, facts: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Every object of one version, the messages first."""
    known = documents(version)
    found: dict[str, dict[str, Any]] = {}
    own = messages(version, known)
    for name, part in own.items():
        _record(name, [part], found, known)
    for name, fact in facts.items():
        belongs = fact.get("memberCapabilities", {})
        for member in found.get(camel(name), {"members": ()})["members"]:
            if member["name"] in belongs:
                member["capability"] = belongs[member["name"]]
    return {name: found[name] for name in [*own, *sorted(found.keys() - own.keys())]}


def _record(
    name: str, sources: list[Part], found: dict[str, dict[str, Any]], known: Documents
) -> None:
    """Add the record of an object, and those of the objects in it, to `found`."""
    parts = all_unfolded(sources, name, known)
    kinds = alternatives(parts, name, known)
    described = own_description(sources[0], known)
    listed = [
        each
        for member, schemas in members(parts).items()
        for each in _members(member, schemas, parts, kinds, found, known)
    ]
    record = {
        **_about(described),
        **({"kinds": _path(kinds[0])} if kinds else {}),
        "members": listed,
    }
    added(found, name, record, {"description", "requirements", "limits"})


def _members(
    member: str,
    schemas: list[Part],
    parts: list[Part],
    kinds: list[Condition],
    found: dict[str, dict[str, Any]],
    known: Documents,
) -> list[dict[str, Any]]:
    """A member, or where it is different things in objects of different kinds, each of them."""
    allowed = [each for each in schemas if not is_forbidden(each, known)]
    conditions = list(dict.fromkeys(each.when for each in allowed))
    shapes: dict[Condition | None, dict[str, Any]] = {}
    if None in conditions:
        shapes[None] = _shape(member, allowed, found, known)
    else:
        for when in conditions:
            own = [each._replace(when=None) for each in allowed if each.when == when]
            shapes[when] = _shape(member, own, found, known)
        if _always(conditions, kinds) and len({str(shape) for shape in shapes.values()}) == 1:
            shapes = {None: shapes[conditions[0]]}
    requiring = [part.when for part in parts if member in part.node.get("required", ())]
    return [
        {"name": member, **shape, **_required(requiring, when, kinds)}
        for when, shape in shapes.items()
    ]


def _required(
    requiring: list[Condition | None], when: Condition | None, kinds: list[Condition]
) -> dict[str, Any]:
    """When a member that exists `when` is required."""
    only = {"when": _when(when)} if when else {}
    if when in requiring or _always(requiring, kinds):
        return {"required": True, **only}
    needed = {}
    if requiring:
        (condition,) = filter(None, requiring)
        needed = {"requiredWhen": _when(condition)}
    return {"required": False, **needed, **only}


def _always(conditions: list[Condition | None], kinds: list[Condition]) -> bool:
    return None in conditions or (bool(kinds) and set(conditions) == set(kinds))


def _when(when: Condition) -> dict[str, str]:
    return {"record": when.owner, "member": _path(when), "value": when.value}


def _path(when: Condition) -> str:
    return ".".join(when.path)


def _shape(
    member: str, sources: list[Part], found: dict[str, dict[str, Any]], known: Documents
) -> dict[str, Any]:
    """What the value of a member is."""
    parts = all_unfolded(sources, "", known)
    value: Schema = {keyword: said for part in parts for keyword, said in part.node.items()}
    types = [value["type"]] if isinstance(value.get("type"), str) else value.get("type", [])
    nullable = {"nullable": True} if "null" in types else {}
    if "properties" in value:
        name = record_name(sources[0], member, known)
        _record(name, sources, found, known)
        return {
            "type": "record",
            "record": name,
            **nullable,
            **_about(own_description(sources[0], known)),
        }
    about = _about(description(parts))
    kept = {keyword: value[keyword] for keyword in _KEPT if keyword in value}
    kept |= _limits(kept, about["requirements"])
    if "items" in value:
        items = [Part(part.node["items"], part.home) for part in parts if "items" in part.node]
        return {
            "type": "array",
            **nullable,
            "items": _shape(member, items, found, known),
            **kept,
            **about,
        }
    if "const" in value:
        return {"type": "string", "value": value["const"], **about}
    if "enum" in value:
        return {"type": "string", "values": value["enum"], **about}
    if "anyOf" in value:
        plain, special = value["anyOf"]
        return {"type": plain["type"], "or": special["const"], **about}
    return {"type": next(each for each in types if each != "null"), **nullable, **kept, **about}


def _about(described: str) -> dict[str, Any]:
    ids = list(dict.fromkeys(_ID.findall(described)))
    return {"description": _IDS.sub("", described), "requirements": ids}


def _limits(kept: Schema, requirements: list[str]) -> dict[str, Any]:
    """Which limit each bound is: one of a requirement that is named beside it."""
    found = {
        keyword: name
        for keyword in ("minimum", "maximum", "maxLength", "maxItems")
        for name, limit in _LIMITS.items()
        if keyword in kept
        and abs(kept[keyword]) == limit["value"]
        and set(requirements) & set(limit["requirements"])
        and limit.get("unit") in _UNITS.get(keyword, [limit.get("unit")])
    }
    return {"limits": found} if found else {}
