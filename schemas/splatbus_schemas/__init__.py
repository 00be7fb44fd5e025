"""The standard, for machines: JSON Schemas, framing and limits as data, and the requirements.

`limits` and `framing` are constants read once; schemas and requirements are read when asked for.
"""

import json
from collections.abc import Mapping
from importlib.resources import files
from types import MappingProxyType
from typing import Any

__all__ = ["FRAMING", "LIMITS", "VERSIONS", "read_json"]

VERSIONS = ("1.0", "1.1")


def read_json(*path: str) -> Any:
    """The JSON file at `path` inside this package, parsed; FileNotFoundError if there is none."""
    return json.loads(files(__name__).joinpath(*path).read_text("utf-8"))


LIMITS: Mapping[str, Any] = MappingProxyType(
    {name: limit["value"] for name, limit in read_json("limits.json")["limits"].items()}
)
"""Every limit of the specification by its name there (1.0 section 9.1, 1.1 section 1.4)."""

FRAMING: Mapping[str, Any] = MappingProxyType(read_json("framing.json"))
"""How packets are delimited, and where the two channels are found (1.0 chapters 2 and 3)."""
