"""Rules on what a peer says beyond the versions that it speaks (spec 1.1 chapter 10)."""

import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, NamedTuple

from splatbus_schemas import names, schema

from splatbus_conformance.rules import Breach, Judgement, Rule, Sighting, about, judged, rule
from splatbus_conformance.rules.v1_1.mem import capabilities
from splatbus_conformance.wire.conversation import Conversation, MessageInContext
from splatbus_conformance.wire.json_values import show, strings
from splatbus_conformance.wire.message_kinds import (
    CAPABILITIES,
    CLIENT_1_0,
    CLIENT_1_1,
    KNOWN_VERSIONS,
    REPLIES,
    SERVER_1_1,
    vendor,
)

TYPES = {"client": {*CLIENT_1_0, *CLIENT_1_1}, "server": {*SERVER_1_1, *REPLIES}}
_VENDORS_MEMBER = re.compile(r"x-[a-z0-9_]+.*", re.DOTALL)
_VERSION = "1.1"
_MESSAGES = frozenset(names(_VERSION))


@rule("EVO-2", "EVO-3")
def names_are_defined_or_a_vendors(conversation: Conversation) -> Iterator[Sighting]:
    """EVO-2, EVO-3: types and capabilities that no version defines are a vendor's, and agreed.

    What a peer that speaks a version unknown to this harness may say, is not judged; what a client
    says before `welcome`, REQ-14 judges.
    """
    if not _versions_are_known(conversation):
        return
    if conversation.hello is not None:
        listed = strings((conversation.hello.value or {}).get("capabilities")) or []
        shown = (_capability(name, i) for i, name in enumerate(listed))
        yield from judged(conversation, conversation.hello, shown)
    for message, hello, welcome in conversation.placed():
        kind = message.type
        if hello is None or kind is None or message.kind in TYPES[message.sender]:
            continue
        if (of := vendor(kind)) is not None:
            granted = capabilities(welcome) or ()
            agreed = of in map(vendor, granted)
            text = f"a message of type {show(kind)}, and welcome lists no capability of {of}"
            yield about(conversation, message, "EVO-2")
            breach = None if agreed else Breach("not-granted", text)
            yield about(conversation, message, "EVO-3", breach, "/type")
        elif welcome is not None:
            text = f"type is {show(kind)}, which no version defines, and no vendor's"
            yield about(conversation, message, "EVO-2", Breach("unknown-type", text), "/type")


@rule("EVO-4")
def members_are_defined_or_a_vendors(conversation: Conversation) -> Iterator[Sighting]:
    """EVO-4: members that no version defines, at any level, are a vendor's."""
    if not _versions_are_known(conversation):
        return
    for placed in conversation.placed():
        message = placed.message
        greets = message.kind == "hello" and placed.hello is None
        if greets or _is_of_1_1(placed):
            for pointer in strays(message.value, _defined(str(message.kind)), ""):
                breach = Breach("unknown-member", f"{pointer} is a member that no version defines")
                yield about(conversation, message, "EVO-4", breach, pointer)
                break
            else:
                yield about(conversation, message, "EVO-4")


def _versions_are_known(conversation: Conversation) -> bool:
    """Neither side speaks a version of which this harness does not know what it defines."""
    hello, welcome = conversation.hello, conversation.welcome
    said: list[Any] = (strings((hello.value or {}).get("versions")) if hello else []) or []
    said = [*said, *((it.value or {}).get("version") for it in (welcome,) if it)]
    packets = (m.value or {} for m in conversation.of("init_packet"))
    said += (packet["version"] for packet in packets if "version" in packet)
    return all(isinstance(version, str) and version in KNOWN_VERSIONS for version in said)


def _capability(name: str, place: int) -> Judgement:
    known = any(name in those for those in CAPABILITIES.values()) or vendor(name) is not None
    text = f"{show(name)} is a capability that no version defines, and no vendor's"
    breach = None if known else Breach("unknown-capability", text)
    return Judgement("EVO-2", breach, f"/capabilities/{place}")


def _is_of_1_1(placed: MessageInContext) -> bool:
    """It is a message that 1.1 defines, from a peer that is known to speak that."""
    message, hello, welcome = placed
    if hello is None or message.value is None or message.kind not in _MESSAGES:
        return False
    if message.kind == "init_packet":
        return "version" in message.value and "type" not in message.value
    named = message.type == message.kind
    told = message.sender == "client" or message.kind in ("welcome", "error")
    return named and (told or welcome is not None)


class Defined(NamedTuple):
    """What may be in a value: the members of an object, or the items of an array."""

    members: Mapping[str, "Defined"]
    items: "Defined | None" = None


def strays(value: Any, defined: Defined, pointer: str) -> Iterator[str]:
    """Pointers to members that are neither defined nor a vendor's; what is inside a member that is
    no object by its definition is not looked at.
    """
    if isinstance(value, dict) and defined.members:
        for name, member in value.items():
            if name in defined.members:
                yield from strays(member, defined.members[name], f"{pointer}/{name}")
            elif not _VENDORS_MEMBER.fullmatch(name):
                yield f"{pointer}/{name}"
    elif isinstance(value, list) and defined.items is not None:
        for place, item in enumerate(value):
            yield from strays(item, defined.items, f"{pointer}/{place}")


@cache
def _defined(kind: str) -> Defined:
    return _read(f"urn:splatbus:schema:{_VERSION}:{kind}")


def _read(reference: str) -> Defined:
    """What a part of a schema defines, by its URN and a pointer into it."""
    urn, _, pointer = reference.partition("#")
    *_, version, name = urn.split(":")
    part = schema(name, version)
    for step in pointer.split("/")[1:]:
        part = part[step]
    return _in(part, urn)


def _in(part: Mapping[str, Any], urn: str) -> Defined:
    members = {name: _in(each, urn) for name, each in part.get("properties", {}).items()}
    found = Defined(members, _in(part["items"], urn) if "items" in part else None)
    beside = [*part.get("allOf", []), *part.get("anyOf", []), *part.get("oneOf", [])]
    for each in (*beside, *(part[key] for key in ("if", "then", "else") if key in part)):
        found = _both(found, _in(each, urn))
    if (reference := part.get("$ref")) is not None:
        found = _both(found, _read(urn + reference if reference[0] == "#" else reference))
    return found


def _both(one: Defined, other: Defined) -> Defined:
    shared = {
        name: _both(one.members[name], other.members[name])
        for name in one.members.keys() & other.members
    }
    items = _both(one.items, other.items) if one.items and other.items else None
    return Defined({**one.members, **other.members, **shared}, items or one.items or other.items)


RULES: tuple[Rule, ...] = (names_are_defined_or_a_vendors, members_are_defined_or_a_vendors)
