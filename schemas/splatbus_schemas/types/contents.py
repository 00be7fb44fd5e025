"""What is written in every language: records, groups of messages, constants, and comments."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from splatbus_schemas.data import FRAMING, known_to, read_json
from splatbus_schemas.model.metamodel import metamodel
from splatbus_schemas.model.parts import camel

Member = dict[str, Any]


class Record(NamedTuple):
    """An object of the wire.

    If the value of one of its members decides what others there are, `kinds` are the records that
    it can be, and `members` those that all have; `base` leads back from a kind, which has them all.
    """

    name: str
    comment: list[str]
    members: list[Member]
    kinds: list[str]
    base: str | None


class Contents(NamedTuple):
    """All that the file of one version declares, in the order in which it does."""

    version: str
    records: list[Record]
    enumerations: dict[str, list[str]]
    groups: dict[str, list[str]]
    untyped: list[str]
    capabilities: list[str]
    limits: dict[str, tuple[Any, list[str]]]
    framing: dict[str, tuple[Any, list[str]]]


def contents(version: str) -> Contents:
    """What the metamodel, `limits.json` and `framing.json` say of one version."""
    model = metamodel()["versions"][version]
    groups: dict[str, list[str]] = {}
    for message in model["messages"]:
        for channel in message["channels"]:
            group = f"{camel(channel)}From{camel(message['from'])}"
            groups.setdefault(group, []).append(message["record"])
    records = [each for name in model["records"] for each in _records(name, model["records"])]
    known = known_to(version)
    limits = read_json("limits.json")["limits"].items()
    return Contents(
        version=version,
        records=_used_first(records),
        enumerations=dict(_enumerations(records)),
        groups=groups,
        untyped=[each["record"] for each in model["messages"] if each["type"] is None],
        capabilities=list(model["capabilities"]),
        limits={name: _limit(limit) for name, limit in limits if limit["since"] in known},
        framing=dict(_framing()),
    )


def _records(name: str, model: Mapping[str, Any]) -> Iterator[Record]:
    """A record, and before it each of its kinds."""
    record = model[name]
    comment = [_with_ids(record)]
    members = [_named(name, record, each) for each in record["members"]]
    values = [each["values"] for each in members if each["name"] == record.get("kinds")]
    kinds = {camel(value) + name: value for value in next(iter(values), ())}
    for kind, value in kinds.items():
        what = f"where `{record['kinds']}` is `{value}`"
        own = [_of_kind(each, record["kinds"], value) for each in members if _is_in(each, value)]
        yield Record(kind, [*comment, what], own, [], name)
    common = [each for each in members if not kinds or "when" not in each]
    yield Record(name, comment, common, list(kinds), None)


def _is_in(member: Member, kind: str) -> bool:
    return "when" not in member or bool(member["when"]["value"] == kind)


def _of_kind(member: Member, deciding: str, kind: str) -> Member:
    """A member as an object of that kind has it: the one that decides has but one value."""
    without = {"when"} if member["name"] != deciding else {"values", "enumeration"}
    kept = {key: value for key, value in member.items() if key not in without}
    return {**kept, "value": kind} if member["name"] == deciding else kept


def _named(name: str, record: Mapping[str, Any], member: Member) -> Member:
    """A member, with the name of the enumeration of its texts, and the age of its record."""
    values = member.get("values") or member.get("items", {}).get("values")
    named = {"enumeration": name + camel(member["name"])} if values else {}
    return {**member, **named, "record_since": record["since"]}


def _enumerations(records: list[Record]) -> Iterator[tuple[str, list[str]]]:
    for record in records:
        for member in record.members:
            if "enumeration" in member:
                yield member["enumeration"], member.get("values") or member["items"]["values"]


def _uses(record: Record) -> set[str]:
    """The records that one is made of."""
    shapes = [each.get("items", each) for each in record.members]
    return {*record.kinds, *(each["record"] for each in shapes if "record" in each)}


def _used_first(records: list[Record]) -> list[Record]:
    """Those that others have as members before these, else in the order in which they came."""
    ordered: list[Record] = []
    waiting = list(records)
    while waiting:
        missing = {each.name for each in waiting}
        following = next(each for each in waiting if not _uses(each) & missing)
        waiting.remove(following)
        ordered.append(following)
    return ordered


def _limit(limit: Mapping[str, Any]) -> tuple[Any, list[str]]:
    unit = f", in {limit['unit']}" if "unit" in limit else ""
    return limit["value"], [f"{limit['description']}{unit} [{', '.join(limit['requirements'])}]"]


def _framing() -> Iterator[tuple[str, tuple[Any, list[str]]]]:
    def ids(of: Mapping[str, Any]) -> str:
        return f"[{', '.join(of['requirements'])}]"

    length, host = FRAMING["length"], FRAMING["defaultHost"]
    order = f"{length['byteOrder']}-endian, {'' if length['signed'] else 'un'}signed"
    what = f"Bytes of the length, {order}, that stands before each {length['counts']}"
    yield "header_bytes", (length["bytes"], [f"{what} {ids(length)}"])
    for name, channel in FRAMING["channels"].items():
        port = f"port of the {name} channel"
        yield f"{name}_port", (channel["defaultPort"], [f"Default {port} {ids(channel)}"])
        variable = f"Environment variable with the {port} {ids(channel)}"
        yield f"{name}_port_variable", (channel["environment"], [variable])
    yield "host", (host["value"], [f"Default host {ids(host)}"])
    yield (
        "host_variable",
        (host["environment"], [f"Environment variable with the host {ids(host)}"]),
    )


def notes(member: Member) -> list[str]:
    """What a comment says of a member, one thing after the other."""
    lines = [_with_ids(member)]
    if span := _span(member):
        lines.append(span)
    if "or" in member:
        lines.append(f'the text "{member["or"]}" on the wire is positive infinity')
    if member["since"] != member["record_since"]:
        lines.append(f"since {member['since']}")
    if "default" in member:
        lines.append(f"{member['default']} where absent")
    if "requiredWhen" in member:
        lines.append(f"required where {_condition(member['requiredWhen'])}")
    if "when" in member:
        lines.append(f"only where {_condition(member['when'])}")
    if "capability" in member:
        lines.append(f"belongs to the capability `{member['capability']}`")
    return lines


def is_optional(member: Member) -> bool:
    """Whether a message without it can be right."""
    return not member["required"] or "when" in member


def is_fixed(member: Member) -> bool:
    """Whether it is an array whose length does not vary."""
    return "minItems" in member and member["minItems"] == member.get("maxItems")


def _with_ids(what: Mapping[str, Any]) -> str:
    return f"{what['description']} [{', '.join(what['requirements'])}]"


def _condition(when: Mapping[str, str]) -> str:
    return f"`{when['member']}` of `{when['record']}` is `{when['value']}`"


def _span(shape: Mapping[str, Any]) -> str:
    """The values that are allowed, in words."""
    limits = shape.get("limits", {})
    said = []
    for least, most, unit in (
        ("minimum", "maximum", ""),
        ("minLength", "maxLength", " characters"),
        ("minItems", "maxItems", " items"),
    ):
        named = sorted({limits[each] for each in (least, most) if each in limits})
        name = f" ({', '.join(named)})" if named else ""
        if least in shape and shape[least] == shape.get(most):
            said.append(f"{shape[least]}{unit}")
        elif least in shape and most in shape:
            said.append(f"{shape[least]} to {shape[most]}{unit}{name}")
        elif least in shape:
            said.append(f"at least {shape[least]}{unit}{name}")
        elif most in shape:
            said.append(f"at most {shape[most]}{unit}{name}")
    if "exclusiveMinimum" in shape:
        said.append(f"more than {shape['exclusiveMinimum']}")
    if "multipleOf" in shape:
        said.append(f"a multiple of {shape['multipleOf']}")
    if "pattern" in shape:
        said.append(f"matches `{shape['pattern']}`")
    if shape.get("uniqueItems"):
        said.append("each different")
    if "items" in shape and (inner := _span(shape["items"])):
        said.append(f"each {inner}")
    return ", ".join(said)
