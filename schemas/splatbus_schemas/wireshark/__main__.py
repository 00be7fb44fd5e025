"""Write a dissector for Wireshark and tshark, in Lua."""

from __future__ import annotations

import argparse
import sys
from importlib.resources import files
from pathlib import Path
from typing import Any

from splatbus_schemas.data import read_json
from splatbus_schemas.model.metamodel import metamodel

Json = dict[str, Any]
KINDS = {"integer": "int64", "number": "double", "string": "string", "boolean": "bool"}
OWN = ("message", "channel", "from", "length")
"""Fields that are no members of a message."""


def source() -> str:
    """The dissector's source."""
    code = (files("splatbus_schemas") / "wireshark" / "splatbus.lua").read_text("utf-8")
    before, after = code.split("local METAMODEL = nil\n")
    return f"{before}local METAMODEL = {lua(tables())}\n{after}"


def tables() -> Json:
    """What the dissector knows of the protocol; of each message as the newest version has it."""
    model = metamodel()
    framing, limits = (read_json(model[name]) for name in ("framing", "limits"))
    newest: dict[str, Json] = {}
    for version in model["versions"].values():
        for message in version["messages"]:
            newest[message["name"]] = _message(message, version["records"][message["record"]])
    kinds: dict[str, set[str]] = {}
    for message in newest.values():
        for member in message["members"]:
            kinds.setdefault(member["field"], set()).add(member["kind"])
    return {
        "header": framing["length"]["bytes"],
        "order": framing["length"]["byteOrder"],
        "least": limits["limits"]["min_payload_bytes"]["value"],
        "most": limits["limits"]["max_payload_bytes"]["value"],
        "requirements": " and ".join(limits["limits"]["max_payload_bytes"]["requirements"]),
        "ports": {name: each["defaultPort"] for name, each in framing["channels"].items()},
        "fields": {name: next(iter(of)) for name, of in kinds.items() if len(of) == 1},
        "messages": list(newest.values()),
    }


def _message(message: Json, record: Json) -> Json:
    members = record["members"]
    return {
        "name": message["name"],
        "type": message["type"],
        "from": message["from"],
        "channels": dict.fromkeys(message["channels"], True),
        "required": [each["name"] for each in members if each["required"]],
        "members": [
            _member(message, each)
            for each in members
            if each["type"] in KINDS and each["name"] != "type"
        ],
    }


def _member(message: Json, member: Json) -> Json:
    name, kind = member["name"], member["type"]
    # Older peers may mean something else by a member that came later.
    is_bound = member["since"] == message["since"]
    return {
        "name": name,
        "field": f"{message['name']}.{name}" if name in OWN else name,
        "kind": KINDS[kind],
        "shown": kind == "integer" or "values" in member,
        "minimum": member.get("minimum") if is_bound else None,
        "maximum": member.get("maximum") if is_bound else None,
        "requirements": " and ".join(member["requirements"]),
    }


def lua(value: Any, indent: str = "") -> str:
    """A value of JSON as a constructor of Lua; what is null is left out."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    deeper = indent + "  "
    if isinstance(value, dict):
        items = [f"{_key(k)} = {lua(v, deeper)}" for k, v in value.items() if v is not None]
    else:
        items = [lua(each, deeper) for each in value]
    text = "{" + ", ".join(items) + "}"
    if len(indent + text) < 90 or not items:
        return text
    return "{\n" + "".join(f"{deeper}{item},\n" for item in items) + indent + "}"


def _key(name: str) -> str:
    return name if name.isidentifier() else f'["{name}"]'


def main(argv: list[str] | None = None) -> int:
    """Print the dissector, or write it."""
    parser = argparse.ArgumentParser(
        prog="python -m splatbus_schemas.wireshark", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--output", type=Path, metavar="FILE", help="instead of printing it")
    chosen = parser.parse_args(argv)
    if chosen.output:
        chosen.output.write_text(source(), "utf-8")
    else:
        sys.stdout.write(source())
    return 0


if __name__ == "__main__":
    sys.exit(main())
