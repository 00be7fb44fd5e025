"""Rules on what a peer says beyond the versions that it speaks (spec 1.1 chapter 10)."""

import re
from collections.abc import Iterator
from typing import Any

from splatbus_schemas.model.metamodel import metamodel

from splatbus_conformance.rules import Breach, Json, Judgement, Sighting, about, judged, rule
from splatbus_conformance.rules.v1_1.mem import capabilities
from splatbus_conformance.wire.conversation import Conversation, MessageInContext
from splatbus_conformance.wire.json_values import array, show, strings
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
_MODEL = metamodel()["versions"]["1.1"]
_MESSAGES = {it["name"]: it for it in _MODEL["messages"]}


@rule("EVO-2", "EVO-3")
def names_are_defined_or_a_vendors(conversation: Conversation) -> Iterator[Sighting]:
    """EVO-2, EVO-3: types and capabilities that no version defines are a vendor's, and agreed.

    What a peer that speaks a version unknown to this harness may say, is not judged; what a client
    says before `welcome`, REQ-14 judges.
    """
    if not _versions_are_known(conversation):
        return
    if conversation.hello is not None:
        listed = strings(conversation.hello.members.get("capabilities")) or []
        shown = (_capability(name, i) for i, name in enumerate(listed))
        yield from judged(conversation.hello, shown)
    for message, hello, welcome in conversation.placed():
        kind = message.type
        if hello is None or kind is None or message.kind in TYPES[message.sender]:
            continue
        if (of := vendor(kind)) is not None:
            granted = capabilities(welcome) or ()
            agreed = of in map(vendor, granted)
            text = f"a message of type {show(kind)}, and welcome lists no capability of {of}"
            yield about(message, "EVO-2")
            breach = None if agreed else Breach("not-granted", text)
            yield about(message, "EVO-3", breach, "/type")
        elif welcome is not None:
            text = f"type is {show(kind)}, which no version defines, and no vendor's"
            yield about(message, "EVO-2", Breach("unknown-type", text), "/type")


@rule("EVO-4")
def members_are_defined_or_a_vendors(conversation: Conversation) -> Iterator[Sighting]:
    """EVO-4: members that no version defines, at any level, are a vendor's."""
    if not _versions_are_known(conversation):
        return
    for placed in conversation.placed():
        message = placed.message
        greets = message.kind == "hello" and placed.hello is None
        if greets or _is_of_1_1(placed):
            for pointer in strays(message.value, _MESSAGES[str(message.kind)], ""):
                breach = Breach("unknown-member", f"{pointer} is a member that no version defines")
                yield about(message, "EVO-4", breach, pointer)
                break
            else:
                yield about(message, "EVO-4")


def _versions_are_known(conversation: Conversation) -> bool:
    """Neither side speaks a version of which this harness does not know what it defines."""
    hello, welcome = conversation.hello, conversation.welcome
    said: list[Any] = (strings(hello.members.get("versions")) if hello else []) or []
    said = [*said, *(it.members.get("version") for it in (welcome,) if it)]
    packets = (m.members for m in conversation.of("init_packet"))
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


def strays(value: Any, part: Json, pointer: str) -> Iterator[str]:
    """Pointers to members that neither the metamodel has for a part of a message nor a vendor; what
    is inside a member that is no object by its definition is not looked at.
    """
    if isinstance(value, dict) and "record" in part:
        defined = {it["name"]: it for it in _MODEL["records"][part["record"]]["members"]}
        for name, member in value.items():
            if name in defined:
                yield from strays(member, defined[name], f"{pointer}/{name}")
            elif not _VENDORS_MEMBER.fullmatch(name):
                yield f"{pointer}/{name}"
    for place, item in enumerate(array(value) if "items" in part else ()):
        yield from strays(item, part["items"], f"{pointer}/{place}")
