"""The JSON files of this package, read."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

VERSIONS = ("1.0", "1.1")
_PACKAGE = Path(__file__).parent
_SCHEMA = ".schema.json"


class ValidExample(NamedTuple):
    """A message that breaks no rule of its schema, and what is worth seeing in it."""

    why: str
    message: Any


class InvalidExample(NamedTuple):
    """A message that breaks one requirement, at the JSON pointer `pointer` (RFC 6901)."""

    why: str
    requirement: str
    pointer: str
    message: Any


def known_to(version: str) -> tuple[str, ...]:
    """The versions whose sentences hold for a peer of this one: those up to it."""
    return VERSIONS[: VERSIONS.index(version) + 1]


def read_json(*path: str) -> Any:
    """The JSON file at `path` inside this package, parsed; FileNotFoundError if there is none."""
    return json.loads(_PACKAGE.joinpath(*path).read_text("utf-8"))


def names(version: str | None) -> list[str]:
    """What has a schema: the messages of one version, or with None this package's data files."""
    folder = _PACKAGE / version if version else _PACKAGE
    found = (file.name for file in folder.iterdir())
    return sorted(name.removesuffix(_SCHEMA) for name in found if name.endswith(_SCHEMA))


def schema(name: str, version: str | None) -> dict[str, Any]:
    """The JSON Schema (2020-12) of one message as `version` knows it, or with None of a data file.

    FileNotFoundError if there is none; `names(version)` lists them.
    """
    loaded: dict[str, Any] = read_json(*([version] if version else []), name + _SCHEMA)
    return loaded


def examples(name: str, version: str) -> tuple[list[ValidExample], list[InvalidExample]]:
    """The hand-written examples of one message, valid ones first; FileNotFoundError if none."""
    loaded = read_json(version, "examples", f"{name}.json")
    return (
        [ValidExample(**example) for example in loaded["valid"]],
        [InvalidExample(**example) for example in loaded["invalid"]],
    )


LIMITS: Mapping[str, Any] = MappingProxyType(
    {name: limit["value"] for name, limit in read_json("limits.json")["limits"].items()}
)
"""Every limit of the specification by its name there (1.0 section 9.1, 1.1 section 1.4)."""

FRAMING: Mapping[str, Any] = MappingProxyType(read_json("framing.json"))
"""How packets are delimited, and where the two channels are found (1.0 chapters 2 and 3)."""
