"""Pages of the JSON Schemas: for each message what it is, its members and its examples."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from splatbus_schemas import VERSIONS, examples, names, schema

from .markdown import table


def pages() -> dict[str, str]:
    """A page for each message of each version, and one that lists them, by their paths."""
    found = {f"schemas/{version}/README.md": listing(version) for version in VERSIONS}
    for version in VERSIONS:
        for name in names(version):
            found[f"schemas/{version}/{name}.md"] = page(name, version)
    return found


def listing(version: str) -> str:
    """The messages of one version."""
    rows = (
        (
            f"[{schema(name, version)['title']}]({name}.md)",
            schema(name, version)["description"],
            f"[raw]({_raw(name, version)})",
        )
        for name in names(version)
    )
    return (
        f"# Messages of {version}\n\n"
        f"A [JSON Schema](../README.md) of each message as {version} knows it; "
        f"[all in one]({_raw('bundle', version, '.json')}).\n\n"
        + table(("message", "what it is", "schema"), rows)
    )


def page(name: str, version: str) -> str:
    """One message: its description, its members, its schema, valid and invalid examples."""
    found = schema(name, version)
    valid, invalid = examples(name, version)
    text = (
        f"# `{name}` in {version}\n\n{found['description']}.\n\n"
        f"[{name}.schema.json]({_raw(name, version)}) · "
        f"[examples]({_raw(f'examples/{name}', version, '.json')}) · `{found['$id']}`\n"
    )
    if members := list(_members(found)):
        text += "\n## Members\n\n" + table(("member", "presence", "meaning"), members)
    if comment := found.get("$comment"):
        text += f"\n## What the schema does not say\n\n{comment}\n"
    text += "\n## Valid examples\n"
    for each in valid:
        text += f"\n{_sentence(each.why)}\n\n{_code(each.message)}"
    text += "\n## Invalid examples\n\nEach breaks one requirement at one place.\n"
    for broken in invalid:
        place = f"`{broken.pointer}`" if broken.pointer else "the message itself"
        text += f"\n{_sentence(broken.why)} Breaks {broken.requirement} at {place}.\n\n"
        text += _code(broken.message)
    return f"{text}\n## Schema\n\n```json\n{json.dumps(found, indent=2, ensure_ascii=False)}\n```\n"


def _members(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    required = found.get("required", [])
    for name, member in found.get("properties", {}).items():
        what = _described(member, found)
        yield f"`{name}`", "required" if name in required else "optional", what


def _described(member: Mapping[str, Any], within: Mapping[str, Any]) -> str:
    if "description" in member:
        return str(member["description"])
    if (reference := member.get("$ref", "")).startswith("#/$defs/"):
        return _described(within["$defs"][reference.removeprefix("#/$defs/")], within)
    if "const" in member:
        return f"`{json.dumps(member['const'])}`"
    return f"as `{reference}`" if reference else ""


def _raw(name: str, version: str, ending: str = ".schema.json") -> str:
    return f"../splatbus_schemas/{version}/{name}{ending}"


def _sentence(why: str) -> str:
    return f"{why[:1].upper()}{why[1:]}."


def _code(message: Any) -> str:
    return f"```json\n{json.dumps(message, ensure_ascii=False)}\n```\n"
