"""What a message is meant to be, and where in it numbers belong.

A judge must know what a broken message was meant for, to name the requirement that it breaks.
"""

import re
from functools import cache
from operator import itemgetter
from typing import Any

from splatbus_schemas.model.metamodel import metamodel

from splatbus_conformance.wire.recording import Channel, Direction

Shape = Any
"""A tree of members with NUMBER at its leaves; a list stands for an array of any length."""
NUMBER = "number"
_MODEL = metamodel()["versions"]
_MESSAGES: list[dict[str, Any]] = _MODEL["1.1"]["messages"]
_RECORDS: dict[str, Any] = _MODEL["1.1"]["records"]
_CHANNELS = {"ipc": "ipc", "message": "msg"}


def _sent(by: str, since: str, on: str = "") -> tuple[str, ...]:
    """The types of messages that one side sends since a version, on a channel or on any."""
    return tuple(
        it["type"]
        for it in _MESSAGES
        if it["from"] == by and it["since"] == since and it["type"] and on in ("", *it["channels"])
    )


def _members(record: str) -> list[dict[str, Any]]:
    return list(_RECORDS[record]["members"])


KNOWN_VERSIONS = set(_MODEL)
CLIENT_1_0, CLIENT_1_1 = _sent("client", "1.0"), _sent("client", "1.1")
POSES = tuple(
    it["type"]
    for it in _MESSAGES
    if it["type"] in CLIENT_1_0 and "position" in map(itemgetter("name"), _members(it["record"]))
)
REPLY_TO: dict[str, str] = {
    it["answers"]: it["type"]
    for it in _MESSAGES
    if it["from"] == "server" and it["channels"] == ["message"] and it["answers"]
} | {"set_viewport": "viewport_size"}
"""Each request, and the type of its reply after `welcome`."""
REQUESTS, REPLIES = tuple(REPLY_TO), tuple(dict.fromkeys(REPLY_TO.values()))
REQUESTS_1_0 = tuple(it for it in REQUESTS if it in CLIENT_1_0)
_ON_MSG = tuple(it for it in _sent("client", "1.1", "message") if it != "hello")
ADDED_MEMBERS = {
    it["type"]: added
    for it in _MESSAGES
    if it["type"] in CLIENT_1_0
    and (added := tuple(m["name"] for m in _members(it["record"]) if m["since"] == "1.1"))
}
"""What 1.1 adds to messages of 1.0."""


def newer(message: dict[str, Any]) -> set[str]:
    """What 1.0 does not define of a client's message on the message channel, `hello` aside: its
    type, or members of it.
    """
    kind = str(message.get("type"))
    if kind not in (*CLIENT_1_0, "hello"):
        return {kind}
    return message.keys() & set(ADDED_MEMBERS.get(kind, ()))


SERVER_1_1 = tuple(it for it in _sent("server", "1.1") if it not in REPLIES)
CAPABILITIES = {
    channel: tuple(name for name, on in _MODEL["1.1"]["capabilities"].items() if on == known)
    for known, channel in _CHANNELS.items()
}
NEEDS: dict[str, str] = {
    it["type"]: it["capability"] for it in _MESSAGES if it["from"] == "client" and it["capability"]
}
"""The capability that a message of a client belongs to."""
_CODES = next(it["values"] for it in _members("Error") if it["name"] == "code")
CLOSING_ERRORS, OTHER_ERRORS = tuple(_CODES[:5]), tuple(_CODES[5:])
INIT_MEMBERS = tuple(
    it["name"] for it in _members("InitPacket") if it["name"] not in ("version", "generation")
)

_VENDORS_NAME = re.compile(r"(x-[a-z0-9_]+)-[a-z0-9_]+")
_LETTERS = re.compile("[^a-z]")
_BY_LETTERS = {_LETTERS.sub("", name): name for name in (*CLIENT_1_0, *_ON_MSG)}
_SIGNS = {
    "viewport_size": "viewport_size",
    "timeRange": "scene",
    "serverTime": "pong",
    "position": "camera",
    "rotation": "camera",
}
"""Members that give a reply away whose type does not."""


def _shape(record: str) -> Shape:
    """Where numbers belong in a record."""
    found = {it["name"]: _shape_of(it) for it in _members(record)}
    return {name: shape for name, shape in found.items() if shape}


def _shape_of(member: dict[str, Any]) -> Shape:
    if member["type"] in ("number", "integer"):
        return NUMBER
    if member["type"] == "record":
        return _shape(member["record"])
    items = _shape_of(member["items"]) if "items" in member else None
    return [items] if items else None


_SHAPES: dict[str, Shape] = {it["name"]: _shape(it["record"]) for it in _MESSAGES}
_AFTER_WELCOME = ("id", "intrinsics")
"""Members that mean something after `welcome` only."""


def kind_of(channel: Channel, direction: Direction, value: dict[str, Any]) -> str | None:
    """What a message is meant to be, by its type or else by its members; None if nothing known.

    All have the name of their type, but `init_packet`, which has none.
    """
    return _from_client(value) if direction == "c2s" else _from_server(channel, value)


@cache
def shape_of(kind: str | None, *, negotiated: bool) -> Shape:
    """Where numbers belong in a message of this kind, which is one after `welcome` or not."""
    shape = _SHAPES.get(kind or "", {})
    return {it: shape[it] for it in shape if negotiated or it not in _AFTER_WELCOME}


def vendor(name: str) -> str | None:
    """The `x-` and the name of a vendor with which a name of theirs begins; None if it is none."""
    found = _VENDORS_NAME.fullmatch(name)
    return found and found[1]


def _from_client(value: dict[str, Any]) -> str | None:
    kind = value.get("type")
    if isinstance(kind, str):
        if kind in CLIENT_1_0 or kind in CLIENT_1_1:
            return kind
        if near := _BY_LETTERS.get(_LETTERS.sub("", kind.lower())):
            return near
    if "position" in value and "rotation" in value:
        return "object_pose" if "object" in value else "camera_pose"
    return "get_camera_pose" if "cam_idx" in value else None


def _from_server(channel: Channel, value: dict[str, Any]) -> str | None:
    kind = value.get("type")
    if kind in SERVER_1_1:
        return str(kind)
    if channel == "ipc":
        untyped = not isinstance(kind, str)
        meant = "meta" in value or (untyped and any(name in value for name in INIT_MEMBERS))
        return "init_packet" if meant else None
    given_away = [reply for sign, reply in _SIGNS.items() if sign in value]
    if kind in REPLIES and (kind in given_away or not given_away):
        return str(kind)
    return next(iter(given_away), None)
